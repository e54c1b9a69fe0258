"""The rover's inner loop: from a wanted speed and turn to the sticks of PX4's ACRO mode.

ACRO passes the throttle stick on to the motor. What the motor then does is friction first: rolling takes a constant
force and one that grows with the square of the speed, and starting takes more than rolling. With u the throttle,

    u = sign(v) (rolling + drag v^2) + mass a + gain (v - v_now) + damping (a - a_now) + integral

and while the vehicle still stands, at least `breakaway`; one that is to change its gear will stand first. The steering
stick asks PX4 for a yaw rate r; PX4 turns the front wheels by atan(r L / d), with L the wheel base and
d = throttle x full speed its guess of the speed, and by g (r - r_now) besides when driving forwards, with g its
yaw_rate_gain (rover_ackermann, AckermannRateControl). On an arc of curvature k the wheels stand at atan(L k) and
r_now = k v_now, hence atan(r L / d) + g (r - k v_now) = atan(L k), which one step of Newton's method from r = k d
solves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

Share = Annotated[float, Ge(0.0), Le(1.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveParameters:
    """The drive train, and the loop that closes over it; the defaults are those of the simulated rover."""

    rolling: Share = 0.142  # throttle that rolling takes at any speed
    drag: Annotated[float, Ge(0.0)] = 0.095  # [1 / (m/s)^2] throttle on top
    breakaway: Share = 0.26  # throttle that starts it from rest
    started_mps: Annotated[float, Gt(0.0)] = 0.10  # change of the estimated speed that shows that it has started
    start_s: Annotated[float, Gt(0.0)] = 1.0  # after which it counts as started in any case
    stop_s: Annotated[float, Ge(0.0)] = 0.4  # told to stand for less, it may still roll
    excess_mps: Annotated[float, Gt(0.0)] = 0.25  # measured faster than wanted by this, it does not stand
    gain: Annotated[float, Ge(0.0), Le(2.0)] = 0.2  # [1 / (m/s)]
    integral_gain: Annotated[float, Ge(0.0), Le(5.0)] = 0.15  # [1 / m]
    integral_most: Share = 0.12  # throttle
    mass: Annotated[float, Ge(0.0), Le(1.0)] = 0.05  # [1 / (m/s^2)] over full thrust
    damping: Annotated[float, Ge(0.0), Le(1.0)] = 0.04  # [1 / (m/s^2)]
    damping_smoothing_s: Annotated[float, Gt(0.0), Le(1.0)] = 0.06  # of the measured acceleration
    throttle_most: Share = 0.8
    wheel_base: Annotated[float, Gt(0.0), Le(10.0)] = 0.36  # [m] RA_WHEEL_BASE
    steering_angle: Annotated[float, Gt(0.0), Le(1.2)] = 0.4887  # [rad] of the front wheels at most: RA_MAX_STR_ANG
    full_speed: Annotated[float, Gt(0.0), Le(50.0)] = 3.0  # [m/s] RO_MAX_THR_SPEED
    yaw_rate_full: Annotated[float, Gt(0.0), Le(20.0)] = 2.0944  # [rad/s] of the full stick: RO_YAW_RATE_LIM
    yaw_rate_gain: Annotated[float, Ge(0.0), Le(10.0)] = 0.25  # RO_YAW_RATE_P
    # whether the same wheels turn it to the same side backwards as forwards, as no car does but that of PX4's SIH
    turns_mirrored_backwards: bool = False


class DriveState(NamedTuple):
    """What the loop remembers."""

    integral: float = 0.0  # throttle
    standing: float | None = None  # [m/s] estimated speed while it stood; None: it rolls
    waited: float = 0.0  # [s] for it to start
    measured: float | None = None  # [m/s] in the last step; None: the loop has just begun
    gained: float = 0.0  # [m/s^2] measured acceleration, smoothed
    gear: float = 0.0  # 1 forward, -1 backwards, 0 standing: as was wanted last
    stood: float = math.inf  # [s] that it has been told to stand


STOOD = DriveState(standing=0.0)


class Sticks(NamedTuple):
    """Stick positions, -1 to 1."""

    throttle: float
    steering: float


def drive(
    state: DriveState,
    *,
    speed: float,
    acceleration: float,
    curvature: float,
    measured: float,
    dt: float,
    parameters: DriveParameters,
) -> tuple[DriveState, Sticks]:
    """Take one step of the loop.

    Args:
        state: after the step before.
        speed: wanted [m/s], below zero backwards; 0: stand, with the throttle shut.
        acceleration: wanted [m/s^2], the rate of `speed`.
        curvature: wanted [1/m], clockwise per distance forward.
        measured: speed along the heading [m/s] now.
        dt: since the step before [s].
        parameters: of the drive train and the loop.
    """
    p = parameters
    if speed == 0.0:
        stood = state.stood + dt if state.gear == 0.0 else 0.0
        return DriveState(standing=measured, measured=measured, stood=stood), Sticks(0.0, 0.0)
    sign = math.copysign(1.0, speed)
    standing, waited, integral = state.standing, state.waited + dt, state.integral
    if state.gear == -sign:  # friction will hold it as at any other start, and what drove it on would be in the way
        standing, waited, integral = sign * max(sign * measured, 0.0), 0.0, 0.0
    started = waited > p.start_s or sign * (measured - speed) > p.excess_mps
    if standing is not None and (started or sign * (measured - standing) > p.started_mps):
        standing = None
    if state.gear == 0.0 and state.stood < p.stop_s and sign * measured > p.started_mps:
        standing = None  # a push would be one on top of what it still rolls with
    error = speed - measured
    forward = sign * (p.rolling + p.drag * speed * speed) + p.mass * acceleration
    gained = state.gained
    if state.measured is not None and dt > 0.0:
        gained += dt / (p.damping_smoothing_s + dt) * ((measured - state.measured) / dt - gained)
    if standing is None:
        integral = max(-p.integral_most, min(p.integral_most, integral + p.integral_gain * error * dt))
    throttle = forward + p.gain * error + p.damping * (acceleration - gained) + integral
    if standing is not None and sign * throttle < p.breakaway:
        throttle = sign * p.breakaway
    throttle = max(-p.throttle_most, min(p.throttle_most, throttle))
    steering = _steering(throttle, curvature, measured, p)
    waited = waited if standing is not None else 0.0
    return DriveState(integral, standing, waited, measured, gained, sign, 0.0), Sticks(throttle, steering)


def _steering(throttle: float, curvature: float, measured: float, p: DriveParameters) -> float:
    guessed = abs(throttle) * p.full_speed
    if guessed < 1e-3:
        return 0.0
    sharpest = math.tan(p.steering_angle) / p.wheel_base
    curvature = max(-sharpest, min(sharpest, curvature))
    rate, across = curvature * guessed, p.wheel_base * curvature
    if throttle > 0.0 and p.yaw_rate_gain > 0.0:
        slope = p.wheel_base / (guessed * (1.0 + across * across)) + p.yaw_rate_gain
        rate -= p.yaw_rate_gain * curvature * (guessed - measured) / slope
    # the stick's sign is that of the arc also backwards: PX4 turns it with the throttle's
    if p.turns_mirrored_backwards and throttle < 0.0:
        rate = -rate
    return max(-1.0, min(1.0, rate / p.yaw_rate_full))
