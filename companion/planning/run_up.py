"""The last centimetres of a rover beside a target that stands: back out along its axis, and come in straight.

From rest, friction lets go all at once: a rover that is told to move by 5 cm stands, and then surges by 10. What it
does while it rolls is repeatable. So it backs out as far as a steady drive takes, comes in at one speed, and shuts the
throttle where the way it still rolls ends at its place:

    way = v delay + v^2 / (2 braking) + learned,

`learned` being what the stops before were too far or too short. On the line it steers by the place of its rear axle:
with y the offset and psi the heading, both from the line,

    psi_wanted = -+ clip(line_gain y),    curvature = +- turn_gain (psi_wanted - psi),    upper signs: forward.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, NamedTuple

from annotated_types import Gt, Le

from companion.planning.coupled.model import RoverMotion

Metres = Annotated[float, Gt(0.0), Le(10.0)]
Angle = Annotated[float, Gt(0.0), Le(1.0)]
Seconds = Annotated[float, Gt(0.0), Le(10.0)]
Speed = Annotated[float, Gt(0.0), Le(5.0)]
Gain = Annotated[float, Gt(0.0), Le(100.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunUpParameters:
    """When it is done, and how."""

    along_m: Metres = 0.007  # no farther off along the target's heading,
    across_m: Metres = 0.008  # across it,
    angle_rad: Angle = 0.003  # and turned no farther: it stays there
    begins_along_m: Metres = 0.6  # it begins, nearer than this to the place,
    begins_across_m: Metres = 0.15  # no farther aside,
    begins_rad: Angle = 0.25  # turned no farther away;
    ends_across_m: Metres = 0.3  # and it gives up farther aside,
    ends_rad: Angle = 0.5  # turned farther away,
    ends_along_m: Metres = 2.0  # or farther off
    length_m: Metres = 0.6  # of the run-up, and
    length_per_m: Gain = 4.0  # so much more of it for each metre aside,
    length_per_rad_m: Gain = 1.5  # and radian turned
    length_most_m: Metres = 1.2
    length_least_m: Metres = 0.4  # one that stands so far behind its place comes in from there
    back_mps: Speed = 0.35
    come_mps: Speed = 0.30
    delay_s: Seconds = 0.15  # from the command to the brakes
    braking_mps2: Gain = 3.0  # with the throttle shut
    learning: Annotated[float, Gt(0.0), Le(1.0)] = 0.6  # share of a stop's error that the next one allows for
    learned_most_m: Metres = 0.1
    settle_s: Seconds = 1.0  # after a stop, before it is judged or gone on from
    speed_s: Seconds = 0.25  # over which the speed is measured by the sight of the target
    line_gain: Gain = 2.5  # [rad/m]
    line_most_rad: Angle = 0.25
    turn_gain: Gain = 9.0  # [1/m]


class Motion(NamedTuple):
    """What the rover is to do now."""

    speed: float  # [m/s] along the heading
    yaw_rate: float  # [rad/s]


class _Phase(Enum):
    REST = "it stands at its place, or is about to begin"
    BACK = "it backs out"
    TURN = "it stands behind its place"
    COME = "it comes in"
    STOP = "it has shut the throttle"


class RunUp:
    """Holds what it is about, and what the stops so far have taught.

    Args:
        parameters: the tuning.
        motion: what the rover can do. One that cannot back out makes no run-up.
    """

    def __init__(self, parameters: RunUpParameters, motion: RoverMotion) -> None:
        self._p = parameters
        self._back = min(parameters.back_mps, motion.speed_reverse)  # [m/s]
        self._come = min(parameters.come_mps, motion.speed_forward)  # [m/s]
        self._curvature_most = 1.0 / motion.turning_radius
        self._phase: _Phase | None = None
        self._since = -math.inf  # [s] the phase
        self._length = 0.0  # [m] of the present run-up
        self._learned = 0.0  # [m]
        self._places: deque[tuple[float, float]] = deque()  # t [s] and along [m] of late

    def forget(self) -> None:
        """Give up what it is about; what it has learned stays."""
        self._phase = None
        self._places.clear()

    def update(self, t: float, *, along: float, across: float, heading: float) -> Motion | None:
        """Say what to do, None where this is not the matter for a run-up.

        Args:
            t: now [s].
            along: the rear axle's place is so far ahead, along the place's heading [m].
            across: and so far to the right of it [m].
            heading: of the place minus the rover's [rad].
        """
        p = self._p
        self._places.append((t, along))
        while t - self._places[0][0] > p.speed_s:
            self._places.popleft()
        if self._phase is None:
            near = abs(along) < p.begins_along_m and abs(across) < p.begins_across_m and abs(heading) < p.begins_rad
            if not near or self._back == 0.0:
                return None
            self._enter(_Phase.STOP, t)
            self._length = 0.0
        if abs(across) > p.ends_across_m or abs(heading) > p.ends_rad or abs(along) > p.ends_along_m:
            self.forget()
            return None
        self._go_on(t, along, across, heading)
        if self._phase is _Phase.BACK:
            return self._steered(-self._back, across, heading)
        if self._phase is _Phase.COME:
            return self._steered(self._come, across, heading)
        return Motion(0.0, 0.0)

    def _go_on(self, t: float, along: float, across: float, heading: float) -> None:
        """Change the phase where it is over."""
        p, settled = self._p, t - self._since >= self._p.settle_s
        if self._phase is _Phase.BACK and along >= self._length:
            self._enter(_Phase.TURN, t)
        elif self._phase is _Phase.TURN and settled:
            self._enter(_Phase.COME, t)
        elif self._phase is _Phase.COME and along <= self._way():
            self._enter(_Phase.STOP, t)
        elif self._phase is _Phase.STOP and settled:
            if self._length > 0.0:
                learned = self._learned - p.learning * along
                self._learned = max(-p.learned_most_m, min(p.learned_most_m, learned))
            self._enter(_Phase.REST, t)
        if self._phase is _Phase.REST and not self._is_good(along, across, heading):
            wanted = p.length_m + p.length_per_m * abs(across) + p.length_per_rad_m * abs(heading)
            self._length = min(p.length_most_m, wanted)
            far = along > max(p.length_least_m, wanted - p.length_least_m)
            self._enter(_Phase.COME if far else _Phase.BACK, t)

    def _is_good(self, along: float, across: float, heading: float) -> bool:
        p = self._p
        return abs(along) < p.along_m and abs(across) < p.across_m and abs(heading) < p.angle_rad

    def _way(self) -> float:
        """Give the way [m] that it rolls on after the command to stop."""
        p, (t, along), (t_first, first) = self._p, self._places[-1], self._places[0]
        speed = max(first - along, 0.0) / (t - t_first) if t > t_first else 0.0
        return speed * p.delay_s + 0.5 * speed * speed / p.braking_mps2 + self._learned

    def _steered(self, speed: float, across: float, heading: float) -> Motion:
        p, sign = self._p, math.copysign(1.0, speed)
        wanted = sign * max(-p.line_most_rad, min(p.line_most_rad, p.line_gain * across))
        curvature = sign * p.turn_gain * (wanted + heading)
        curvature = max(-self._curvature_most, min(self._curvature_most, curvature))
        return Motion(speed, curvature * speed)

    def _enter(self, phase: _Phase, t: float) -> None:
        self._phase, self._since = phase, t
