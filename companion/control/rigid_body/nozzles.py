"""Where the nozzles of a spacecraft sit, and what they do to it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from companion.geometry.arrays import Array

Vector = tuple[float, float, float]


def x_layout(*, face: float, corner: float, axial: float) -> tuple[tuple[Vector, ...], tuple[Vector, ...]]:
    """Give places [m] and force directions of ten nozzles in the X layout of the TPODS modules (Parikh et al., II).

    Five sit on each of the faces +x and -x: four at the corners of a square, one in its middle, which pushes along x.
    A corner nozzle pushes along the face, across its own lever arm, and a little (`axial`) into the body, so that its
    plume leaves the face. Neighbouring corners turn the body in opposite senses, hence every force and every torque can
    be made. In order: face +x with its corners from (+y, +z) on about x, its middle; then face -x.

    Args:
        face: distance of the faces from the centre of mass [m].
        corner: distance of the corner nozzles from the middles of their face, along y and along z [m].
        axial: component of a corner nozzle's force into the body, 0 to 1.
    """
    places: list[Vector] = []
    directions: list[Vector] = []
    across = math.sqrt(1.0 - axial * axial)
    for sign in (1.0, -1.0):
        for k in range(4):
            at = math.pi / 4 + k * math.pi / 2
            push = at + math.pi + math.copysign(math.pi / 2, 1 if k % 2 == 0 else -1)
            reach = corner * math.sqrt(2.0)
            places.append((sign * face, reach * math.cos(at), reach * math.sin(at)))
            directions.append((-sign * axial, across * math.cos(push), across * math.sin(push)))
        places.append((sign * face, 0.0, 0.0))
        directions.append((-sign, 0.0, 0.0))
    return tuple(places), tuple(directions)


def effectiveness(places: Sequence[Vector], directions: Sequence[Vector], thrust: float) -> Array:
    """Give the matrix (6, N) that turns on-times [s] into impulse [N s] and angular impulse [N m s], in d.

    Args:
        places: of the nozzles against the centre of mass [m], in d.
        directions: unit vectors of their forces, in d.
        thrust: of each [N].
    """
    forces = thrust * np.array(directions, dtype=np.float64)
    return np.vstack([forces.T, np.cross(np.array(places, dtype=np.float64), forces).T])
