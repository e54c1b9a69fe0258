"""Brake first, where the direct way would stray.

A minimum-snap motion from a state that moves away from its goal swings out by about its velocity times its duration,
which something else may have stretched (a slow descent, a turn); the next plan, from that state, further still. The
remedy is to come to rest beside the goal first, moving as it moves, and to set off from there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.geometry.arrays import Array
from companion.messages.motion import MotionLimits, MotionState, Trajectory
from companion.planning.minimum_snap import Goal, PlanRequest, PlanResult, plan_to_moving_goal

_STRAY_M = 0.4  # [m] by which the distance to the goal may grow, over what braking needs
_BRAKING_SHARE = 0.6  # of the acceleration limit: the mean of a smooth braking
_SHORTEST_S = 0.6  # [s]
_STANDS_MPS = 0.15  # [m/s] slower: there is nothing to brake, and a goal that flees must be followed
_LOOKS = np.linspace(0.0, 1.0, 13)[1:]


def plan_without_straying(request: PlanRequest) -> PlanResult:
    """Plan as `plan_to_moving_goal` does; brake first where that plan leads away from the goal.

    To be asked again while the motion lasts: the way to the goal begins once it no longer strays.

    Raises:
        ValueError: a state or an instant is not finite.
    """
    direct, start, goal = plan_to_moving_goal(request), request.start, request.goal
    if float(np.hypot(start.velocity_ned[0], start.velocity_ned[1])) < _STANDS_MPS:
        return direct
    now = goal(request.t_start)
    relative = start.velocity_ned - now.velocity_ned
    speed, duration = float(np.hypot(relative[0], relative[1])), time_to_match(relative, request.limits)
    strayed = _strayed(direct.trajectory, goal)
    if strayed <= _STRAY_M + 0.5 * speed * duration:
        return direct
    beside = _beside(goal, now, start, relative, duration)
    braking = plan_to_moving_goal(replace(request, goal=beside, t_goal_hint=request.t_start + duration))
    return braking if _strayed(braking.trajectory, goal) < strayed else direct


def time_to_match(relative: Array, limits: MotionLimits) -> float:
    """Give the time [s] in which a smooth motion takes up the goal's velocity; `relative`: to it now (3,) [m/s]."""
    speed = float(np.hypot(relative[0], relative[1]))
    return max(_SHORTEST_S, speed / (_BRAKING_SHARE * limits.acceleration_horizontal))


def _strayed(trajectory: Trajectory, goal: Goal) -> float:
    """Give by how much the horizontal distance [m] to the goal grows on the way."""

    def distance(t: float) -> float:
        gap = trajectory.at(t).position_ned - goal(t).position_ned
        return math.hypot(float(gap[0]), float(gap[1]))

    span = trajectory.t_end - trajectory.t_start
    return max(distance(trajectory.t_start + float(s) * span) for s in _LOOKS) - distance(trajectory.t_start)


def _beside(goal: Goal, now: MotionState, start: MotionState, relative: Array, duration: float) -> Goal:
    """Give the motion that keeps the place beside the goal in which the vehicle can come to rest relative to it."""
    offset = start.position_ned - now.position_ned + 0.5 * duration * relative
    down = float(start.position_ned[2] + 0.5 * duration * start.velocity_ned[2])

    def at(t: float) -> MotionState:
        to = goal(t)
        position, velocity, acceleration = to.position_ned + offset, to.velocity_ned.copy(), to.acceleration_ned.copy()
        position[2], velocity[2], acceleration[2] = down, 0.0, 0.0
        return replace(
            to,
            position_ned=position,
            velocity_ned=velocity,
            acceleration_ned=acceleration,
            yaw=start.yaw + 0.5 * duration * start.yaw_rate,
            yaw_rate=0.0,
        )

    return at
