"""What a target has shown that it can do."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from companion.geometry.arrays import Array
from companion.prediction.parameters import EvidenceParameters

_BASE = 1.0  # [s] over which differences are taken: shorter ones show mostly noise
_LONGEST = 1.5  # [s] over a longer one they show too little


@dataclass(slots=True, kw_only=True)
class Shown:
    """The largest horizontal speed, horizontal acceleration and turn rate seen, not below their floors."""

    speed: float  # [m/s]
    acceleration: float  # [m/s^2]
    turn_rate: float  # [rad/s]

    @classmethod
    def nothing(cls, parameters: EvidenceParameters) -> Shown:
        """Begin with the floors."""
        return cls(
            speed=parameters.speed_floor,
            acceleration=parameters.acceleration_floor,
            turn_rate=parameters.turn_rate_floor,
        )

    def look(self, times: deque[float], poses: deque[Array]) -> None:
        """Take note of mean speed and turn rate over the last second, and of their change against the one before."""
        newest = len(times) - 1
        middle = _index_before(times, newest, _BASE)
        if middle is None:
            return
        now = _rates(times, poses, middle, newest)
        self.speed = max(self.speed, math.hypot(now[0], now[1]))
        self.turn_rate = max(self.turn_rate, abs(now[2]))
        oldest = _index_before(times, middle, _BASE)
        if oldest is not None:
            before = _rates(times, poses, oldest, middle)
            between = 0.5 * (times[newest] - times[oldest])
            change = math.hypot(now[0] - before[0], now[1] - before[1]) / between
            self.acceleration = max(self.acceleration, change)


def _index_before(times: deque[float], index: int, base: float) -> int | None:
    """Give the newest index at least `base` [s] before another, None where it is too far away or there is none."""
    t = times[index]
    for k in range(index - 1, -1, -1):
        if t - times[k] >= base - 1e-3:
            return k if t - times[k] <= _LONGEST else None
    return None


def _rates(times: deque[float], poses: deque[Array], a: int, b: int) -> tuple[float, float, float]:
    span = times[b] - times[a]
    north, east, _, heading = ((poses[b] - poses[a]) / span).tolist()
    return north, east, heading
