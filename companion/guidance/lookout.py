"""Looking about for a lost target: where a vehicle on the ground points its camera, one heading after the other.

First to where the forecast has the target; not seen there, to both sides of that by turns, a step farther each time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Interval

from companion.geometry.angles import wrap_angle


@dataclass(frozen=True, slots=True, kw_only=True)
class LookoutParameters:
    """How it looks about."""

    step_rad: Annotated[float, Gt(0.0), Interval(le=1.6)] = 0.7  # to the next heading: less than the picture
    facing_rad: Annotated[float, Gt(0.0), Interval(le=0.8)] = 0.2  # nearer to a heading than this it looks there
    look_s: Annotated[float, Interval(ge=0.0, le=30.0)] = 1.5  # for so long
    patience_s: Annotated[float, Gt(0.0), Interval(le=60.0)] = 10.0  # a heading not reached in this is left out


class Lookout:
    """Holds which heading is being looked to.

    Args:
        parameters: how it looks about.
    """

    def __init__(self, parameters: LookoutParameters) -> None:
        self._p = parameters
        self.begin(0.0, 0.0)

    def begin(self, t: float, yaw: float) -> None:
        """Begin anew at `t` [s], ahead of a vehicle at the heading `yaw` [rad]."""
        self._centre = yaw
        self._count = 0
        self._t_turned = t  # [s] since when it turns to the present heading
        self._facing_since: float | None = None

    def turn(self, yaw: float) -> None:
        """Follow a reset of the autopilot's heading by `yaw` [rad]."""
        self._centre += yaw

    def heading(self, t: float, *, yaw: float, expected: float | None) -> float:
        """Give the heading to turn to [rad].

        Args:
            t: now [s].
            yaw: the vehicle's heading [rad].
            expected: heading at which the forecast has the target [rad]; None: there is no forecast.
        """
        p = self._p
        if self._count == 0 and expected is not None:
            self._centre = expected
        wanted = self._wanted
        if abs(wrap_angle(wanted - yaw)) > p.facing_rad:
            self._facing_since = None
        elif self._facing_since is None:
            self._facing_since = t
        looked = self._facing_since is not None and t - self._facing_since >= p.look_s
        if looked or t - self._t_turned > p.patience_s:
            self._count += 1
            self._t_turned, self._facing_since = t, None
        return self._wanted

    @property
    def _wanted(self) -> float:
        side = 1.0 if self._count % 2 else -1.0
        return wrap_angle(self._centre + side * ((self._count + 1) // 2) * self._p.step_rad)
