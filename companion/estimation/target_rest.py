"""Does the target stand? For a rover whose odometry drifts as fast as slow targets drive.

The autopilot's position is wrong by a bounded amount, a few decimetres, however its speed drifts. So a target that has
not gone anywhere in that frame for some seconds stands, and one that goes away drives. While the rover itself is known
to stand, whatever moves in its view is the target, and the speed of one that crosses its way is known
(`target_speed.py`): then the answer is there at once.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Le

Positive = Annotated[float, Gt(0.0), Le(60.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetRestParameters:
    """Tuning."""

    stays_s: Positive = 5.0  # gone nowhere for so long it stands:
    stays_m: Positive = 0.45  # no farther than this from any place in that time
    leaves_s: Positive = 1.5  # in so long a standing target has left when it is
    leaves_m: Positive = 0.40  # farther away than this
    seen_slow_mps: Positive = 0.05  # its speed known: it stands,
    seen_moving_mps: Positive = 0.10  # it drives,
    seen_s: Positive = 0.4  # seen so for so long
    every_s: Positive = 0.1  # a place is remembered


class TargetRest:
    """Holds where the target has been.

    Args:
        parameters: the tuning.
    """

    def __init__(self, parameters: TargetRestParameters) -> None:
        self._p = parameters
        self._places: deque[tuple[float, float, float]] = deque()  # t [s], north and east [m]
        self._slow_since: float | None = None
        self._moving_since: float | None = None
        self.resting = False

    def forget(self) -> None:
        """Begin anew: the target is lost, or the frame has jumped."""
        self._places.clear()
        self._slow_since = self._moving_since = None
        self.resting = False

    def update(self, t: float, *, north: float, east: float, speed: float, surely: bool) -> bool:
        """Say whether the target stands.

        Args:
            t: now [s].
            north: of the target in the autopilot's frame [m].
            east: likewise [m].
            speed: of the target over ground [m/s].
            surely: that speed is known: the rover itself stands, or the target crosses its way.
        """
        p = self._p
        if surely:
            self._look(t, speed)
            return self.resting
        self._slow_since = self._moving_since = None
        gone = [(t - then, math.hypot(north - a, east - b)) for then, a, b in self._places]
        if self.resting:
            self.resting = all(way <= p.leaves_m for age, way in gone if age <= p.leaves_s)
            if not self.resting:
                self._places.clear()
        else:
            old_enough = bool(gone) and gone[0][0] >= p.stays_s
            self.resting = old_enough and all(way <= p.stays_m for _, way in gone)
        if not self._places or t - self._places[-1][0] >= p.every_s - 1e-6:
            self._places.append((t, north, east))
            while t - self._places[0][0] > p.stays_s + 2.0 * p.every_s:
                self._places.popleft()
        return self.resting

    def _look(self, t: float, speed: float) -> None:
        """Judge by a speed that is known."""
        p = self._p
        self._places.clear()
        if speed < p.seen_slow_mps:
            self._slow_since = t if self._slow_since is None else self._slow_since
            self._moving_since = None
        elif speed > p.seen_moving_mps:
            self._moving_since = t if self._moving_since is None else self._moving_since
            self._slow_since = None
        else:
            self._slow_since = self._moving_since = None
        if self._slow_since is not None and t - self._slow_since >= p.seen_s:
            self.resting = True
        if self._moving_since is not None and t - self._moving_since >= p.seen_s:
            self.resting = False
