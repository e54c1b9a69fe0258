"""A pad: several tags on one board, with one landing point and one heading; or a body with tags on upright faces.

Coordinates on the board: origin at its centre, x ahead, y right, seen from above. The frame `pad` has its origin at the
landing point and its x axis along the landing heading; of a body, at its reference point on the ground, x ahead.
On a face x is up and y to the right of who looks at it.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class PadFace:
    """An upright board on a body."""

    center: tuple[float, float, float]  # [m] in `pad`: ahead, right, down
    facing: float  # [rad] the way it looks, clockwise from ahead
    size: tuple[float, float]  # [m] along x and y
    tags: tuple[PadTag, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pad:
    """Where the tags are, and where to land.

    Raises:
        InputError: an id is repeated or is not of the family, a size is not positive, a number is not finite, a tag
            overlaps another or hangs over the board's rim. Names every problem.
    """

    name: str
    size: tuple[float, float]  # [m] of the board along x and y; of a body its footprint
    landing_point: tuple[float, float]  # [m] on the board
    landing_heading: float  # [rad] on the board
    tags: tuple[PadTag, ...]  # on the board; of a body none
    faces: tuple[PadFace, ...] = ()  # of a body; of a board none
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
        for face in self.faces:
            for tag in face.tags:
                self.corners[tag.id] = frozen(_on_body(face, _corners_on_board(tag)), (4, 3))

    @property
    def upright(self) -> bool:
        """Whether it is a body with upright faces, to be looked at from the side, and nothing to land on."""
        return bool(self.faces)

    @property
    def boards_ahead(self) -> float:
        """How far the middle of a body's faces is ahead of its reference point [m]; 0 of a board."""
        return sum(face.center[0] for face in self.faces) / len(self.faces) if self.faces else 0.0

    @property
    def boards_radius(self) -> float:
        """How far a body's faces reach from their middle [m], seen from above; 0 of a board."""
        ends = []
        for face in self.faces:
            cosine, sine = math.cos(face.facing), math.sin(face.facing)
            for half in (-0.5 * face.size[1], 0.5 * face.size[1]):
                ends.append((face.center[0] - sine * half - self.boards_ahead, face.center[1] + cosine * half))
        return max((math.hypot(*end) for end in ends), default=0.0)

    def clearance(self, ahead: float, right: float) -> float:
        """Give the distance [m], seen from above, from a place in `pad` to the nearest face.

        Below zero where every face is turned away from the place: it is inside the body. Infinite of a board.

        Args:
            ahead: of the reference point [m].
            right: of the reference point [m].
        """
        if not self.faces:
            return math.inf
        nearest = min(_to_face(face, ahead, right) for face in self.faces)
        return nearest if any(_is_before(face, ahead, right) for face in self.faces) else -nearest

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the tags, in the order of the pad."""
        return tuple(self.corners)

    @property
    def all_corners(self) -> Array:
        """Corners (T, 4, 3) [m] of all tags in `pad`, in the order of `ids`."""
        return np.stack(list(self.corners.values()))


def _to_face(face: PadFace, ahead: float, right: float) -> float:
    """Give the distance [m] from a place to the stretch of floor below a face."""
    cosine, sine = math.cos(face.facing), math.sin(face.facing)
    ahead, right = ahead - face.center[0], right - face.center[1]
    along = abs(cosine * right - sine * ahead) - 0.5 * face.size[1]
    return math.hypot(cosine * ahead + sine * right, max(0.0, along))


def _is_before(face: PadFace, ahead: float, right: float) -> bool:
    cosine, sine = math.cos(face.facing), math.sin(face.facing)
    return cosine * (ahead - face.center[0]) + sine * (right - face.center[1]) > 0.0


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

    @property
    def faces(self) -> tuple[PadFace, ...]:
        """Upright boards of a body."""


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
    if not pad.tags and not pad.faces:
        problems.append((("tags",), "the pad has no tag", "give at least one tag, or faces"))
    first_with: dict[int, int] = {}
    for index, tag in enumerate(pad.tags):
        problems.extend(_tag_problems(("tags", index), tag, first_with))
    for index, face in enumerate(pad.faces):
        problems.extend(_face_problems(("faces", index), face, first_with))
    problems.extend(_body_problems(pad))
    if not problems:
        problems.extend(_layout_problems((), pad.size, pad.tags))
        for index, face in enumerate(pad.faces):
            problems.extend(_layout_problems(("faces", index), face.size, face.tags))
    return problems


def _body_problems(pad: PadNumbers) -> list[PadProblem]:
    """A body that is a platform too, or whose reference point is not where its faces count from."""
    if not pad.faces:
        return []
    problems: list[PadProblem] = []
    if pad.tags:
        problems.append((("tags",), "a body with tags on a board", "give tags or faces, not both"))
    if (*pad.landing_point, pad.landing_heading) != (0.0, 0.0, 0.0):
        place = ("landing_point",)
        problems.append((place, "a body's faces count from its reference point and heading", "leave it out"))
    return problems


def _face_problems(place: tuple[str | int, ...], face: PadFace, first_with: dict[int, int]) -> list[PadProblem]:
    problems: list[PadProblem] = []
    for axis, size in enumerate(face.size):
        if not 0.0 < size <= _LARGEST_SIZE:
            problems.append(((*place, "size", axis), f"is {size} m", "a face has a positive size, such as 0.45"))
    if not all(math.isfinite(number) for number in (*face.center, face.facing)):
        problems.append(((*place, "x"), "is not finite", "give the face's centre in metres, its direction in degrees"))
    if not face.tags:
        problems.append(((*place, "tags"), "the face has no tag", "give at least one tag"))
    for index, tag in enumerate(face.tags):
        problems.extend(_tag_problems((*place, "tags", index), tag, first_with))
    return problems


def _tag_problems(place: tuple[str | int, ...], tag: PadTag, first_with: dict[int, int]) -> list[PadProblem]:
    problems: list[PadProblem] = []
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
    first_with.setdefault(tag.id, len(first_with))
    if not 0.0 < tag.size <= _LARGEST_SIZE:
        problems.append(((*place, "size"), f"is {tag.size} m", "a tag has a positive size, such as 0.2"))
    for key, value in (("x", tag.x), ("y", tag.y), ("heading", tag.heading)):
        if not math.isfinite(value):
            problems.append(((*place, key), f"is {value}", "give a finite number"))
    return problems


def _layout_problems(
    place: tuple[str | int, ...], size: tuple[float, float], tags: tuple[PadTag, ...]
) -> list[PadProblem]:
    """Tags that hang over a board's rim, and tags that overlap."""
    problems: list[PadProblem] = []
    outlines = [_corners_on_board(tag) for tag in tags]
    half = np.array(size) / 2.0 + 1e-9
    for index, (tag, outline) in enumerate(zip(tags, outlines, strict=True)):
        if bool((np.abs(outline) > half).any()):
            problems.append(
                (
                    (*place, "tags", index),
                    f"tag {tag.id} hangs over the rim of the board",
                    "move it or make the board larger",
                )
            )
    for (i, a), (j, b) in itertools.combinations(enumerate(outlines), 2):
        if _overlap(a, b):
            problems.append(
                (
                    (*place, "tags", j),
                    f"tag {tags[j].id} overlaps tag {tags[i].id}",
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


def _on_body(face: PadFace, points: Array) -> Array:
    """Take points (N, 2) on an upright face to `pad` (N, 3)."""
    c, s = math.cos(face.facing), math.sin(face.facing)
    up, right = np.array([0.0, 0.0, -1.0]), np.array([s, -c, 0.0])
    result: Array = np.array(face.center) + points[:, :1] * up + points[:, 1:] * right
    return result


def _overlap(a: Array, b: Array) -> bool:
    """Tell whether two rectangles (4, 2) overlap: no side of either separates them."""
    for polygon in (a, b):
        for side in (polygon[1] - polygon[0], polygon[2] - polygon[1]):
            on_a, on_b = a @ side, b @ side
            slack = 1e-9 * float(side @ side)
            if on_a.max() <= on_b.min() + slack or on_b.max() <= on_a.min() + slack:
                return False
    return True
