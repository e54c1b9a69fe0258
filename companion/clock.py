"""The only place that reads a clock."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """A source of monotonic time."""

    def now(self) -> float:
        """Give the time [s]; only differences mean anything."""


class MonotonicClock:
    """The machine's monotonic clock: not affected by wall-clock steps."""

    def now(self) -> float:
        """Give the time since an arbitrary start [s]."""
        return time.monotonic_ns() * 1e-9


class ManualClock:
    """A clock that stands still until it is moved: virtual time in tests and simulations."""

    def __init__(self, t: float = 0.0) -> None:
        self._t = t

    def now(self) -> float:
        """Give the time that was last set [s]."""
        return self._t

    def set(self, t: float) -> None:
        """Move to `t` [s]; time never runs backwards."""
        if t < self._t:
            raise ValueError(f"time cannot run backwards: {t} < {self._t}")
        self._t = t


class ElapsedClock:
    """Monotonic time since the clock was made: short numbers for the times of a flight."""

    def __init__(self) -> None:
        self._clock = MonotonicClock()
        self._start = self._clock.now()

    def now(self) -> float:
        """Give the time since the start [s]."""
        return self._clock.now() - self._start


def unix_time() -> float:
    """Give the wall clock [s] since 1970, for stamps that leave this computer. It steps: never measure with it."""
    return datetime.now(UTC).timestamp()
