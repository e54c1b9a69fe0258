"""What a vehicle can reach in a given time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from companion.geometry.arrays import Array


class Reachability(Protocol):
    """The set of places that a vehicle can be at after a time, as a signed distance."""

    def margin(self, elapsed: Array, displacement_ned: Array, velocity_ned: Array) -> Array:
        """Give how far inside the reachable set places lie [m], (N,); negative outside.

        Args:
            elapsed: (N,) [s], not negative.
            displacement_ned: (N, 3) [m] from the vehicle's present position.
            velocity_ned: (3,) [m/s] the vehicle's present velocity.
        """

    def nearest(self, elapsed: float, displacement_ned: Array, velocity_ned: Array) -> tuple[float, Array]:
        """Give the same [m] for one place (3,), and its gradient (3,) by the displacement."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantSpeedReach:
    """A sphere of radius `speed * t` (Patel et al., section 3, decoupled position and orientation)."""

    speed: float  # [m/s]

    def margin(self, elapsed: Array, displacement_ned: Array, velocity_ned: Array) -> Array:  # noqa: ARG002
        """See `Reachability.margin`; the present velocity does not matter."""
        result: Array = self.speed * elapsed - np.sqrt(np.einsum("ij,ij->i", displacement_ned, displacement_ned))
        return result

    def nearest(self, elapsed: float, displacement_ned: Array, velocity_ned: Array) -> tuple[float, Array]:  # noqa: ARG002
        """See `Reachability.nearest`."""
        return _inside(self.speed * elapsed, displacement_ned)


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceleratingReach:
    """A sphere that a vehicle of bounded speed V and acceleration A can surely fill.

    It turns its velocity v0 (clipped to V) linearly into any w, |w| <= V, within T = (V + |v0|) / A, so that the
    acceleration never passes A and the speed never V. After `reaction`, with s the time since:
    s < T: centre v0 (s - s^2 / 2T), radius V s^2 / 2T; then: centre v0 T / 2, radius V (s - T / 2).
    With l = s^2 / 2T or s - T / 2 the radius is V l, and the centre v0 (elapsed - l).
    From rest this is all that can be reached.
    """

    speed: float  # [m/s] V
    acceleration: float  # [m/s^2] A
    reaction: float = 0.0  # [s] during which the present velocity is kept

    def margin(self, elapsed: Array, displacement_ned: Array, velocity_ned: Array) -> Array:
        """See `Reachability.margin`."""
        start, turning = self._start(velocity_ned)
        moving = np.maximum(elapsed - self.reaction, 0.0)
        over = np.maximum(moving - turning, 0.0)
        blended = moving - over
        free = blended * blended * (0.5 / turning) + over
        offset = displacement_ned - (elapsed - free)[:, None] * start
        result: Array = self.speed * free - np.sqrt(np.einsum("ij,ij->i", offset, offset))
        return result

    def nearest(self, elapsed: float, displacement_ned: Array, velocity_ned: Array) -> tuple[float, Array]:
        """See `Reachability.nearest`."""
        start, turning = self._start(velocity_ned)
        moving = max(elapsed - self.reaction, 0.0)
        over = max(moving - turning, 0.0)
        blended = moving - over
        free = blended * blended * (0.5 / turning) + over
        return _inside(self.speed * free, displacement_ned - (elapsed - free) * start)

    def _start(self, velocity_ned: Array) -> tuple[Array, float]:
        """Give v0 (3,) [m/s] and T [s]."""
        north, east, down = velocity_ned.tolist()
        present = math.sqrt(north * north + east * east + down * down)
        start = velocity_ned * (self.speed / present) if present > self.speed else velocity_ned
        return start, (self.speed + min(present, self.speed)) / self.acceleration


def _inside(radius: float, offset: Array) -> tuple[float, Array]:
    """Give how far inside a sphere [m] a place at an offset (3,) [m] from its centre is, and the gradient (3,)."""
    north, east, down = offset.tolist()
    distance = math.sqrt(north * north + east * east + down * down)
    return radius - distance, offset * (-1.0 / max(distance, 1e-9))
