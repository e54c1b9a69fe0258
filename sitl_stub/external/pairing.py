"""The autopilot's time of each truth message.

PX4 leaves HIL_STATE_QUATERNION.time_usec at zero (streams/HIL_STATE_QUATERNION.hpp). But one pass of its telemetry loop
sends all messages that are due within a tenth of a millisecond, HIGHRES_IMU among them, whose stamp is the time of the
simulated step. So the time of a truth message is interpolated, by times of arrival, between the stamps before and after
it: exact to a fraction of the step, whatever the speed at which the autopilot's clock runs.
"""

from typing import Any

RESTART = 0.5
"""A stamp earlier than the last by more than this [s] means that the autopilot has started anew."""
WAITING_MAX = 1000
"""Truth messages kept without a stamp."""


class Pairing:
    """Takes truth messages and stamps as they arrive; gives truth messages with their time."""

    def __init__(self) -> None:
        self._waiting: list[tuple[float, Any]] = []
        self._last: tuple[float, float] | None = None
        self.stamps = 0
        """Stamps heard so far."""
        self.restarted = False
        """Whether the autopilot's clock has jumped back."""

    def truth(self, arrival: float, message: Any) -> list[tuple[float, Any]]:
        """Take a truth message; one that has a time of its own comes back at once."""
        if message.time_usec:
            return self._stamped(message.time_usec * 1e-6, message)
        self._waiting.append((arrival, message))
        del self._waiting[:-WAITING_MAX]
        return []

    def _stamped(self, t: float, message: Any) -> list[tuple[float, Any]]:
        if self._last is not None and t < self._last[1] - RESTART:
            self.restarted = True
        self._last = (0.0, t)
        return [(t, message)]

    def stamp(self, arrival: float, t: float) -> list[tuple[float, Any]]:
        """Take a stamp `t` [s] of the autopilot's clock; gives the truth since the stamp before, with times."""
        self.stamps += 1
        before = self._last
        if before is None or t < before[1] - RESTART:
            self.restarted = before is not None
            self._last = (arrival, t)
            self._waiting.clear()
            return []
        if t <= before[1]:
            return []
        self._last = (arrival, t)
        span = arrival - before[0]
        paired = []
        for arrived, message in self._waiting:
            share = min(1.0, max(0.0, (arrived - before[0]) / span)) if span > 0.0 else 1.0
            paired.append((before[1] + share * (t - before[1]), message))
        self._waiting.clear()
        return paired
