"""Whether a flight kept to its limits: the setpoints that were sent, and the motion that came of them.

Setpoints are ours alone, so they may exceed a limit by rounding only. The true motion is also the wind's and the
wandering estimate's, so it has wider tolerances, stated in `LimitTolerances`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.campaign.result import LimitViolation
from companion.campaign.truth import TargetSample, TruthSample
from companion.geometry.angles import wrap_angle
from companion.messages.motion import AnySetpoint, MotionLimits, Setpoint, SticksSetpoint

Factor = Annotated[float, Ge(1.0)]
NotNegative = Annotated[float, Ge(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """What a flight must keep to; None: not limited."""

    motion: MotionLimits
    height: float | None = None  # [m] above the take-off point
    radius: float | None = None  # [m] horizontal distance from the take-off point
    touchdown_speed: float | None = 1.0  # [m/s] relative to the surface, at first contact


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitTolerances:
    """How far a value may exceed its limit: allowed = factor * limit + offset."""

    setpoint_factor: Factor = 1.01
    setpoint_offset: NotNegative = 0.005  # [m/s], [m/s^2], [rad/s]
    jerk_factor: Factor = 1.05  # of difference quotients of setpoints
    jerk_offset: NotNegative = 0.5  # [m/s^3], [rad/s^2]
    speed_factor: Factor = 1.15  # true speeds: overshoot,
    speed_offset: NotNegative = 0.5  # [m/s] gusts and the drift of the autopilot's velocity
    yaw_rate_factor: Factor = 1.25
    yaw_rate_offset: NotNegative = 0.2  # [rad/s]
    acceleration_factor: Factor = 1.5  # true acceleration, averaged over `acceleration_window`
    acceleration_offset: NotNegative = 1.5  # [m/s^2] gusts
    acceleration_window: Annotated[float, Gt(0.0)] = 0.2  # [s]
    fence_offset: NotNegative = 1.0  # [m] overshoot and drift of the autopilot's position


class ExcessMonitor:
    """Keeps the worst excess over each limit; a value that is no number exceeds any."""

    def __init__(self) -> None:
        self._worst: dict[str, LimitViolation] = {}

    @property
    def violations(self) -> tuple[LimitViolation, ...]:
        """What was broken so far, each limit once, at its worst, in the order of first breaking."""
        return tuple(self._worst.values())

    def _check(self, name: str, value: float, limit: float, t: float, factor: float = 1.0, offset: float = 0.0) -> None:
        """Check a value against its limit with the tolerance: allowed is factor * limit + offset."""
        allowed = factor * limit + offset
        if value <= allowed:
            return
        known = self._worst.get(name)
        if known is None or value > known.worst:
            self._worst[name] = LimitViolation(limit=name, configured=limit, allowed=allowed, worst=value, t=t)


class LimitMonitor(ExcessMonitor):
    """Watches a flight in the air."""

    def __init__(self, limits: FlightLimits, tolerances: LimitTolerances | None = None) -> None:
        super().__init__()
        self._limits = limits
        self._tolerances = tolerances or LimitTolerances()
        self._last_setpoint: tuple[float, list[float], float] | None = None
        self._start: TruthSample | None = None
        self._window: list[TruthSample] = []  # samples in the air, the last `acceleration_window`

    def setpoint(self, setpoint: Setpoint) -> None:
        """Check one setpoint as it was sent."""
        velocity, acceleration = setpoint.velocity_ned.tolist(), setpoint.acceleration_ned.tolist()
        position = [] if setpoint.position_ned is None else setpoint.position_ned.tolist()
        vectors = (*position, *velocity, *acceleration, *setpoint.feedback_velocity_ned.tolist())
        if not all(map(math.isfinite, (*vectors, setpoint.yaw, setpoint.yaw_rate))):
            self._check("setpoint finite", math.inf, 0.0, setpoint.t)
            self._last_setpoint = None
            return
        motion, allow = self._limits.motion, self._tolerances
        factor, offset = allow.setpoint_factor, allow.setpoint_offset
        for name, value, limit in (
            ("setpoint speed, horizontal", math.hypot(velocity[0], velocity[1]), motion.speed_horizontal),
            ("setpoint speed, up", -velocity[2], motion.speed_up),
            ("setpoint speed, down", velocity[2], motion.speed_down),
            (
                "setpoint acceleration, horizontal",
                math.hypot(acceleration[0], acceleration[1]),
                motion.acceleration_horizontal,
            ),
            ("setpoint acceleration, vertical", abs(acceleration[2]), motion.acceleration_vertical),
            ("setpoint yaw rate", abs(setpoint.yaw_rate), motion.yaw_rate),
        ):
            self._check(name, value, limit, setpoint.t, factor, offset)
        if setpoint.feedback_velocity_ned.any():
            self._check_sent(setpoint, velocity)
        self._check_change(setpoint.t, acceleration, setpoint.yaw_rate)

    def truth(self, sample: TruthSample) -> None:
        """Check one sample of the true motion; only in the air and armed."""
        if self._start is None:
            self._start = sample
        if sample.feet_in_contact or not sample.armed:
            self._window.clear()
            return
        motion, allow = self._limits.motion, self._tolerances
        north, east, down = sample.velocity_ned
        factor, offset = allow.speed_factor, allow.speed_offset
        self._check("speed, horizontal", math.hypot(north, east), motion.speed_horizontal, sample.t, factor, offset)
        self._check("speed, up", -down, motion.speed_up, sample.t, factor, offset)
        self._check("speed, down", down, motion.speed_down, sample.t, factor, offset)
        self._check_fence(sample, self._start)
        self._check_window(sample)

    def touchdown(self, t: float, speed: float) -> None:
        """Check the speed [m/s] at first contact."""
        if self._limits.touchdown_speed is not None:
            self._check("touchdown speed", speed, self._limits.touchdown_speed, t)

    def _check_sent(self, setpoint: Setpoint, velocity: list[float]) -> None:
        """Check the velocity on the wire: with the correction for the bias of the autopilot's estimate on top."""
        motion, allow = self._limits.motion, self._tolerances
        north, east, down = (a + b for a, b in zip(velocity, setpoint.feedback_velocity_ned.tolist(), strict=True))
        factor, offset, t = allow.speed_factor, allow.speed_offset, setpoint.t
        self._check("sent speed, horizontal", math.hypot(north, east), motion.speed_horizontal, t, factor, offset)
        self._check("sent speed, up", -down, motion.speed_up, t, factor, offset)
        self._check("sent speed, down", down, motion.speed_down, t, factor, offset)

    def _check_change(self, t: float, acceleration: list[float], yaw_rate: float) -> None:
        last, self._last_setpoint = self._last_setpoint, (t, acceleration, yaw_rate)
        if last is None or not 1e-6 < t - last[0] <= 0.1:
            return
        motion, allow = self._limits.motion, self._tolerances
        span = t - last[0]
        jerk = max(abs(a - b) for a, b in zip(acceleration, last[1], strict=True)) / span
        self._check("setpoint jerk", jerk, motion.jerk, t, allow.jerk_factor, allow.jerk_offset)
        change = abs(yaw_rate - last[2]) / span
        factor, offset = allow.jerk_factor, allow.jerk_offset
        self._check("setpoint yaw acceleration", change, motion.yaw_acceleration, t, factor, offset)

    def _check_fence(self, sample: TruthSample, start: TruthSample) -> None:
        offset = self._tolerances.fence_offset
        north, east, down = (a - b for a, b in zip(sample.position_ned, start.position_ned, strict=True))
        if self._limits.height is not None:
            self._check("height", -down, self._limits.height, sample.t, offset=offset)
        if self._limits.radius is not None:
            self._check("radius", math.hypot(north, east), self._limits.radius, sample.t, offset=offset)

    def _check_window(self, sample: TruthSample) -> None:
        motion, allow, window = self._limits.motion, self._tolerances, self._window
        window.append(sample)
        while sample.t - window[0].t > allow.acceleration_window + 1e-6:
            window.pop(0)
        span = sample.t - window[0].t
        if span < 0.9 * allow.acceleration_window:
            return
        north, east, down = _rates(sample.velocity_ned, window[0].velocity_ned, span)
        factor, offset = allow.acceleration_factor, allow.acceleration_offset
        horizontal, t = math.hypot(north, east), sample.t
        self._check("acceleration, horizontal", horizontal, motion.acceleration_horizontal, t, factor, offset)
        self._check("acceleration, vertical", abs(down), motion.acceleration_vertical, t, factor, offset)
        turn = abs(wrap_angle(sample.yaw - window[0].yaw)) / span
        self._check("yaw rate", turn, motion.yaw_rate, t, allow.yaw_rate_factor, allow.yaw_rate_offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLimits:
    """What a drive must keep to."""

    speed_forward: float  # [m/s]
    speed_reverse: float  # [m/s]
    acceleration: float  # [m/s^2]
    yaw_rate: float  # [rad/s]
    turning_radius: float  # [m]
    nearest: float  # [m] the two bodies' origins may come: nearer they touch


class DriveMonitor(ExcessMonitor):
    """Watches a drive."""

    def __init__(self, limits: DriveLimits, tolerances: LimitTolerances | None = None) -> None:
        super().__init__()
        self._limits = limits
        self._tolerances = tolerances or LimitTolerances()
        self._last: SticksSetpoint | None = None

    def setpoint(self, setpoint: AnySetpoint) -> None:
        """Check one setpoint as it was sent."""
        limits, allow = self._limits, self._tolerances
        if not isinstance(setpoint, SticksSetpoint):
            self._check("setpoint form", math.inf, 0.0, setpoint.t)
            return
        factor, offset, t = allow.setpoint_factor, allow.setpoint_offset, setpoint.t
        self._check("setpoint speed, forward", setpoint.speed, limits.speed_forward, t, factor, offset)
        self._check("setpoint speed, back", -setpoint.speed, limits.speed_reverse, t, factor, offset)
        self._check("setpoint yaw rate", abs(setpoint.yaw_rate), limits.yaw_rate, t, factor, offset)
        turning = limits.turning_radius * abs(setpoint.yaw_rate) - abs(setpoint.speed)
        self._check("setpoint turning", turning, offset, t)
        last, self._last = self._last, setpoint
        if last is not None and 1e-6 < t - last.t <= 0.1:
            rate = abs(setpoint.speed - last.speed) / (t - last.t)
            self._check("setpoint acceleration", rate, limits.acceleration, t, factor, offset)

    def truth(self, sample: TruthSample, target: TargetSample) -> None:
        """Check one sample of the true motion."""
        limits, allow = self._limits, self._tolerances
        north, east, _ = sample.velocity_ned
        forward = math.cos(sample.yaw) * north + math.sin(sample.yaw) * east
        factor, offset = allow.speed_factor, allow.speed_offset
        self._check("speed, forward", forward, limits.speed_forward, sample.t, factor, offset)
        self._check("speed, back", -forward, limits.speed_reverse, sample.t, factor, offset)
        away = [a - b for a, b in zip(target.position_ned[:2], sample.position_ned[:2], strict=True)]
        self._check("nearness to the target", limits.nearest - math.hypot(*away), 0.0, sample.t)


def _rates(now: Sequence[float], before: Sequence[float], span: float) -> tuple[float, float, float]:
    return (now[0] - before[0]) / span, (now[1] - before[1]) / span, (now[2] - before[2]) / span
