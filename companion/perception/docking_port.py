"""Reads files that describe a docking port, such as config/docks/cubesat_port.yaml."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Len

from companion.documents import Document, in_order, load_document, validate
from companion.errors import InputError, Problem
from companion.geometry.arrays import Array, frozen
from companion.geometry.rotations import rotation_from_quaternion

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
_UNIT = 1e-3  # how far from 1 a length may be that is to be 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DockingPort:
    """A body with a docking face and markers on it; its frame `t` has its origin at the body's centre."""

    name: str
    position: Array  # (3,) [m] of the body's centre, in the mother-ship's frame c
    quaternion: Array  # (4,) c_from_t, and at once the attitude of a docked chaser
    normal: Array  # (3,) the way the docking face looks, unit vector in t
    side: float  # [m] of the body's cube
    docked_distance: float  # [m] between the centres of both bodies when docked
    markers: Array  # (N, 3) [m] in t, by their numbers

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (3,)))
        object.__setattr__(self, "quaternion", frozen(self.quaternion, (4,)))
        object.__setattr__(self, "normal", frozen(self.normal, (3,)))
        object.__setattr__(self, "markers", frozen(self.markers, (len(self.markers), 3)))

    @property
    def outward(self) -> Array:
        """The way the docking face looks, unit vector (3,) in c."""
        return rotation_from_quaternion(self.quaternion) @ self.normal

    @property
    def docked_position(self) -> Array:
        """Where a docked chaser's centre is (3,) [m], in c."""
        return self.position + self.docked_distance * self.outward


@dataclass(frozen=True, slots=True, kw_only=True)
class PortFile:
    """A docking port's file."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]
    position_m: Triple  # of the body's centre, in the frame of the anchors
    quaternion: Quaternion  # w, x, y, z: turns vectors of the body into the frame of the anchors
    normal: Triple  # the way the docking face looks, in the body's frame; length 1
    side_m: Annotated[float, Gt(0.0)]  # of the body's cube
    docked_distance_m: Annotated[float, Gt(0.0)]  # between the centres of both bodies when docked
    # places of the markers in the body's frame, by their numbers; four or more, not all on one line
    markers_m: Annotated[tuple[Triple, ...], Len(4, 64)]


def load_port(path: str | os.PathLike[str]) -> DockingPort:
    """Read and check a docking port's file.

    Raises:
        InputError: with every problem of the file.
    """
    document = load_document(path)
    written = validate(document, PortFile)
    problems = [*_lengths(document, written), *_markers(document, written)]
    if problems:
        raise InputError(in_order(problems))
    return DockingPort(
        name=written.name,
        position=np.array(written.position_m),
        quaternion=np.array(written.quaternion) / math.hypot(*written.quaternion),
        normal=np.array(written.normal) / math.hypot(*written.normal),
        side=written.side_m,
        docked_distance=written.docked_distance_m,
        markers=np.array(written.markers_m),
    )


def _lengths(document: Document, written: PortFile) -> list[Problem]:
    problems = []
    for key, values in (("quaternion", written.quaternion), ("normal", written.normal)):
        length = math.hypot(*values)
        if abs(length - 1.0) > _UNIT:
            problems.append(document.problem((key,), wrong=f"its length is {length:.4g}", right="its length must be 1"))
    if written.docked_distance_m < 0.5 * written.side_m:
        problems.append(
            document.problem(
                ("docked_distance_m",),
                wrong=f"{written.docked_distance_m:g} m lies inside the body",
                right=f"between the centres, so more than half its side ({0.5 * written.side_m:g} m)",
            )
        )
    return problems


def _markers(document: Document, written: PortFile) -> list[Problem]:
    markers = np.array(written.markers_m)
    spread = np.linalg.svd(markers - markers.mean(axis=0), compute_uv=False)
    if spread[1] > 1e-3:
        return []
    return [
        document.problem(
            ("markers_m",),
            wrong="all markers lie on one line",
            right="spread them over the face: the attitude needs it",
        )
    ]
