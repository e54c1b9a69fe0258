"""Where each mode wants the vehicle to be, as a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array
from companion.messages.motion import MotionState
from companion.messages.target import Prediction, TargetPose

MotionAt = Callable[[float], MotionState]
_ZERO = np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Goal:
    """What the planner is to fly to."""

    at: MotionAt  # the wanted motion at an instant [s], in the autopilot's local frame
    t_reach: float  # [s] earliest instant at which it is to be reached
    relative: bool  # it moves with the target: feedback on the relative pose applies
    direct: bool  # fly it as it is, without a plan in between: the vehicle is already there
    gentle: bool = False  # plan it with the limits of the approach
    calm: bool = False  # follow it softly: nothing is about to be touched
    backs_out: bool = False  # it is farther back than the place beside the target, to see that again
    may_stand_at: TargetPose | None = None  # the target when it was in sight last, where it may stand since


def stand_still(position_ned: Array, yaw: float) -> MotionAt:
    """Stay at a point. `position_ned`: (3,) [m]; `yaw` [rad]."""
    state = MotionState(position_ned=position_ned, velocity_ned=_ZERO, acceleration_ned=_ZERO, yaw=yaw, yaw_rate=0.0)
    return lambda _t: state


def in_view_of(target_ned: Array, position_ned: Array, aside_most: float) -> Array:
    """Give the place nearest to a position, at its height, from which a target is no farther aside than wanted.

    Args:
        target_ned: (3,) [m].
        position_ned: (3,) [m].
        aside_most: horizontally [m].

    Returns:
        The place (3,) [m].
    """
    north, east = float(target_ned[0] - position_ned[0]), float(target_ned[1] - position_ned[1])
    aside = math.hypot(north, east)
    share = 1.0 - aside_most / aside if aside > aside_most else 0.0
    result: Array = position_ned + np.array([share * north, share * east, 0.0])
    return result


def climbing(
    origin_ned: Array, *, t: float, height: float, climb_rate: float, height_end: float, yaw: float
) -> MotionAt:
    """Climb straight up at a constant rate, to an end.

    Args:
        origin_ned: the take-off point (3,) [m].
        t: now [s].
        height: above it now [m].
        climb_rate: [m/s], not negative.
        height_end: where the climb ends [m].
        yaw: heading to keep [rad].
    """

    def at(when: float) -> MotionState:
        reached = height + climb_rate * (when - t)
        rate = climb_rate if reached < height_end else 0.0
        return MotionState(
            position_ned=origin_ned - (0.0, 0.0, min(reached, height_end)),
            velocity_ned=np.array([0.0, 0.0, -rate]),
            acceleration_ned=_ZERO,
            yaw=yaw,
            yaw_rate=0.0,
        )

    return at


def above_target(
    prediction: Prediction,
    *,
    t: float,
    body_height: float,
    climb_rate: float,
    yaw: float | None,
    height_end: float | None = None,
    aside: tuple[float, float] = (0.0, 0.0),
) -> MotionAt:
    """Stay above the predicted landing point and move with it.

    Args:
        prediction: the target's motion.
        t: now [s].
        body_height: height of the body origin above the pad now [m].
        climb_rate: rate of that height [m/s], negative down.
        yaw: heading to keep [rad]; None takes the pad's.
        height_end: where the climb ends [m]; None goes on.
        aside: north and east [m], kept the other way from the point above the pad.
    """

    def at(when: float) -> MotionState:
        target = prediction.at(when)
        height = body_height + climb_rate * (when - t)
        rate = climb_rate
        if height_end is not None and (height - height_end) * climb_rate >= 0.0:
            height, rate = height_end, 0.0
        position = target.position_ned.copy()
        velocity = target.velocity_ned.copy()
        position -= (aside[0], aside[1], height)
        velocity[2] -= rate
        return MotionState(
            position_ned=position,
            velocity_ned=velocity,
            acceleration_ned=target.acceleration_ned,
            yaw=target.yaw if yaw is None else yaw,
            yaw_rate=target.yaw_rate if yaw is None else 0.0,
        )

    return at


def behind_target(prediction: Prediction, standoff: float) -> MotionAt:
    """Stay behind the predicted target at its heading.

    Args:
        prediction: the target's motion.
        standoff: distance behind its reference point [m].
    """

    def at(when: float) -> MotionState:
        target = prediction.at(when)
        cosine, sine = math.cos(target.yaw), math.sin(target.yaw)
        back = np.array([-standoff * cosine, -standoff * sine, 0.0])
        swing = np.array([-target.yaw_rate * back[1], target.yaw_rate * back[0], 0.0])
        return MotionState(
            position_ned=target.position_ned + back,
            velocity_ned=target.velocity_ned + swing,
            acceleration_ned=target.acceleration_ned,
            yaw=target.yaw,
            yaw_rate=target.yaw_rate,
        )

    return at


def along_spiral(
    offset_at: Callable[[float], tuple[Array, Array]],
    *,
    t: float,
    centre_ned: Array,
    drift_ned: Array,
    down: float,
    yaw: float,
) -> MotionAt:
    """Fly a pattern around a centre that drifts.

    Args:
        offset_at: horizontal offset and rate (2,), (2,) of the pattern at an instant.
        t: now [s].
        centre_ned: the centre now (3,) [m]; its height is not used.
        drift_ned: its velocity (3,) [m/s].
        down: height to fly at, NED z [m].
        yaw: heading to keep [rad].
    """

    def at(when: float) -> MotionState:
        offset, rate = offset_at(when)
        centre = centre_ned + drift_ned * (when - t)
        return MotionState(
            position_ned=np.array([centre[0] + offset[0], centre[1] + offset[1], down]),
            velocity_ned=np.array([drift_ned[0] + rate[0], drift_ned[1] + rate[1], 0.0]),
            acceleration_ned=_ZERO,
            yaw=yaw,
            yaw_rate=0.0,
        )

    return at


def sinking(
    position_ned: Array,
    velocity_ned: Array,
    *,
    t: float,
    t_contact: float,
    sink_rate: float,
    press: float,
    yaw: float,
) -> MotionAt:
    """Press down where the vehicle stands, moving with the pad.

    A finite commanded descent is what PX4's land detector asks for (px4_rulebook.md, rule 8). The acceleration on top
    takes the thrust away at once, so that wind and the autopilot's wandering estimate cannot push the vehicle about.

    Args:
        position_ned: of the vehicle (3,) [m]: north and east now, down at contact.
        velocity_ned: of the pad (3,) [m/s]; its north and east are used.
        t: now [s].
        t_contact: instant [s] of the contact.
        sink_rate: commanded, positive down [m/s].
        press: acceleration downwards on top [m/s^2].
        yaw: heading to keep [rad].
    """
    down = np.array([0.0, 0.0, press])

    def at(when: float) -> MotionState:
        velocity = np.array([float(velocity_ned[0]), float(velocity_ned[1]), sink_rate])
        position = position_ned + velocity * (when - t)
        position[2] = position_ned[2] + sink_rate * (when - t_contact)
        return MotionState(
            position_ned=position,
            velocity_ned=velocity,
            acceleration_ned=_ZERO,
            yaw=yaw,
            yaw_rate=0.0,
            feedback_acceleration_ned=down,
        )

    return at


def allowed_lateral_error(height: float, *, half_angle: float, floor: float) -> float:
    """Give the radius [m] of the descent cone at a height [m] of the feet above the pad."""
    return floor + max(height, 0.0) * math.tan(half_angle)
