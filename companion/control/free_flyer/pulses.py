"""Thrusts too small for the valves, made of pulses that are large enough.

A valve that opens for less than its least time does not open, so a small thrust would be lost, and with it every small
error of position. Its impulse is collected instead until a pulse holds half of it or more; the pulse is then commanded
for exactly one pulse period. Each thruster takes its command over once in a period, so it acts exactly once, whatever
the phase between companion and autopilot. What the pulse gave too much is owed.
"""

from __future__ import annotations

import math


class PulseMaker:
    """Collects impulses of one body axis; normalised thrust, times in [s]."""

    def __init__(self, pulse: float, period: float) -> None:
        self._pulse = pulse
        self._period = period
        self._owed = 0.0  # [s] impulse wanted and not yet given, in units of full thrust
        self._until = -math.inf  # [s] end of the present pulse
        self._sign = 0.0
        self._t = -math.inf

    def reset(self) -> None:
        """Forget what is owed."""
        self._owed, self._until, self._t = 0.0, -math.inf, -math.inf

    def update(self, t: float, wanted: float) -> float:
        """Give the thrust to command at `t` [s], -1 to 1, for the wanted one."""
        dt = min(max(t - self._t, 0.0), self._period)
        self._t = t
        if abs(wanted) >= self._pulse:
            self._owed, self._until = 0.0, -math.inf
            return wanted
        whole = self._pulse * self._period
        self._owed = max(-whole, min(whole, self._owed + wanted * dt))
        if t < self._until - 1e-6:
            return self._sign * self._pulse
        if abs(self._owed) < 0.5 * whole:
            return 0.0
        self._sign = math.copysign(1.0, self._owed)
        self._owed -= self._sign * whole
        self._until = t + self._period
        return self._sign * self._pulse
