"""Minimum snap in the plane, for vehicles that a floor carries: the same plan with "z dropped" (Patel et al.).

Heights and vertical velocities of start and goal are odometry's wander or a target's board: they must neither stretch
a plan nor move the reference. The plan keeps the height at which it starts.
"""

from __future__ import annotations

import math
from dataclasses import replace

from companion.geometry.arrays import Array
from companion.messages.motion import MotionLimits, MotionState
from companion.planning.braking import plan_without_straying
from companion.planning.minimum_snap import Goal, PlanParameters, PlanResult


def plan_in_plane(
    start: MotionState,
    *,
    t_start: float,
    goal: Goal,
    t_goal_hint: float,
    limits: MotionLimits,
    t_expiry: float,
    reset_counter: int,
    parameters: PlanParameters,
    closing_speed: float = math.inf,
) -> PlanResult:
    """Plan to a moving goal as `plan_without_straying` does, level at the height of `start`.

    The limits on vertical motion do not count. Arguments and errors as of `plan_without_straying`.
    """
    down = float(start.position_ned[2])
    return plan_without_straying(
        start=level(start, down),
        t_start=t_start,
        goal=lambda t: level(goal(t), down),
        t_goal_hint=t_goal_hint,
        limits=limits,
        t_expiry=t_expiry,
        reset_counter=reset_counter,
        parameters=parameters,
        closing_speed=closing_speed,
    )


def level(state: MotionState, down: float) -> MotionState:
    """Give the state at the height `down` [m], ned, without vertical motion."""
    return replace(
        state,
        position_ned=_with_down(state.position_ned, down),
        velocity_ned=_with_down(state.velocity_ned, 0.0),
        acceleration_ned=_with_down(state.acceleration_ned, 0.0),
    )


def _with_down(vector: Array, down: float) -> Array:
    changed = vector.copy()
    changed[2] = down
    return changed
