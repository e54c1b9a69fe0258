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


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantSpeedReach:
    """A sphere of radius `speed * t` (Patel et al., section 3, decoupled position and orientation)."""

    speed: float  # [m/s]

    def margin(self, elapsed: Array, displacement_ned: Array, velocity_ned: Array) -> Array:  # noqa: ARG002
        """See `Reachability.margin`; the present velocity does not matter."""
        result: Array = self.speed * elapsed - np.sqrt(np.einsum("ij,ij->i", displacement_ned, displacement_ned))
        return result


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceleratingReach:
    """A sphere that a vehicle of bounded speed V and acceleration A can surely fill.

    It turns its velocity v0 (clipped to V) linearly into any w, |w| <= V, within T = (V + |v0|) / A, so that the
    acceleration never passes A and the speed never V. After `reaction`, with s the time since:
    s < T: centre v0 (s - s^2 / 2T), radius V s^2 / 2T; then: centre v0 T / 2, radius V (s - T / 2).
    From rest this is all that can be reached.
    """

    speed: float  # [m/s] V
    acceleration: float  # [m/s^2] A
    reaction: float = 0.0  # [s] during which the present velocity is kept

    def margin(self, elapsed: Array, displacement_ned: Array, velocity_ned: Array) -> Array:
        """See `Reachability.margin`."""
        north, east, down = velocity_ned.tolist()
        present = math.sqrt(north * north + east * east + down * down)
        start = velocity_ned * min(1.0, self.speed / present) if present > 0.0 else velocity_ned
        turning = (self.speed + min(present, self.speed)) / self.acceleration
        coasting = np.minimum(elapsed, self.reaction)
        moving = elapsed - coasting
        blended = np.minimum(moving, turning)
        gained = blended * blended / (2.0 * turning)
        offset = displacement_ned - (coasting + blended - gained)[:, None] * start
        radius = self.speed * (gained + moving - blended)
        result: Array = radius - np.sqrt(np.einsum("ij,ij->i", offset, offset))
        return result
