"""How long a target went unseen, by the capture times of fused measurements."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True, kw_only=True)
class Sight:
    """Keeps the longest time without a fused measurement."""

    gap: float = 0.0  # [s] between two of them
    last: float | None = None  # [s] newest capture time

    def take(self, t: float, *, anew: bool) -> None:
        """Take a capture time [s]; the same one may come many times. `anew`: nothing before it counts."""
        if self.last is None or anew:
            self.last = t
        elif t > self.last:
            self.gap, self.last = max(self.gap, t - self.last), t

    def longest(self, end: float) -> float | None:
        """Give the longest gap [s] up to an end [s]; None: it was never seen."""
        return None if self.last is None else max(self.gap, end - self.last)
