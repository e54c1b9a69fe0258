"""SET_ATTITUDE_TARGET as PX4's spacecraft module takes it, for programs that steer the simulated free-flyer."""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

_PAYLOAD = struct.Struct("<I4f3ffBBB3f")


class AttitudeTarget(mavlink.MAVLink_set_attitude_target_message):
    """The message with `thrust_body`, an extension that pymavlink 2.4.50 has in no dialect; PX4 has it.

    Args:
        mask: what is to be ignored, and 32 for the body thrust.
        yaw: of the level attitude [rad].
        thrust_body: forward, right, down, each -1 to 1.
        rates: roll, pitch, yaw [rad/s].
        time_boot_ms: of the sender.
    """

    def __init__(
        self,
        mask: int,
        yaw: float,
        thrust_body: tuple[float, float, float],
        rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
        time_boot_ms: int = 0,
    ) -> None:
        attitude = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
        super().__init__(time_boot_ms, 1, 1, mask, attitude, *rates, 0.0)
        self.thrust_body = thrust_body

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Pack the message with its extension."""
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
