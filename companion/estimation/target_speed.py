"""How fast a slow target drives, for a rover whose own speed is known no better than that.

The autopilot's speed is wrong by as much as a slow leader drives, for seconds; its position is wrong by a bounded
amount. So with p the target's place in the autopilot's frame and h its heading, the mean of dp/dt . h over a time T is
wrong by about that amount divided by T. A leader that keeps its speed is then a landmark that drives: the speed
relative to it is seen, and together with its own that is the rover's.

One that crosses the rover's way need not keep its speed, nor be watched for so long. Neither slides sideways: with v
the velocity relative to it, r the unit vector to the rover's right, a the rover's sideways speed and h the target's
course, its speed s makes

    (v + s h) . r = a
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Le

from companion.geometry.arrays import Array

Seconds = Annotated[float, Gt(0.0), Le(100.0)]
Speed = Annotated[float, Gt(0.0), Le(20.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSpeedParameters:
    """Tuning."""

    memory_s: Seconds = 8.0  # over which the speed is a mean
    known_s: Seconds = 6.0  # seen to drive for so long it is known
    gap_s: Seconds = 0.5  # the way in a longer pause does not count
    least_mps: Speed = 0.12  # a slower target may as well stand,
    most_mps: Speed = 0.5  # a faster one's speed need not be known so well, and its stop must be seen at once
    crossing: Annotated[float, Gt(0.0), Le(1.0)] = 0.6  # sine of the angle between both courses from which it crosses


def crossing_speed(
    relative: Array, *, course: tuple[float, float], target_course: tuple[float, float], aside: float, least: float
) -> float | None:
    """Give the speed of a target along its course [m/s], None for one that does not cross the vehicle's.

    Args:
        relative: the vehicle's velocity (3,) [m/s] relative to the target, north, east, down.
        course: of the vehicle, a unit vector, north and east.
        target_course: of the target, likewise.
        aside: what the vehicle moves to its right [m/s], in a turn.
        least: the sine of the angle between both, from which it crosses.
    """
    sine = target_course[1] * course[0] - target_course[0] * course[1]
    if abs(sine) < least:
        return None
    return (aside - (float(relative[1]) * course[0] - float(relative[0]) * course[1])) / sine


class TargetSpeed:
    """Holds the mean.

    Args:
        parameters: the tuning.
    """

    def __init__(self, parameters: TargetSpeedParameters) -> None:
        self._p = parameters
        self.forget()

    def forget(self) -> None:
        """Begin anew: the target stands or is lost, or the frame has jumped."""
        self._last: tuple[float, float, float] | None = None  # t [s], north and east [m]
        self._elapsed = 0.0  # [s] that the mean is over
        self._mean = 0.0  # [m/s]

    @property
    def speed(self) -> float | None:
        """The target's speed along its heading [m/s], None where it is not known or of no use."""
        p = self._p
        known = self._elapsed >= p.known_s and p.least_mps <= self._mean <= p.most_mps
        return self._mean if known else None

    def update(
        self, t: float, *, north: float, east: float, course: tuple[float, float], crossing: float | None = None
    ) -> None:
        """Take the target as it is seen.

        Args:
            t: now [s].
            north: of the target in the autopilot's frame [m].
            east: likewise [m].
            course: the direction of its heading, north and east, in that frame.
            crossing: its speed [m/s], where it crosses the rover's way: far better known than from places.
        """
        last, self._last = self._last, (t, north, east)
        if last is None or not 0.0 < t - last[0] <= self._p.gap_s:
            return
        elapsed = t - last[0]
        way = course[0] * (north - last[1]) + course[1] * (east - last[2]) if crossing is None else crossing * elapsed
        self._elapsed += elapsed
        self._mean += (way - self._mean * elapsed) / min(self._elapsed, self._p.memory_s)
