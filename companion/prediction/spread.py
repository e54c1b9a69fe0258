"""How fast a forecast loses sight of its target."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array

LEADS = np.array([0.5, 1.0, 3.0, 8.0])  # [s] at which the growth is learnt
LEADS.setflags(write=False)
_LEADS: list[float] = LEADS.tolist()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Growth:
    """The variance that a time s adds to each degree of freedom, unscaled: V s^2 + a s^3 / 3 + D (1 - e^(-2 k s))."""

    rate: Array  # (4,) V [m^2/s^2, rad^2/s^2] of the velocity
    manoeuvre: Array  # (4,) a [m^2/s^3, rad^2/s^3] of a random walk of the velocity
    deviation: Array  # (4,) D [m^2, rad^2] of the deviations from the motion
    decay: Array  # (4,) k [1/s] of the deviations

    def after(self, since: float | Array) -> Array:
        """Give it (4,) after a time [s], or (N, 4) after times (N, 1) [s]."""
        moved = (self.rate + self.manoeuvre * (since / 3.0)) * (since * since)
        result: Array = moved - self.deviation * np.expm1((-2.0 * since) * self.decay)
        return result

    def at_leads(self) -> Array:
        """Give it (J, 4) at the leads."""
        return self.after(LEADS[:, None])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """The same, scaled at each of `LEADS` by what past forecasts missed by; between them linear, never falling."""

    growth: Growth
    grown: Array  # (J, 4) at the leads
    first: Array  # (4,) scale before the first
    last: Array  # (4,) and after the last

    @classmethod
    def scaled(cls, growth: Growth, plain: Array, scales: Array) -> Spread:
        """Scale a growth, `plain` (J, 4) at the leads, by `scales` (J, 4)."""
        grown = np.maximum.accumulate(scales * plain, axis=0)
        return cls(growth=growth, grown=grown, first=scales[0], last=grown[-1] / np.maximum(plain[-1], 1e-12))

    def after(self, since: float) -> Array:
        """Give the variance (4,) that `since` [s] adds."""
        index = bisect_left(_LEADS, since)
        if 0 < index < len(_LEADS):
            share = (since - _LEADS[index - 1]) / (_LEADS[index] - _LEADS[index - 1])
            between: Array = (1.0 - share) * self.grown[index - 1] + share * self.grown[index]
            return between
        outside: Array = self.growth.after(since) * (self.last if index else self.first)
        return outside
