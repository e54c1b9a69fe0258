"""The shortest stop that acceleration and jerk limits allow."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from companion.geometry.arrays import Array
from companion.messages.motion import MotionLimits, MotionState
from companion.planning.polynomial import PolynomialTrajectory

# Shares of the horizontal limits for braking along the motion and across it: 0.95^2 + 0.31^2 < 1.
_ALONG, _ACROSS = 0.95, 0.31
_HOLD = 0.02  # [s] length of the plan of a vehicle that stands still already

Phase = tuple[float, float]  # duration [s], jerk [m/s^3]


def stop_phases(velocity: float, acceleration: float, acceleration_limit: float, jerk_limit: float) -> list[Phase]:
    """Give the phases of constant jerk that bring one axis to rest in the shortest time.

    With v0 = v + a|a| / 2J, the velocity left when the acceleration is simply taken away, the sign of v0 says which
    way to push: the acceleration goes to a peak on the other side, sqrt(J (|v| + a^2 / 2J)) or the limit, stays
    there as long as needed and comes back to zero.

    Args:
        velocity: [m/s].
        acceleration: [m/s^2]; may be beyond the limit, to which it is then brought first.
        acceleration_limit: [m/s^2].
        jerk_limit: [m/s^3].
    """
    left = velocity + acceleration * abs(acceleration) / (2.0 * jerk_limit)
    if left == 0.0:
        return [(abs(acceleration) / jerk_limit, -math.copysign(jerk_limit, acceleration))]
    side = math.copysign(1.0, left)
    v, a = side * velocity, side * acceleration  # now to be pushed towards negative acceleration
    if a < -acceleration_limit:
        phases = [((-acceleration_limit - a) / jerk_limit, jerk_limit), (abs(left) / acceleration_limit, 0.0)]
        phases.append((acceleration_limit / jerk_limit, jerk_limit))
    else:
        whole = max(v + a * a / (2.0 * jerk_limit), 0.0)
        peak = min(math.sqrt(jerk_limit * whole), acceleration_limit)
        flat = max(whole / peak - peak / jerk_limit, 0.0) if peak > 0.0 else 0.0
        phases = [(max(a + peak, 0.0) / jerk_limit, -jerk_limit), (flat, 0.0), (peak / jerk_limit, jerk_limit)]
    return [(duration, side * jerk) for duration, jerk in phases]


def brake(
    start: MotionState, *, t_start: float, limits: MotionLimits, t_expiry: float, reset_counter: int
) -> PolynomialTrajectory:
    """Stop as soon as the limits allow, and stay there.

    Along the horizontal motion, across it, vertically and in yaw, each by itself and in the shortest time; the
    shares of along and across keep the horizontal acceleration and every axis' jerk inside the limits. A start
    beyond a limit is brought inside first.

    Args:
        start: the present state, ned.
        t_start: its instant [s].
        limits: of the vehicle.
        t_expiry: instant [s] after which nobody follows the plan.
        reset_counter: of the odometry in which `start` is given.
    """
    vn, ve, vd = start.velocity_ned.tolist()
    an, ae, ad = start.acceleration_ned.tolist()
    north, east = (vn, ve) if math.hypot(vn, ve) > 1e-6 else (an, ae)
    length = math.hypot(north, east)
    c, s = (north / length, east / length) if length > 0.0 else (1.0, 0.0)
    ned_from_path = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    jerk = limits.jerk / math.sqrt(2.0)
    acceleration = limits.acceleration_horizontal
    axes = [
        stop_phases(c * vn + s * ve, c * an + s * ae, _ALONG * acceleration, jerk),
        stop_phases(c * ve - s * vn, c * ae - s * an, _ACROSS * acceleration, jerk),
        stop_phases(vd, ad, limits.acceleration_vertical, limits.jerk),
    ]
    yaw_stop = abs(start.yaw_rate) / limits.yaw_acceleration
    knots = _knots([*axes, [(yaw_stop, 0.0)]])
    durations = tuple(b - a for a, b in pairwise(knots))
    position = _position_pieces(start, ned_from_path, axes, knots)
    yaw_acceleration = -math.copysign(limits.yaw_acceleration, start.yaw_rate)
    yaw = _yaw_pieces(start, yaw_acceleration, yaw_stop, knots)
    return PolynomialTrajectory(
        t_start=t_start, durations=durations, position=position, yaw=yaw, t_expiry=t_expiry, reset_counter=reset_counter
    )


def _knots(axes: list[list[Phase]]) -> list[float]:
    """Give the instants [s] at which any axis changes its phase, from zero, closer ones merged."""
    instants = {0.0}
    for phases in axes:
        elapsed = 0.0
        for duration, _ in phases:
            elapsed += duration
            instants.add(elapsed)
    knots = [0.0]
    for instant in sorted(instants):
        if instant - knots[-1] > 1e-9:
            knots.append(instant)
    return knots if len(knots) > 1 else [0.0, _HOLD]


def _jerk_at(phases: list[Phase], instant: float) -> float:
    for duration, jerk in phases:
        if instant < duration:
            return jerk
        instant -= duration
    return 0.0


def _position_pieces(start: MotionState, ned_from_path: Array, axes: list[list[Phase]], knots: list[float]) -> Array:
    """Integrate the phases to coefficients (K, 8, 3) over s, ned."""
    p, v, a = start.position_ned, start.velocity_ned, start.acceleration_ned
    pieces = np.zeros((len(knots) - 1, 8, 3))
    for k, (begin, end) in enumerate(pairwise(knots)):
        h = end - begin
        j = ned_from_path @ np.array([_jerk_at(phases, 0.5 * (begin + end)) for phases in axes])
        pieces[k, :4] = (p, v * h, a * (h * h / 2.0), j * (h**3 / 6.0))
        p, v, a = p + v * h + a * (h * h / 2.0) + j * (h**3 / 6.0), v + a * h + j * (h * h / 2.0), a + j * h
    return pieces


def _yaw_pieces(start: MotionState, acceleration: float, stop: float, knots: list[float]) -> Array:
    """Integrate the yaw's constant deceleration to coefficients (K, 4) over s."""
    yaw, rate = start.yaw, start.yaw_rate
    pieces = np.zeros((len(knots) - 1, 4))
    for k, (begin, end) in enumerate(pairwise(knots)):
        h = end - begin
        turning = acceleration if 0.5 * (begin + end) < stop else 0.0
        pieces[k, :3] = (yaw, rate * h, turning * h * h / 2.0)
        yaw, rate = yaw + rate * h + turning * h * h / 2.0, rate + turning * h
    return pieces
