"""Everything that the companion may send, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from companion.link.attitude_target import AttitudeTarget
from companion.link.signing import Signing
from companion.messages.motion import Setpoint, SticksSetpoint
from companion.messages.pilot import LandingTarget
from companion.messages.thrust import AttitudeThrust

SET_MODE = 176
ARM_DISARM = 400
RUN_PREARM_CHECKS = 401
SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512

ALLOWED_COMMANDS = frozenset({SET_MODE, ARM_DISARM, RUN_PREARM_CHECKS, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE})
ALLOWED_MESSAGES = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_MANUAL_CONTROL,
        mavlink.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
        mavlink.MAVLINK_MSG_ID_LANDING_TARGET,
    }
)

_IGNORE_POSITION = 1 | 2 | 4
_LOCAL_NED = 1
_CUSTOM_MODE_ENABLED = 1
_VISION_FIDUCIAL = 2


class Encoder:
    """Builds the datagrams of one companion for one autopilot.

    Args:
        system: system id of the vehicle, which is also the companion's.
        component: component id of the autopilot.
        own_component: component id of the companion.
        signing: signs every datagram; None: none is signed.
    """

    def __init__(self, *, system: int, component: int, own_component: int, signing: Signing | None = None) -> None:
        self._system = system
        self._component = component
        self._mavlink: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=own_component)
        self._signing = signing
        if signing is not None:
            self._mavlink.signing.secret_key = signing.secret
            self._mavlink.signing.link_id = signing.link_id
            self._mavlink.signing.sign_outgoing = True

    def heartbeat(self, state: int = mavlink.MAV_STATE_ACTIVE, custom_mode: int = 0) -> bytes:
        """HEARTBEAT of an onboard controller; never of a ground station, which would mask the loss of the real one.

        Args:
            state: MAV_STATE.
            custom_mode: see `pilot_desk.custom_mode`; 0: it says nothing.
        """
        return self._pack(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                mavlink.MAV_AUTOPILOT_INVALID,
                _CUSTOM_MODE_ENABLED if custom_mode else 0,
                custom_mode,
                state,
                3,
            )
        )

    def status_text(self, severity: int, text: bytes, number: int, chunk: int) -> bytes:
        """STATUSTEXT: one chunk of at most 50 bytes; `number` 0 for a text of one chunk."""
        return self._pack(mavlink.MAVLink_statustext_message(severity, text, number, chunk))

    def named_value(self, name: str, value: float, time_boot_ms: int) -> bytes:
        """NAMED_VALUE_FLOAT; `name` of at most 10 characters."""
        return self._pack(
            mavlink.MAVLink_named_value_float_message(time_boot_ms & 0xFFFFFFFF, name.encode("ascii"), value)
        )

    def landing_target(self, target: LandingTarget, time_usec: int) -> bytes:
        """LANDING_TARGET in LOCAL_NED with position_valid: PX4 takes it as the absolute place of the pad.

        Raises:
            ValueError: a number is not finite.
        """
        half = 0.5 * target.yaw
        angles = (target.angle_right, target.angle_down, target.distance, target.size_right, target.size_down)
        place = target.position_ned.tolist()
        if not all(map(math.isfinite, (*angles, *place, half))):
            raise ValueError(f"a landing target must be finite, got {(*angles, *place, target.yaw)}")
        return self._pack(
            mavlink.MAVLink_landing_target_message(
                time_usec,
                0,
                _LOCAL_NED,
                *angles,
                *place,
                (math.cos(half), 0.0, 0.0, math.sin(half)),
                _VISION_FIDUCIAL,
                1,
            )
        )

    def timesync_request(self, ts1: int) -> bytes:
        """TIMESYNC request with our time `ts1` [ns]."""
        return self._pack(mavlink.MAVLink_timesync_message(0, ts1))

    def set_mode(self, main_mode: int, sub_mode: int) -> bytes:
        """DO_SET_MODE with PX4's main and sub mode."""
        return self._command(SET_MODE, (_CUSTOM_MODE_ENABLED, main_mode, sub_mode))

    def arm(self, arm: bool) -> bytes:
        """COMPONENT_ARM_DISARM, never forced: the force flag works in flight."""
        return self._command(ARM_DISARM, (1.0 if arm else 0.0, 0.0))

    def run_prearm_checks(self) -> bytes:
        """Ask for a fresh report of the arming checks, as EVENT messages."""
        return self._command(RUN_PREARM_CHECKS, ())

    def message_interval(self, message_id: int, interval: float) -> bytes:
        """Ask for a message every `interval` [s]."""
        return self._command(SET_MESSAGE_INTERVAL, (message_id, round(interval * 1e6)))

    def request_message(self, message_id: int) -> bytes:
        """Ask for one message now."""
        return self._command(REQUEST_MESSAGE, (message_id,))

    def acknowledge(self, command: int, *, accepted: bool, known: bool, system: int, component: int) -> bytes:
        """COMMAND_ACK for a command to the companion: accepted, temporarily rejected, or denied as unknown."""
        result = mavlink.MAV_RESULT_DENIED
        if known:
            result = mavlink.MAV_RESULT_ACCEPTED if accepted else mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        return self._pack(mavlink.MAVLink_command_ack_message(command, result, 0, 0, system, component))

    def read_parameter(self, name: str) -> bytes:
        """Ask for one parameter."""
        return self._pack(
            mavlink.MAVLink_param_request_read_message(self._system, self._component, name.encode("ascii"), -1)
        )

    def setpoint(self, setpoint: Setpoint, time_boot_ms: int) -> bytes:
        """SET_POSITION_TARGET_LOCAL_NED: (position,) velocity, acceleration, yaw and yaw rate in LOCAL_NED.

        Raises:
            ValueError: a number is not finite; PX4 would take it as "ignored" and change its control level.
        """
        position = (0.0, 0.0, 0.0) if setpoint.position_ned is None else setpoint.position_ned.tolist()
        numbers = (
            *position,
            *(setpoint.velocity_ned + setpoint.feedback_velocity_ned).tolist(),
            *setpoint.acceleration_ned.tolist(),
            setpoint.yaw,
            setpoint.yaw_rate,
        )
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"a setpoint must be finite, got {numbers}")
        return self._pack(
            mavlink.MAVLink_set_position_target_local_ned_message(
                time_boot_ms & 0xFFFFFFFF,
                self._system,
                self._component,
                _LOCAL_NED,
                _IGNORE_POSITION if setpoint.position_ned is None else 0,
                *numbers,
            )
        )

    def sticks(self, setpoint: SticksSetpoint) -> bytes:
        """MANUAL_CONTROL: steering on the roll axis, throttle with 500 as its neutral; pitch, yaw and buttons at rest.

        PX4 takes a throttle outside 0..1000 for neutral. With the yaw axis at rest no gesture arms or disarms.

        Raises:
            ValueError: a stick is not finite or beyond its end.
        """
        if not (-1.0 <= setpoint.steering <= 1.0 and -1.0 <= setpoint.throttle <= 1.0):
            raise ValueError(f"sticks must lie in -1..1, got {setpoint.steering} and {setpoint.throttle}")
        steering, throttle = round(1000.0 * setpoint.steering), 500 + round(500.0 * setpoint.throttle)
        return self._pack(mavlink.MAVLink_manual_control_message(self._system, 0, steering, throttle, 0, 0))

    def attitude_thrust(self, setpoint: AttitudeThrust, time_boot_ms: int) -> bytes:
        """SET_ATTITUDE_TARGET: level attitude and body thrust, no turn rates.

        Raises:
            ValueError: a number is not finite, or the thrust beyond -1..1.
        """
        return self._pack(AttitudeTarget(setpoint, self._system, self._component, time_boot_ms))

    def _command(self, command: int, parameters: Sequence[float]) -> bytes:
        if command not in ALLOWED_COMMANDS:
            raise ValueError(f"command {command} is not one that the companion may send")
        filled = (*parameters, *(0.0,) * (7 - len(parameters)))
        return self._pack(mavlink.MAVLink_command_long_message(self._system, self._component, command, 0, *filled))

    def _pack(self, message: Any) -> bytes:
        if message.get_msgId() not in ALLOWED_MESSAGES:
            raise ValueError(f"message {message.get_type()} is not one that the companion may send")
        if self._signing is not None:
            self._mavlink.signing.timestamp = self._signing.stamp()
        datagram = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        return datagram
