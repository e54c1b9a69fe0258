"""Minimum snap in the plane, for vehicles that a floor carries: the same plan with "z dropped" (Patel et al.).

Heights and vertical velocities of start and goal are odometry's wander or a target's board: they must neither stretch
a plan nor move the reference. The plan keeps the height at which it starts.
"""

from __future__ import annotations

from dataclasses import replace

from companion.geometry.arrays import Array
from companion.messages.motion import MotionState
from companion.planning.braking import plan_without_straying
from companion.planning.minimum_snap import PlanRequest, PlanResult


def plan_in_plane(request: PlanRequest) -> PlanResult:
    """Plan as `plan_without_straying` does, level at the height of the start.

    The limits on vertical motion do not count. Errors as of `plan_without_straying`.
    """
    down = float(request.start.position_ned[2])
    return plan_without_straying(
        replace(request, start=level(request.start, down), goal=lambda t: level(request.goal(t), down))
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
