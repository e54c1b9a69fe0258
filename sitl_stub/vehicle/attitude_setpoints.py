"""SET_ATTITUDE_TARGET as PX4's receiver takes it (mavlink_receiver.cpp, handle_message_set_attitude_target).

The body thrust is an extension of the message that the dialects of PyPI's pymavlink (2.4.50) do not have: it is read
from the frame.
"""

import struct
from dataclasses import dataclass
from typing import Any

from sitl_stub.truth import Quaternion, Vector

ROLL_RATE_IGNORE, PITCH_RATE_IGNORE, YAW_RATE_IGNORE = 1, 2, 4
THRUST_BODY_SET, ATTITUDE_IGNORE = 32, 128
HEADER, THRUST_AT, THRUST_SIZE = 10, 39, 12
"""Places in a MAVLink 2 frame: payload, and in it the body thrust."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeTarget:
    """What one message asks for; None: it does not say."""

    attitude: Quaternion | None
    """ned_from_frd (w, x, y, z)."""
    thrust_body: Vector | None
    """Normalised thrust, -1 to 1, frd."""
    yaw_rate: float | None
    """Turn rate [rad/s] where no attitude is set: with one, attitude control sets the rates anew at once."""


def decode(message: Any) -> AttitudeTarget | None:
    """Return what the message asks for; None when it sets neither attitude nor turn rates and counts for nothing."""
    mask = message.type_mask
    attitude = not mask & ATTITUDE_IGNORE
    rates = not mask & ROLL_RATE_IGNORE and not mask & PITCH_RATE_IGNORE
    if not attitude and not rates:
        return None
    q0, q1, q2, q3 = message.q
    return AttitudeTarget(
        attitude=(q0, q1, q2, q3) if attitude else None,
        thrust_body=_thrust_body(bytes(message.get_msgbuf())) if mask & THRUST_BODY_SET else None,
        yaw_rate=None if attitude or mask & YAW_RATE_IGNORE else message.body_yaw_rate,
    )


def _thrust_body(frame: bytes) -> Vector:
    """Read the extension; MAVLink 2 cuts zeros off the end of a payload, and MAVLink 1 has no extensions."""
    payload = frame[HEADER : HEADER + frame[1]] if frame[0] == 0xFD else b""
    t0, t1, t2 = struct.unpack("<3f", payload[THRUST_AT : THRUST_AT + THRUST_SIZE].ljust(THRUST_SIZE, b"\0"))
    return t0, t1, t2
