"""The space in which the vehicle may be sent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.guardian.motion import Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Fence:
    """A cylinder and a box at once, with a ceiling and a floor, about the place of the take-off, axes north and east.

    The defaults leave out the box and the floor: on a landing the commanded height goes below the ground. Convex,
    so what lies between two points inside lies inside.

    Raises:
        ValueError: the cylinder's centre is not inside the box, or the floor is not below the ceiling.
    """

    centre_north: float = 0.0  # [m]
    centre_east: float = 0.0  # [m]
    radius: Annotated[float, Gt(0.0)] = 50.0  # [m]
    north_min: float = -math.inf  # [m]
    north_max: float = math.inf  # [m]
    east_min: float = -math.inf  # [m]
    east_max: float = math.inf  # [m]
    height_min: float = -math.inf  # [m] above the place of the take-off
    height_max: float = 15.0  # [m] above the place of the take-off
    margin: Annotated[float, Ge(0.0)] = 1.0  # [m] inside every wall that commands keep away from, for tracking errors

    def __post_init__(self) -> None:
        inside = (
            self.north_min < self.centre_north < self.north_max and self.east_min < self.centre_east < self.east_max
        )
        if not inside:
            raise ValueError("the fence's centre must lie inside its box")
        if self.height_min >= self.height_max:
            raise ValueError("the fence's height_min must be below its height_max")

    def moved(self, offset: Vector) -> Fence:
        """Give the same fence elsewhere: moved by north, east and down [m]."""
        north, east, down = offset
        return Fence(
            centre_north=self.centre_north + north,
            centre_east=self.centre_east + east,
            radius=self.radius,
            north_min=self.north_min + north,
            north_max=self.north_max + north,
            east_min=self.east_min + east,
            east_max=self.east_max + east,
            height_min=self.height_min - down,
            height_max=self.height_max - down,
            margin=self.margin,
        )

    def excess(self, point: Vector, margin: float = 0.0) -> float:
        """Give how far [m] a point is beyond the nearest wall, moved inwards by `margin` [m]; negative inside."""
        north, east, down = point
        return margin + max(
            math.hypot(north - self.centre_north, east - self.centre_east) - self.radius,
            north - self.north_max,
            self.north_min - north,
            east - self.east_max,
            self.east_min - east,
            -down - self.height_max,
            self.height_min + down,
        )

    def clamp(self, point: Vector, margin: float = 0.0) -> Vector:
        """Bring a point inside the walls, moved inwards by `margin` [m]; never further from any point inside."""
        north, east, down = point
        north = _between(north, self.north_min + margin, self.north_max - margin)
        east = _between(east, self.east_min + margin, self.east_max - margin)
        dn, de = north - self.centre_north, east - self.centre_east
        distance, radius = math.hypot(dn, de), max(self.radius - margin, 0.0)
        if distance > radius:
            north = self.centre_north + dn * radius / distance
            east = self.centre_east + de * radius / distance
        return north, east, -_between(-down, self.height_min + margin, self.height_max - margin)


def _between(value: float, low: float, high: float) -> float:
    """Clamp; where the margins leave nothing between, the middle."""
    if low > high:
        return 0.5 * (low + high)
    return max(low, min(high, value))
