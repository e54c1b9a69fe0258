"""How a vehicle on the ground stands to its place behind the target."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.geometry.angles import wrap_angle
from companion.messages.target import HEADING, POSITION, TargetTrack


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """How the vehicle stands to its place behind the target."""

    along: float  # [m] the place is so far ahead, along the target's heading
    across: float  # [m] and so far to the right of it
    heading: float  # [rad] the target's minus the vehicle's
    range: float  # [m] to the target's reference point
    position_std: float  # [m] largest standard deviation of the target's position

    @property
    def distance(self) -> float:
        """Distance [m] to the place."""
        return math.hypot(self.along, self.across)


def standing_of(track: TargetTrack, standoff: float) -> Standing:
    """Derive it from a track, for a place `standoff` [m] behind the target."""
    x, y = (float(v) for v in track.state[POSITION][:2])
    heading = wrap_angle(float(track.state[HEADING]))
    cosine, sine = math.cos(heading), math.sin(heading)
    return Standing(
        along=cosine * x + sine * y - standoff,
        across=cosine * y - sine * x,
        heading=heading,
        range=math.hypot(x, y),
        position_std=math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1]), 0.0)),
    )
