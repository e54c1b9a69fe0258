"""Pad files: which tags are printed where on a platform or a body. The simulator's own reader."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sitl_stub.world.documents import DEGREES, POSITIVE, Bounds, Section, WorldFileError, read_document

FAMILY_SIZES = {"36h11": 587}
_ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """One printed tag, in board coordinates: origin at the board's centre, x forward, y right, seen from above."""

    id: int
    size: float  # [m] outer side of the black border
    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad] of the printed top edge, from +x towards +y

    def corners_board(self) -> npt.NDArray[np.float64]:
        """Give the corners top left, top right, bottom right, bottom left of the tag as printed, (4, 2) [m]."""
        half = 0.5 * self.size
        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead = np.array([half, half, -half, -half])
        right = np.array([-half, half, half, -half])
        return np.stack([self.x + c * ahead - s * right, self.y + s * ahead + c * right], axis=1)


def corners_of(tags: Sequence[Tag]) -> npt.NDArray[np.float64]:
    """Give all tags' corners, (number of tags, 4, 2) [m] in board coordinates."""
    return np.stack([tag.corners_board() for tag in tags])


@dataclass(frozen=True, slots=True, kw_only=True)
class Face:
    """A printed board that stands upright on a body.

    Its x is up (the printed top edge of a tag with heading 0), its y to the right of who looks at it.
    """

    center: tuple[float, float, float]  # [m] on the body: ahead, right and down of its reference point on the ground
    facing: float  # [rad] the way it looks, from the body's +x towards +y
    size: tuple[float, float]  # [m] along x and y
    tags: tuple[Tag, ...]

    def body_from_board(self) -> npt.NDArray[np.float64]:
        """Give the rotation (3, 3) from the board's axes to the body's."""
        c, s = math.cos(self.facing), math.sin(self.facing)
        return np.array([[0.0, s, -c], [0.0, -c, -s], [-1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Pad:
    """What is printed on a target: the top of a platform, or the faces of a body."""

    name: str
    family: str
    size: tuple[float, float]  # [m] along x and y: of the platform, or the footprint of the body
    landing_point: tuple[float, float]  # [m] in board coordinates
    landing_heading: float  # [rad] from the board's +x towards +y
    tags: tuple[Tag, ...]  # on the top; none on a body
    faces: tuple[Face, ...] = ()  # of a body; none on a platform

    @property
    def boards(self) -> tuple[Pad | Face, ...]:
        """The printed surfaces: the top, or all faces."""
        return self.faces or (self,)


def find_pad(name: str, beside: Path | None = None) -> Path:
    """Give the path of a pad file.

    `name` is a path that ends in .yaml (relative ones count from the folder `beside`, then from the working folder), or
    the name of a file in `config/pads`. Raises `WorldFileError` where there is none.
    """
    if name.endswith((".yaml", ".yml")):
        candidates = [Path(name)] if beside is None else [beside / name, Path(name)]
    else:
        candidates = [base / "config" / "pads" / f"{name}.yaml" for base in (Path.cwd(), _ROOT)]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    tried = ", ".join(str(candidate) for candidate in candidates)
    raise WorldFileError(f"no pad file for '{name}': looked for {tried}")


def load_pad(path: Path) -> Pad:
    """Read a pad file; raises `WorldFileError`."""
    document = read_document(path)
    document.integer("version", bounds=Bounds(low=1, high=1))
    family = document.choice("family", tuple(FAMILY_SIZES))
    size = document.vector("size_m", 2, bounds=Bounds(above=0.0, high=100.0))
    tags = tuple(_tag(section, family, size) for section in document.sections("tags"))
    faces = tuple(_face(section, family) for section in document.sections("faces"))
    point = document.vector("landing_point_m", 2, (0.0, 0.0))
    pad = Pad(
        name=document.text("name", path.stem),
        family=family,
        size=(size[0], size[1]),
        landing_point=(point[0], point[1]),
        landing_heading=math.radians(document.number("landing_heading_deg", 0.0, DEGREES)),
        tags=tags,
        faces=faces,
    )
    document.finish()
    if tags and faces:
        raise document.error("faces", "a platform has tags on its top, a body has faces: give one of the two")
    if faces and pad.landing_point != (0.0, 0.0):
        raise document.error("landing_point_m", "a body's faces count from its reference point: leave it out")
    everything = [tag for board in pad.boards for tag in board.tags]
    if not everything:
        raise document.error("tags", "at least one tag is needed")
    seen: set[int] = set()
    for index, tag in enumerate(everything):
        if tag.id in seen:
            raise document.error("faces" if faces else "tags", f"tag {index}: id {tag.id} stands twice")
        seen.add(tag.id)
    return pad


def _face(section: Section, family: str) -> Face:
    size = section.vector("size_m", 2, bounds=Bounds(above=0.0, high=100.0))
    face = Face(
        center=(section.number("x_m"), section.number("y_m"), -section.number("height_m", bounds=POSITIVE)),
        facing=math.radians(section.number("facing_deg", bounds=DEGREES)),
        size=(size[0], size[1]),
        tags=tuple(_tag(part, family, size) for part in section.sections("tags")),
    )
    section.finish()
    if not face.tags:
        raise section.error("tags", "at least one tag is needed")
    return face


def _tag(section: Section, family: str, size: tuple[float, ...]) -> Tag:
    tag = Tag(
        id=section.integer("id", bounds=Bounds(low=0, high=FAMILY_SIZES[family] - 1)),
        size=section.number("size_m", bounds=POSITIVE),
        x=section.number("x_m"),
        y=section.number("y_m"),
        heading=math.radians(section.number("heading_deg", 0.0, DEGREES)),
    )
    section.finish()
    reach = np.abs(tag.corners_board()).max(axis=0)
    if reach[0] > 0.5 * size[0] + 1e-9 or reach[1] > 0.5 * size[1] + 1e-9:
        raise section.error(None, f"tag {tag.id} does not fit on the board of {size[0]:g} m x {size[1]:g} m")
    return tag
