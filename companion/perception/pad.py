"""A pad: several tags on one board, with one landing point and one heading.

Coordinates on the board: origin at its centre, x ahead, y right, seen from above. The frame `pad` has its origin at the
landing point and its x axis along the landing heading.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from companion.errors import InputError, Problem
from companion.geometry.arrays import Array, frozen

TAG_COUNT = 587  # ids of the family 36h11
FAMILY = "36h11"
_LARGEST_SIZE = 100.0  # [m] nothing larger is a landing pad


@dataclass(frozen=True, slots=True, kw_only=True)
class PadTag:
    """One tag on the board."""

    id: int
    size: float  # [m] side of the black frame
    x: float  # [m] centre, on the board
    y: float  # [m]
    heading: float  # [rad] direction of the printed top edge, on the board


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pad:
    """Where the tags are, and where to land.

    Raises:
        InputError: an id is repeated or is not of the family, a size is not positive, a number is not finite, a tag
            overlaps another or hangs over the board's rim. Names every problem.
    """

    name: str
    size: tuple[float, float]  # [m] of the board along x and y
    landing_point: tuple[float, float]  # [m] on the board
    landing_heading: float  # [rad] on the board
    tags: tuple[PadTag, ...]
    corners: dict[int, Array] = field(init=False, repr=False, default_factory=dict)  # by id: (4, 3) [m] in `pad`

    def __post_init__(self) -> None:
        problems = [
            Problem(source="pad", line=None, column=None, key=".".join(map(str, path)), wrong=wrong, right=right)
            for path, wrong, right in pad_problems(self)
        ]
        if problems:
            raise InputError(problems)
        for tag in self.tags:
            self.corners[tag.id] = frozen(_in_pad(self, _corners_on_board(tag)), (4, 3))

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the tags, in the order of the pad."""
        return tuple(tag.id for tag in self.tags)

    @property
    def all_corners(self) -> Array:
        """Corners (T, 4, 3) [m] of all tags in `pad`, in the order of `tags`."""
        return np.stack([self.corners[tag.id] for tag in self.tags])


PadProblem = tuple[tuple[str | int, ...], str, str]  # place, what was wrong, what would be right


def single_tag_pad(tag_id: int, size: float) -> Pad:
    """Give the pad that is one tag of side `size` [m], landing point at its centre."""
    tag = PadTag(id=tag_id, size=size, x=0.0, y=0.0, heading=0.0)
    return Pad(name=f"tag {tag_id}", size=(size, size), landing_point=(0.0, 0.0), landing_heading=0.0, tags=(tag,))


class PadNumbers(Protocol):
    """What `pad_problems` looks at: a `Pad`, or the numbers of a file that may not become one."""

    @property
    def size(self) -> tuple[float, float]:
        """Board [m]."""

    @property
    def landing_point(self) -> tuple[float, float]:
        """On the board [m]."""

    @property
    def landing_heading(self) -> float:
        """On the board [rad]."""

    @property
    def tags(self) -> tuple[PadTag, ...]:
        """Tags on the board."""


def pad_problems(pad: PadNumbers) -> list[PadProblem]:
    """Give everything that is wrong with a pad."""
    problems: list[PadProblem] = []
    for axis, size in enumerate(pad.size):
        if not 0.0 < size <= _LARGEST_SIZE:
            problems.append((("size", axis), f"is {size} m", "the board has a positive size, such as 0.8"))
    numbers = (*pad.landing_point, pad.landing_heading)
    if not all(math.isfinite(number) for number in numbers):
        problems.append((("landing_point",), "is not finite", "give the landing point in metres on the board"))
    elif not problems and any(abs(p) > s / 2.0 for p, s in zip(pad.landing_point, pad.size, strict=True)):
        problems.append((("landing_point",), "lies beside the board", "give a point on the board"))
    if not pad.tags:
        problems.append((("tags",), "the pad has no tag", "give at least one tag"))
    first_with: dict[int, int] = {}
    for index, tag in enumerate(pad.tags):
        problems.extend(_tag_problems(index, tag, first_with))
    if not problems:
        problems.extend(_layout_problems(pad))
    return problems


def _tag_problems(index: int, tag: PadTag, first_with: dict[int, int]) -> list[PadProblem]:
    problems: list[PadProblem] = []
    place = ("tags", index)
    if not 0 <= tag.id < TAG_COUNT:
        problems.append(((*place, "id"), f"there is no tag {tag.id}", f"36h11 has the ids 0 to {TAG_COUNT - 1}"))
    elif tag.id in first_with:
        problems.append(
            (
                (*place, "id"),
                f"tag {tag.id} is on the pad already (tag number {first_with[tag.id] + 1} of the list)",
                "each id may be on the pad once",
            )
        )
    first_with.setdefault(tag.id, index)
    if not 0.0 < tag.size <= _LARGEST_SIZE:
        problems.append(((*place, "size"), f"is {tag.size} m", "a tag has a positive size, such as 0.2"))
    for key, value in (("x", tag.x), ("y", tag.y), ("heading", tag.heading)):
        if not math.isfinite(value):
            problems.append(((*place, key), f"is {value}", "give a finite number"))
    return problems


def _layout_problems(pad: PadNumbers) -> list[PadProblem]:
    """Tags that hang over the rim, and tags that overlap."""
    problems: list[PadProblem] = []
    outlines = [_corners_on_board(tag) for tag in pad.tags]
    half = np.array(pad.size) / 2.0 + 1e-9
    for index, (tag, outline) in enumerate(zip(pad.tags, outlines, strict=True)):
        if bool((np.abs(outline) > half).any()):
            problems.append(
                (("tags", index), f"tag {tag.id} hangs over the rim of the board", "move it or make the board larger")
            )
    for (i, a), (j, b) in itertools.combinations(enumerate(outlines), 2):
        if _overlap(a, b):
            problems.append(
                (
                    ("tags", j),
                    f"tag {pad.tags[j].id} overlaps tag {pad.tags[i].id}",
                    "tags lie side by side with white paper between them",
                )
            )
    return problems


def _corners_on_board(tag: PadTag) -> Array:
    """Give the corners (4, 2) [m]: top left, top right, bottom right, bottom left as printed."""
    half = 0.5 * tag.size
    local = np.array([[half, -half], [half, half], [-half, half], [-half, -half]])
    c, s = math.cos(tag.heading), math.sin(tag.heading)
    result: Array = local @ np.array([[c, s], [-s, c]]) + (tag.x, tag.y)
    return result


def _in_pad(pad: Pad, points: Array) -> Array:
    """Take points (N, 2) on the board to `pad` (N, 3)."""
    c, s = math.cos(pad.landing_heading), math.sin(pad.landing_heading)
    flat = (points - pad.landing_point) @ np.array([[c, -s], [s, c]])
    return np.column_stack((flat, np.zeros(len(flat))))


def _overlap(a: Array, b: Array) -> bool:
    """Tell whether two rectangles (4, 2) overlap: no side of either separates them."""
    for polygon in (a, b):
        for side in (polygon[1] - polygon[0], polygon[2] - polygon[1]):
            on_a, on_b = a @ side, b @ side
            slack = 1e-9 * float(side @ side)
            if on_a.max() <= on_b.min() + slack or on_b.max() <= on_a.min() + slack:
                return False
    return True
