"""Reads pad files, such as config/pads/landing_pad_0p8.yaml."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt, Interval, Len

from companion.documents import Document, load_document, validate
from companion.errors import InputError
from companion.perception.pad import TAG_COUNT, Pad, PadFace, PadTag, pad_problems

# keys of the file by the names that the checks of `Pad` use
_KEYS = {
    "size": "size_m",
    "x": "x_m",
    "y": "y_m",
    "heading": "heading_deg",
    "facing": "facing_deg",
    "landing_point": "landing_point_m",
    "landing_heading": "landing_heading_deg",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TagEntry:
    """One tag of a pad file."""

    id: Annotated[int, Interval(ge=0, lt=TAG_COUNT)]
    size_m: Annotated[float, Gt(0.0)]  # side of the black frame
    x_m: float  # centre, ahead of the board's centre
    y_m: float  # centre, to the right of the board's centre
    heading_deg: float = 0.0  # direction of the printed top edge, clockwise from x


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceEntry:
    """One upright face of a body; its tags have x up and y to the right of who looks at it."""

    facing_deg: float  # the way it looks, clockwise from ahead
    x_m: float  # centre, ahead of the body's reference point
    y_m: float  # centre, to the right of it
    height_m: Annotated[float, Gt(0.0)]  # centre, above the ground
    size_m: tuple[Annotated[float, Gt(0.0)], Annotated[float, Gt(0.0)]]  # up and across
    tags: Annotated[tuple[TagEntry, ...], Len(1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PadFile:
    """A pad file."""

    version: Literal[1]
    name: str
    family: Literal["36h11"]
    size_m: tuple[Annotated[float, Gt(0.0)], Annotated[float, Gt(0.0)]]  # board, or a body's footprint, along x and y
    tags: Annotated[tuple[TagEntry, ...], Len(1)] | None = None  # on the board
    faces: Annotated[tuple[FaceEntry, ...], Len(1)] | None = None  # of a body, instead of a board
    landing_point_m: tuple[float, float] = (0.0, 0.0)  # on the board
    landing_heading_deg: float = 0.0  # on the board, clockwise from x


def load_pad(path: str | os.PathLike[str]) -> Pad:
    """Read a pad file.

    Raises:
        InputError: it cannot be read or is wrong; names every problem with its line.
    """
    return pad_from_document(load_document(path))


def pad_from_document(document: Document) -> Pad:
    """Build the pad of a parsed pad file.

    Raises:
        InputError: the file is wrong; names every problem with its line.
    """
    draft = _Draft.of(validate(document, PadFile))
    found = pad_problems(draft)
    if found:
        raise InputError(
            [
                document.problem(tuple(_KEYS.get(str(step), step) for step in path), wrong=wrong, right=right)
                for path, wrong, right in found
            ]
        )
    return Pad(
        name=draft.name,
        size=draft.size,
        landing_point=draft.landing_point,
        landing_heading=draft.landing_heading,
        tags=draft.tags,
        faces=draft.faces,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Draft:
    """The file's numbers in the units of `Pad`, unchecked."""

    name: str
    size: tuple[float, float]
    landing_point: tuple[float, float]
    landing_heading: float
    tags: tuple[PadTag, ...]
    faces: tuple[PadFace, ...]

    @classmethod
    def of(cls, file: PadFile) -> _Draft:
        return cls(
            name=file.name,
            size=file.size_m,
            landing_point=file.landing_point_m,
            landing_heading=math.radians(file.landing_heading_deg),
            tags=_tags(file.tags or ()),
            faces=tuple(
                PadFace(
                    center=(face.x_m, face.y_m, -face.height_m),
                    facing=math.radians(face.facing_deg),
                    size=face.size_m,
                    tags=_tags(face.tags),
                )
                for face in file.faces or ()
            ),
        )


def _tags(entries: tuple[TagEntry, ...]) -> tuple[PadTag, ...]:
    return tuple(PadTag(id=t.id, size=t.size_m, x=t.x_m, y=t.y_m, heading=math.radians(t.heading_deg)) for t in entries)
