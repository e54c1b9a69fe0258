"""SET_POSITION_TARGET_LOCAL_NED as PX4's receiver takes it: frames, masks, and what gets dropped."""

import math
from typing import Any

from sitl_stub.truth import Vector
from sitl_stub.vehicle.notices import CRITICAL, Notice
from sitl_stub.vehicle.position_control import NAN, NOTHING, TrajectorySetpoint

LOCAL_NED, BODY_NED = 1, 8
FORCE_SET, YAW_IGNORE, YAW_RATE_IGNORE = 512, 1024, 2048
POSITION_BITS, VELOCITY_BITS, ACCELERATION_BITS = 0, 3, 6


def _unsupported_frame(frame: int) -> Notice:
    return Notice(severity=CRITICAL, text=f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {frame} unsupported\t")


INVALID = Notice(severity=CRITICAL, text="SET_POSITION_TARGET_LOCAL_NED invalid\t")
FORCE_UNSUPPORTED = Notice(severity=CRITICAL, text="SET_POSITION_TARGET_LOCAL_NED force not supported\t")


def decode(message: Any, yaw: float) -> TrajectorySetpoint | Notice:
    """Return the setpoint, or the notice with which PX4 drops the message (it then does not count as signal).

    `yaw` [rad] turns BODY_NED velocities and accelerations; BODY_NED positions are ignored, and one ignored axis drops
    a whole BODY_NED vector. NaN and infinities pass as they are.
    """
    mask = message.type_mask
    position = velocity = acceleration = NOTHING
    if message.coordinate_frame == LOCAL_NED:
        position = _masked(mask >> POSITION_BITS, (message.x, message.y, message.z))
        velocity = _masked(mask >> VELOCITY_BITS, (message.vx, message.vy, message.vz))
        acceleration = _masked(mask >> ACCELERATION_BITS, (message.afx, message.afy, message.afz))
    elif message.coordinate_frame == BODY_NED:
        if not mask >> VELOCITY_BITS & 7:
            velocity = _turned((message.vx, message.vy, message.vz), yaw)
        if not mask >> ACCELERATION_BITS & 7:
            acceleration = _turned((message.afx, message.afy, message.afz), yaw)
    else:
        return _unsupported_frame(message.coordinate_frame)
    if not _all_nan(acceleration) and mask & FORCE_SET:
        return FORCE_UNSUPPORTED
    if _all_nan(position) and _all_nan(velocity) and _all_nan(acceleration):
        return INVALID
    return TrajectorySetpoint(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        yaw=NAN if mask & YAW_IGNORE else message.yaw,
        yaw_rate=NAN if mask & YAW_RATE_IGNORE else message.yaw_rate,
    )


def _masked(mask: int, vector: Vector) -> Vector:
    return (
        NAN if mask & 1 else vector[0],
        NAN if mask & 2 else vector[1],
        NAN if mask & 4 else vector[2],
    )


def _turned(vector: Vector, yaw: float) -> Vector:
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1], vector[2])


def _all_nan(vector: Vector) -> bool:
    return vector[0] != vector[0] and vector[1] != vector[1] and vector[2] != vector[2]
