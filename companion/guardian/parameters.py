"""What can be tuned in the guardian."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from companion.guardian.fence import Fence


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardianParameters:
    """Times, distances and the fence."""

    prestream: Annotated[float, Ge(1.0)] = 1.0  # [s] of "hold here" before OFFBOARD is asked for
    request_interval: Annotated[float, Gt(0.0)] = 1.2  # [s] between requests: a heartbeat shows a mode up to 1 s late
    request_tries: Annotated[int, Ge(1)] = 3
    ownship_stale: Annotated[float, Gt(0.0), Lt(0.2)] = 0.1  # [s] age from which no position setpoint is built on it
    ownship_lost: Annotated[float, Gt(0.0), Lt(0.5)] = 0.25  # [s] age, or pause between ticks, from which it is silent
    resume_within: Annotated[float, Gt(0.0), Lt(1.0)] = 0.8  # [s] of silence after which only the operator resumes
    silence_to_handover: Annotated[float, Gt(0.0)] = 2.0  # [s] without a trajectory to follow, in the air, until Hold
    trajectory_early: Annotated[float, Ge(0.0)] = 0.2  # [s] before its start from which a trajectory is followed
    stick_travel: Annotated[float, Gt(0.0), Lt(1.0)] = 0.15  # of centre to end: a stick moved further is a pilot's hand
    engage_speed: Annotated[float, Gt(0.0)] = 1.0  # [m/s] of a flying vehicle above which engaging is refused
    handover_age: Annotated[float, Gt(0.0), Lt(1.0)] = 0.5  # [s] after its arrival a trajectory is no longer followed
    leash_horizontal: Annotated[float, Gt(0.0)] = 1.0  # [m] of the position setpoint from the vehicle
    leash_vertical: Annotated[float, Gt(0.0)] = 1.0  # [m]
    position_step: Annotated[float, Ge(0.0)] = 0.005  # [m] by which the reference may step without being smoothed
    position_gain: Annotated[float, Gt(0.0), Lt(4.0)] = 1.5  # [1/s] of the smoothing; the velocity's is four times it
    closing_speed: Annotated[float, Gt(0.0)] = 1.5  # [m/s] towards the target, relative to it
    closing_range: Annotated[float, Gt(0.0)] = 0.2  # [m] nearer than this the direction to the target says nothing
    feedback_velocity_max: Annotated[float, Ge(0.0)] = 0.8  # [m/s] per axis: bias of the autopilot's velocity estimate
    # [m/s] above the speed limits, for taking out errors of position; the autopilot's own velocity is no better known
    speed_reserve: Annotated[float, Ge(0.0), Le(1.0)] = 0.3
    # [1/s] MPC_XY_P, MPC_Z_P: how fast the autopilot takes out an error of position
    autopilot_position_gain: tuple[Annotated[float, Gt(0.0)], Annotated[float, Gt(0.0)]] = (0.95, 1.0)
    autopilot_heading_gain: Annotated[float, Gt(0.0)] = 2.8  # [1/s] MC_YAW_P: how fast it takes out an error
    feedback_yaw_max: Annotated[float, Ge(0.0)] = 0.4  # [rad] with it too the turn stays below the yaw rate's limit
    feedback_yaw_slew: Annotated[float, Ge(0.0)] = 2.0  # [rad/s] of it
    fence: Fence = field(default_factory=Fence)
