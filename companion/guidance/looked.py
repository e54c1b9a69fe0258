"""How long a lost target has been waited for with pictures: a camera that comes and goes does not begin that anew."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True, kw_only=True)
class Looked:
    """Holds the time that was held with pictures since the target was last acquired."""

    seconds: float = 0.0  # [s]
    until: float = -math.inf  # [s] newest instant of the present hold

    def forget(self) -> None:
        """Begin anew: it is known where the target is."""
        self.seconds = 0.0

    def add(self, t: float, *, since: float, pictures: bool) -> float:
        """Count the time up to `t` [s].

        Args:
            t: now [s].
            since: when the present hold began [s].
            pictures: the camera gives some.

        Returns:
            The whole of it [s].
        """
        begin, self.until = max(self.until, since), t
        if pictures:
            self.seconds += t - begin
        return self.seconds
