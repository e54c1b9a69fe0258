"""SET_ATTITUDE_TARGET with a body thrust.

`thrust_body` is an extension of the message that PyPI's pymavlink (2.4.50) has in no dialect; PX4 has it. It is
appended here: three floats behind the payload, which leaves the checksum's extra byte as it is.
"""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from companion.messages.thrust import AttitudeThrust

_PAYLOAD = struct.Struct("<I4f3ffBBB3f")
# Turn rates are left to the autopilot: without these bits PX4 takes them for setpoints of their own.
_TYPE_MASK = 1 | 2 | 4 | 32  # roll, pitch and yaw rate ignored; body thrust set


class AttitudeTarget(mavlink.MAVLink_set_attitude_target_message):  # type: ignore[misc]
    """The message; `pack` as of any other.

    Raises:
        ValueError: a number is not finite, or the thrust beyond -1..1.
    """

    def __init__(self, setpoint: AttitudeThrust, system: int, component: int, time_boot_ms: int) -> None:
        half = 0.5 * setpoint.yaw
        thrust = tuple(setpoint.thrust_body.tolist())
        if not math.isfinite(half) or not all(-1.0 <= part <= 1.0 for part in thrust):
            raise ValueError(f"a heading must be finite and a thrust within -1..1, got {setpoint.yaw}, {thrust}")
        attitude = (math.cos(half), 0.0, 0.0, math.sin(half))
        super().__init__(time_boot_ms & 0xFFFFFFFF, system, component, _TYPE_MASK, attitude, 0.0, 0.0, 0.0, 0.0)
        self.thrust_body = thrust

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Give the frame; MAVLink 1 has no extensions."""
        payload = _PAYLOAD.pack(
            self.time_boot_ms,
            *self.q,
            self.body_roll_rate,
            self.body_pitch_rate,
            self.body_yaw_rate,
            self.thrust,
            self.target_system,
            self.target_component,
            self.type_mask,
            *self.thrust_body,
        )
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))
