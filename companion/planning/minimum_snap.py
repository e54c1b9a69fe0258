"""Minimum snap to a moving goal.

Position minimises the integral of the squared snap, yaw that of the squared acceleration, each axis by itself
(Mellinger & Kumar, ICRA 2011; Patel et al., "De-coupled Position and Orientation"), from the present state to the
state in which the goal will be when the motion ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from companion.geometry.angles import unwrap_near
from companion.geometry.arrays import Array
from companion.messages.motion import MotionLimits, MotionState
from companion.planning.peaks import (
    GRID,
    TIME_POWERS,
    LimitUse,
    Peaks,
    limit_values,
    position_peaks,
    worst_use,
    yaw_peaks,
)
from companion.planning.polynomial import PolynomialTrajectory
from companion.planning.spline import SNAP, coefficients_from_ends

Goal = Callable[[float], MotionState]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanParameters:
    """The search for a duration at which the limits hold."""

    duration_min: Annotated[float, Gt(0.0)] = 0.4  # [s] shortest plan
    duration_max: Annotated[float, Gt(0.0)] = 120.0  # [s] longest plan tried
    accept: Annotated[float, Gt(0.0), Le(1.0)] = 0.995  # of each limit: the hinted duration is kept when it uses less
    aim: Annotated[float, Gt(0.0), Le(1.0)] = 0.98  # of each limit: what a stretched duration must stay below
    growth_min: Annotated[float, Gt(1.0)] = 1.04  # least factor between two tries
    growth_max: Annotated[float, Gt(1.0)] = 2.0  # greatest factor between two tries
    tries: Annotated[int, Ge(1)] = 14  # durations tried upwards from the hint
    precision: Annotated[float, Gt(0.0), Le(0.5)] = 0.03  # relative, of the smallest duration found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanResult:
    """A plan, and how it sits in the limits."""

    trajectory: PolynomialTrajectory
    t_goal: float  # [s] when the goal is met: the trajectory's end
    scale_steps: int  # durations tried after the first
    limits_hold: bool  # False: no duration kept them, this is the mildest one tried
    worst: LimitUse


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    duration: float
    boundary: Array  # (8, 3) derivatives at both ends, over s
    yaw: tuple[float, float, float, float]
    peaks: Peaks
    relaxed: Peaks  # limits, widened to what the ends themselves impose


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    start: MotionState
    start_jerk: tuple[float, float, float] | None  # [m/s^3]; None: free
    t_start: float
    goal: Goal
    limits: Peaks

    def candidate(self, duration: float) -> _Candidate:
        """Solve for one duration [s]."""
        end = self.goal(self.t_start + duration)
        boundary = _boundary(self.start, self.start_jerk, end, duration)
        goal_velocity = tuple(end.velocity_ned.tolist()) if math.isfinite(self.limits[8]) else None
        yaw = _yaw_cubic(self.start, end, duration)
        matrix = _GRID_FREE_JERK if self.start_jerk is None else _GRID_GIVEN_JERK
        peaks = position_peaks(matrix @ boundary, duration, goal_velocity)
        peaks = (*peaks[:6], *yaw_peaks(yaw, duration), peaks[8])
        relaxed = tuple(map(max, self.limits, _ends_use(self.start, self.start_jerk, end)))
        return _Candidate(duration, boundary, yaw, peaks, relaxed)


_GRID_GIVEN_JERK = GRID @ coefficients_from_ends(SNAP)
_GRID_FREE_JERK = GRID @ coefficients_from_ends(SNAP, True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanRequest:
    """What is asked of a planner: a motion from a state to a goal that moves."""

    start: MotionState  # the present state, ned
    t_start: float  # [s] its instant
    goal: Goal  # the state to be met, ned, as a function of absolute time [s]; its jerk is taken as zero
    t_goal_hint: float  # [s] earliest wanted instant of the meeting
    limits: MotionLimits  # of the vehicle
    t_expiry: float  # [s] instant after which nobody follows the plan
    reset_counter: int  # of the odometry in which start and goal are given
    parameters: PlanParameters  # of the search for a duration
    start_jerk_ned: Array | None = None  # (3,) [m/s^3]; None leaves it free
    closing_speed: float = math.inf  # [m/s] limit of the speed relative to the goal's velocity at the meeting


def plan_to_moving_goal(request: PlanRequest) -> PlanResult:
    """Plan from a state to where the goal will be, as soon after the hint as the limits allow.

    The duration is the hinted one when the limits hold in it, otherwise the smallest found above it; the goal is
    asked anew for each. Where an end itself breaks a limit (a start that is too fast, a goal that flees), the rest
    of the motion may use as much as that end does, and the result says that the limits do not hold.

    Raises:
        ValueError: a state or an instant is not finite.
    """
    start, t_start, given = request.start, request.t_start, request.start_jerk_ned
    _check_finite(start, t_start, request.t_goal_hint, request.t_expiry)
    jerk = None if given is None else (float(given[0]), float(given[1]), float(given[2]))
    problem = _Problem(start, jerk, t_start, request.goal, limit_values(request.limits, request.closing_speed))
    shortest = max(request.t_goal_hint - t_start, request.parameters.duration_min)
    best, steps = _search(problem, shortest, request.parameters)
    basis = coefficients_from_ends(SNAP, jerk is None)
    trajectory = PolynomialTrajectory(
        t_start=t_start,
        durations=(best.duration,),
        position=(basis @ best.boundary)[None],
        yaw=np.array([best.yaw]),
        t_expiry=request.t_expiry,
        reset_counter=request.reset_counter,
    )
    worst = worst_use(best.peaks, problem.limits)
    return PlanResult(
        trajectory=trajectory,
        t_goal=trajectory.t_end,
        scale_steps=steps,
        limits_hold=worst.ratio <= 1.0,
        worst=worst,
    )


def _search(problem: _Problem, duration: float, parameters: PlanParameters) -> tuple[_Candidate, int]:
    """Find the smallest duration [s] from `duration` up that holds; where none does, the mildest tried."""
    candidate = mildest = problem.candidate(duration)
    if _excess(candidate) <= parameters.accept:
        return candidate, 0
    longest = max(parameters.duration_max, duration)
    too_short, steps = duration, 0
    while steps < parameters.tries and duration < longest:
        duration = min(duration * _growth(candidate, parameters), longest)
        candidate = problem.candidate(duration)
        steps += 1
        if _excess(candidate) <= parameters.aim:
            return _refine(problem, too_short, candidate, steps, parameters)
        too_short = duration
        if _excess(candidate) < _excess(mildest):
            mildest = candidate
    return mildest, steps


def _refine(
    problem: _Problem, too_short: float, holds: _Candidate, steps: int, parameters: PlanParameters
) -> tuple[_Candidate, int]:
    """Halve the gap between a duration [s] that fails and one that holds."""
    while holds.duration - too_short > parameters.precision * holds.duration:
        candidate = problem.candidate(0.5 * (too_short + holds.duration))
        steps += 1
        if _excess(candidate) <= parameters.aim:
            holds = candidate
        else:
            too_short = candidate.duration
    return holds, steps


def _excess(candidate: _Candidate) -> float:
    """Give the largest use of the limits; a limit that an end already uses up counts only by what goes beyond it."""
    return max(peak / limit for peak, limit in zip(candidate.peaks, candidate.relaxed, strict=True))


def _growth(candidate: _Candidate, parameters: PlanParameters) -> float:
    """Give the factor for the next duration: exact for motions from rest to rest."""
    needed = max(
        math.pow(peak / (parameters.aim * limit), 1.0 / power)
        for peak, limit, power in zip(candidate.peaks, candidate.relaxed, TIME_POWERS, strict=True)
    )
    return min(max(needed * 1.002, parameters.growth_min), parameters.growth_max)


def _boundary(
    start: MotionState, start_jerk: tuple[float, float, float] | None, end: MotionState, duration: float
) -> Array:
    """Give (8, 3): position, velocity, acceleration and jerk over s at the start, then at the end."""
    t1, t2 = duration, duration * duration
    boundary = np.zeros((8, 3))
    boundary[0] = start.position_ned
    boundary[1] = start.velocity_ned * t1
    boundary[2] = start.acceleration_ned * t2
    if start_jerk is not None:
        t3 = t1 * t2
        boundary[3] = (start_jerk[0] * t3, start_jerk[1] * t3, start_jerk[2] * t3)
    boundary[4] = end.position_ned
    boundary[5] = end.velocity_ned * t1
    boundary[6] = end.acceleration_ned * t2
    return boundary


def _yaw_cubic(start: MotionState, end: MotionState, duration: float) -> tuple[float, float, float, float]:
    """Give the minimum-acceleration cubic over s; the turn goes the short way."""
    turn = unwrap_near(end.yaw, start.yaw) - start.yaw
    first, last = start.yaw_rate * duration, end.yaw_rate * duration
    return start.yaw, first, 3.0 * turn - 2.0 * first - last, first + last - 2.0 * turn


def _ends_use(start: MotionState, start_jerk: tuple[float, float, float] | None, end: MotionState) -> Peaks:
    """Give what the two ends themselves reach of each limited quantity, with a little room; zero where they do not."""
    vn, ve, vd = start.velocity_ned.tolist()
    an, ae, ad = start.acceleration_ned.tolist()
    gn, ge, gd = end.velocity_ned.tolist()
    bn, be, bd = end.acceleration_ned.tolist()
    spare = 1.03  # room for the polynomial to leave a limit that it starts at
    return (
        spare * max(math.hypot(vn, ve), math.hypot(gn, ge)),
        spare * max(-vd, -gd),
        spare * max(vd, gd),
        spare * max(math.hypot(an, ae), math.hypot(bn, be)),
        spare * max(abs(ad), abs(bd)),
        0.0 if start_jerk is None else spare * max(map(abs, start_jerk)),
        spare * max(abs(start.yaw_rate), abs(end.yaw_rate)),
        0.0,
        spare * math.sqrt((vn - gn) ** 2 + (ve - ge) ** 2 + (vd - gd) ** 2),
    )


def _check_finite(start: MotionState, *instants: float) -> None:
    numbers = (*start.position_ned, *start.velocity_ned, *start.acceleration_ned, start.yaw, start.yaw_rate, *instants)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("the start state and the instants of a plan must be finite")
