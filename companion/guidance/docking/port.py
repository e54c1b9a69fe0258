"""Where to dock, in which attitude, and where a point lies against the docking face."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.guidance.docking.goal_point import Triple, across, along, dot, minus, norm, scaled

_UNIT_TOLERANCE = 1e-3


def triple(vector: Array) -> Triple:
    """Give a vector (3,) as three plain numbers."""
    x, y, z = vector.tolist()
    return x, y, z


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DockingSetup:
    """The docked pose of the chaser and the attitude that it is to keep until it turns."""

    position: Array  # (3,) [m] of the docked chaser's centre of mass, in c
    quaternion: Array  # (4,) docking attitude, c_from_d
    normal: Array  # (3,) unit vector out of the target's docking face, towards the chaser, in c
    start_quaternion: Array  # (4,) attitude to keep on the approach, c_from_d

    def __post_init__(self) -> None:
        for name, size in (("position", 3), ("quaternion", 4), ("normal", 3), ("start_quaternion", 4)):
            value = frozen(getattr(self, name), (size,))
            if not np.all(np.isfinite(value)):
                raise ValueError(f"{name} is {value.tolist()}: it must be finite numbers")
            if name != "position":
                length = float(np.linalg.norm(value))
                if abs(length - 1.0) > _UNIT_TOLERANCE:
                    raise ValueError(f"{name} has the length {length:.4f}: it must be of length 1")
                value = frozen(value / length)
            object.__setattr__(self, name, value)


class Port:
    """The docking face in plain numbers."""

    def __init__(self, setup: DockingSetup) -> None:
        self.position = triple(setup.position)
        self.normal = triple(setup.normal)

    def before(self, distance: float) -> Triple:
        """Give the point [m] straight in front of the docked position, `distance` [m] out."""
        return along(self.position, self.normal, distance)

    def range(self, point: Triple) -> float:
        """Give the distance [m] between a point and the docked position."""
        return norm(minus(point, self.position))

    def out(self, point: Triple) -> float:
        """Give how far [m] a point is in front of the docked position, along the normal."""
        return dot(minus(point, self.position), self.normal)

    def aside(self, point: Triple) -> Triple:
        """Give the vector [m] from the normal's line to a point."""
        away = minus(point, self.position)
        return along(away, self.normal, -dot(away, self.normal))

    def angle(self, point: Triple) -> float:
        """Give the angle [rad] between the normal and the direction from the docked position to a point."""
        return math.atan2(norm(self.aside(point)), self.out(point))

    def slanted(self, point: Triple, angle: float, distance: float) -> Triple:
        """Give a point `distance` [m] out, `angle` [rad] off the normal on that side on which `point` lies."""
        aside = self.aside(point)
        length = norm(aside)
        side = scaled(aside, 1.0 / length) if length > 1e-6 else across(self.normal)
        return along(self.before(distance * math.cos(angle)), side, distance * math.sin(angle))
