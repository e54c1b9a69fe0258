"""Goals that move with the target."""

from __future__ import annotations

import math

from companion.geometry.arrays import Array
from companion.messages.motion import MotionState
from companion.messages.target import Prediction
from companion.planning.minimum_snap import Goal


def goal_at_target(
    prediction: Prediction,
    *,
    offset_pad: Array,
    offset_velocity_down: float = 0.0,
    yaw_offset: float = 0.0,
    follow_yaw: bool = True,
    yaw: float = 0.0,
) -> Goal:
    """Give the goal that stays at an offset from the predicted target, and moves and turns with it.

    A point fixed in the turning pad moves at v + w x r and accelerates at a + w x (w x r).

    Args:
        prediction: of the target, ned.
        offset_pad: (3,) [m] from the target, along the pad's heading, right of it, down (negative: above).
        offset_velocity_down: [m/s] at which the vehicle is to sink relative to the pad at the meeting.
        yaw_offset: [rad] added to the pad's heading.
        follow_yaw: take the pad's heading and turn rate; otherwise keep `yaw`.
        yaw: [rad] heading where the pad's is not followed.
    """
    forward, right, down = (float(x) for x in offset_pad)

    def goal(t: float) -> MotionState:
        pose = prediction.at(t)
        c, s, w = math.cos(pose.yaw), math.sin(pose.yaw), pose.yaw_rate
        north, east = c * forward - s * right, s * forward + c * right
        pn, pe, pd = pose.position_ned.tolist()
        vn, ve, vd = pose.velocity_ned.tolist()
        an, ae, ad = pose.acceleration_ned.tolist()
        return MotionState(
            position_ned=(pn + north, pe + east, pd + down),  # type: ignore[arg-type]  # copied to an array
            velocity_ned=(vn - w * east, ve + w * north, vd + offset_velocity_down),  # type: ignore[arg-type]
            acceleration_ned=(an - w * w * north, ae - w * w * east, ad),  # type: ignore[arg-type]
            yaw=pose.yaw + yaw_offset if follow_yaw else yaw,
            yaw_rate=w if follow_yaw else 0.0,
        )

    return goal
