"""Minimum snap through waypoints, for search patterns and climbs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.geometry.angles import unwrap_near
from companion.geometry.arrays import Array, frozen
from companion.messages.motion import MotionLimits, MotionState
from companion.planning.minimum_snap import PlanParameters, PlanResult
from companion.planning.peaks import GRID, LimitUse, Peaks, limit_values, position_peaks, worst_use, yaw_peaks
from companion.planning.polynomial import PolynomialTrajectory
from companion.planning.spline import ACCELERATION, SNAP, optimal_derivatives, piece_coefficients


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waypoint:
    """A place to pass through."""

    position_ned: Array  # (3,) [m]
    yaw: float  # [rad]

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_ned", frozen(self.position_ned, (3,)))


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    durations: tuple[float, ...]  # [s]
    position: Array  # (K, 8, 3) coefficients
    yaw: Array  # (K, 4) coefficients
    worst: LimitUse


def plan_through(
    start: MotionState,
    waypoints: Sequence[Waypoint],
    *,
    t_start: float,
    limits: MotionLimits,
    t_expiry: float,
    reset_counter: int,
    parameters: PlanParameters,
) -> PlanResult:
    """Plan through all waypoints, to rest at the last.

    One piece per leg; the velocities, accelerations and jerks at the waypoints between are those that make the
    whole snap least, in closed form, so that all derivatives up to the sixth are continuous. The legs' durations
    start from their lengths and are stretched together until the limits hold.

    Args:
        start: the present state, ned; its jerk is free.
        waypoints: at least one; two in a row must differ.
        t_start: instant of `start` [s].
        limits: of the vehicle.
        t_expiry: instant [s] after which nobody follows the plan.
        reset_counter: of the odometry in which start and waypoints are given.
        parameters: of the search.

    Raises:
        ValueError: there is no waypoint, or one is not finite.
    """
    if not waypoints:
        raise ValueError("a plan through waypoints needs at least one")
    places = np.array([start.position_ned, *(w.position_ned for w in waypoints)])
    yaws = _continuous([start.yaw, *(w.yaw for w in waypoints)])
    if not math.isfinite(float(places.sum()) + sum(yaws)):
        raise ValueError("waypoints must be finite")
    shape = _leg_durations(places, yaws, limits, parameters)
    wanted = limit_values(limits)
    candidate = mildest = _candidate(start, places, yaws, shape, wanted)
    factor, steps = 1.0, 0
    while candidate.worst.ratio > parameters.accept and steps < 2 * parameters.tries:
        factor *= min(max(candidate.worst.ratio / parameters.aim, parameters.growth_min), parameters.growth_max)
        candidate = _candidate(start, places, yaws, tuple(factor * leg for leg in shape), wanted)
        steps += 1
        if candidate.worst.ratio < mildest.worst.ratio:
            mildest = candidate
    trajectory = PolynomialTrajectory(
        t_start=t_start,
        durations=mildest.durations,
        position=mildest.position,
        yaw=mildest.yaw,
        t_expiry=t_expiry,
        reset_counter=reset_counter,
    )
    return PlanResult(
        trajectory=trajectory,
        t_goal=trajectory.t_end,
        scale_steps=steps,
        limits_hold=mildest.worst.ratio <= 1.0,
        worst=mildest.worst,
    )


def _candidate(
    start: MotionState, places: Array, yaws: list[float], durations: tuple[float, ...], limits: Peaks
) -> _Candidate:
    position, yaw = _solve(start, places, yaws, durations)
    return _Candidate(durations, position, yaw, worst_use(_peaks(position, yaw, durations), limits))


def _continuous(yaws: list[float]) -> list[float]:
    """Turn the short way from each heading to the next."""
    result = yaws[:1]
    for yaw in yaws[1:]:
        result.append(unwrap_near(yaw, result[-1]))
    return result


def _leg_durations(
    places: Array, yaws: list[float], limits: MotionLimits, parameters: PlanParameters
) -> tuple[float, ...]:
    """Give each leg's duration [s] when flown at the speed limits with one start and stop's worth of acceleration."""
    durations = []
    for k in range(len(places) - 1):
        north, east, down = (places[k + 1] - places[k]).tolist()
        horizontal = math.hypot(north, east)
        speed_vertical = limits.speed_down if down > 0.0 else limits.speed_up
        durations.append(
            max(
                horizontal / limits.speed_horizontal,
                abs(down) / speed_vertical,
                math.sqrt(2.0 * horizontal / limits.acceleration_horizontal),
                math.sqrt(2.0 * abs(down) / limits.acceleration_vertical),
                abs(yaws[k + 1] - yaws[k]) / limits.yaw_rate,
                parameters.duration_min,
            )
        )
    return tuple(durations)


def _solve(start: MotionState, places: Array, yaws: list[float], durations: tuple[float, ...]) -> tuple[Array, Array]:
    """Give the coefficients (K, 8, 3) and (K, 4) for these durations."""
    knots = len(places)
    derivatives = np.zeros((knots, SNAP, 3))
    derivatives[:, 0] = places
    derivatives[0, 1], derivatives[0, 2] = start.velocity_ned, start.acceleration_ned
    fixed = np.zeros((knots, SNAP), dtype=bool)
    fixed[:, 0], fixed[0, :3], fixed[-1] = True, True, True
    position = piece_coefficients(SNAP, durations, optimal_derivatives(SNAP, durations, derivatives, fixed))
    turns = np.zeros((knots, ACCELERATION, 1))
    turns[:, 0, 0], turns[0, 1, 0] = yaws, start.yaw_rate
    fixed = np.zeros((knots, ACCELERATION), dtype=bool)
    fixed[:, 0], fixed[0], fixed[-1] = True, True, True
    yaw = piece_coefficients(ACCELERATION, durations, optimal_derivatives(ACCELERATION, durations, turns, fixed))
    return position, yaw[:, :, 0]


def _peaks(position: Array, yaw: Array, durations: tuple[float, ...]) -> Peaks:
    """Give the largest of all pieces' peaks."""
    every = []
    for k, duration in enumerate(durations):
        peaks = position_peaks(GRID @ position[k], duration, None)
        c0, c1, c2, c3 = yaw[k].tolist()
        every.append((*peaks[:6], *yaw_peaks((c0, c1, c2, c3), duration), peaks[8]))
    return tuple(map(max, *every)) if len(every) > 1 else every[0]
