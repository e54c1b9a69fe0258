"""Behind a goal that flees: move as it moves, and come nearer as fast as the limits allow.

To a goal that moves as fast as the vehicle may, a minimum-snap motion exists only in a very long time or not at all.
Height, heading and the way across would then be put right in that time too, and what the vehicle does meanwhile is
arbitrary: it swung by metres and lost its target. So a part of the way along the goal's course is given up for now: the
motion ends behind the goal, moving as it moves, and everything else is put right at once. Asked again while the motion
lasts, the vehicle comes as near as its limits allow.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.motion import MotionLimits, MotionState
from companion.planning.braking import plan_without_straying, time_to_match
from companion.planning.minimum_snap import Goal, PlanRequest, PlanResult

_PATIENCE_S = 2.0  # [s] a motion may take this long,
_PATIENCE_FACTOR = 3.0  # and this many times what the way takes at the limits' speeds
_SPARE = 1.03  # of the speed limit
_GIVEN_UP = (0.5, 0.75, 0.9, 1.0)  # shares of the way along the goal's course; then also what is lost on the way to
_STRETCHES = (1.0, 1.5, 2.5)  # its velocity, which is reached in so many times `time_to_match`
_CLIMB_SHARE = 0.1  # of the vertical acceleration limit: what it is worth in height during a change of velocity


def plan_in_pursuit(request: PlanRequest) -> PlanResult:
    """Plan as `plan_without_straying` does; where that takes too long, to a place behind the goal.

    Raises:
        ValueError: a state or an instant is not finite.
    """
    start, goal, limits = request.start, request.goal, request.limits
    now = goal(request.t_start)
    # a plan may use a little more of a limit than its start does: plan after plan, a chase would become a race
    fastest = _SPARE * max(1.0, math.hypot(now.velocity_ned[0], now.velocity_ned[1]) / limits.speed_horizontal)

    def good(result: PlanResult, offset: Array) -> bool:
        there = replace(now, position_ned=now.position_ned + offset)
        in_time = result.t_goal <= max(request.t_goal_hint, request.t_start + _patience(start, there, limits))
        return in_time and not (result.worst.name == "speed_horizontal" and result.worst.ratio > fastest)

    result = plan_without_straying(request)
    behind = _along_course(start.position_ned - now.position_ned, now)
    if not behind.any() or good(result, np.zeros(3)):
        return result
    for share in _GIVEN_UP:
        result = plan_without_straying(replace(request, goal=_moved(goal, share * behind)))
        if good(result, share * behind):
            return result
    relative = start.velocity_ned - now.velocity_ned
    for stretch in _STRETCHES:
        duration = stretch * time_to_match(relative, limits)
        offset = behind + 0.5 * duration * _along_course(relative, now)
        offset[2] += _height_left(start, now, limits, duration)
        hint = max(request.t_goal_hint, request.t_start + duration)
        result = plan_without_straying(replace(request, goal=_moved(goal, offset), t_goal_hint=hint))
        if good(result, offset):
            break
    return result


def _patience(start: MotionState, now: MotionState, limits: MotionLimits) -> float:
    """Give how long [s] a motion to a goal that is here now may take."""
    north, east, down = (now.position_ned - start.position_ned).tolist()
    longest: float = max(
        math.hypot(north, east) / limits.speed_horizontal,
        down / limits.speed_down,
        -down / limits.speed_up,
        abs(wrap_angle(now.yaw - start.yaw)) / limits.yaw_rate,
    )
    return _PATIENCE_S + _PATIENCE_FACTOR * longest


def _height_left(start: MotionState, now: MotionState, limits: MotionLimits, duration: float) -> float:
    """Give what is left [m, down] of the way to the goal's height after a change of velocity of so long [s]."""
    relative, gap = (start.velocity_ned - now.velocity_ned)[2], (start.position_ned - now.position_ned)[2]
    left = float(gap + 0.5 * duration * relative)
    done = _CLIMB_SHARE * limits.acceleration_vertical * duration * duration
    return math.copysign(max(0.0, abs(left) - done), left)


def _along_course(vector: Array, now: MotionState) -> Array:
    """Give the part (3,) of a vector (3,) that lies along the goal's horizontal course."""
    course = np.array([now.velocity_ned[0], now.velocity_ned[1], 0.0])
    square = float(course @ course)
    if square == 0.0:
        return np.zeros(3)
    result: Array = float(vector @ course) / square * course
    return result


def _moved(goal: Goal, offset: Array) -> Goal:
    """Give the motion that keeps an offset (3,) [m] from the goal."""

    def at(t: float) -> MotionState:
        to = goal(t)
        return replace(to, position_ned=to.position_ned + offset)

    return at
