"""What arrives on a link: verified, decoded, and handed to the part of the autopilot that it is for."""

from collections.abc import Callable
from typing import Any, Protocol

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.vehicle import attitude_setpoints, landing_target, setpoints
from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.commands import CommandHandler, Streams
from sitl_stub.vehicle.forwarding import Forwarder
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.parameters import ParameterServer
from sitl_stub.vehicle.signing import Signing
from sitl_stub.vehicle.sticks import Source, Sticks
from sitl_stub.vehicle.stream_rates import Port
from sitl_stub.vehicle.timesync import Timesync

SYSTEM, COMPONENT = 1, 1
STICK_SOURCES: dict[Port, Source] = {"ground": Source.MAVLINK_FIRST, "onboard": Source.MAVLINK_SECOND}
CHANNELS = 18


class Answering(Streams, Protocol):
    """The link on which frames arrive, and on which they are answered."""

    @property
    def port(self) -> Port:
        """Which one."""

    @property
    def signing(self) -> Signing:
        """Says which frames may pass."""

    @property
    def timesync(self) -> Timesync:
        """Offset of the other side's clock."""

    def send(self, message: Any) -> None:
        """Encode one message and queue it."""

    def ground_station_heard(self) -> None:
        """A ground station's heartbeat has come on this link."""


class Receiver:
    """Acts on the frames of one link."""

    def __init__(
        self,
        link: Answering,
        autopilot: Autopilot,
        commands: CommandHandler,
        parameters: ParameterServer,
        forwarder: Forwarder,
    ) -> None:
        self._link = link
        self._autopilot = autopilot
        self._commands = commands
        self._parameters = parameters
        self._forwarder = forwarder
        self._parser = mavlink.MAVLink(None)
        self._handlers: dict[str, Callable[[Any], None]] = {
            "SET_POSITION_TARGET_LOCAL_NED": self._setpoint,
            "SET_ATTITUDE_TARGET": self._attitude_target,
            "TIMESYNC": self._timesync,
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": self._command_long,
            "COMMAND_INT": self._command_int,
            "MANUAL_CONTROL": self._manual_control,
            "RC_CHANNELS_OVERRIDE": self._channels,
            "SET_MODE": self._set_mode,
            "SETUP_SIGNING": self._set_up_signing,
            "LANDING_TARGET": lambda message: landing_target.take(message, autopilot),
        }

    def receive(self, datagram: bytes) -> None:
        """Act on every sound frame of a datagram that signing lets pass; garbage is skipped, byte by byte."""
        i, size = 0, len(datagram)
        while i + 8 <= size:
            length = frame_length(datagram, i)
            message = self._decode(datagram[i : i + length]) if 0 < length <= size - i else None
            if message is None:
                i += 1
                continue
            frame = datagram[i : i + length]
            if self._link.signing.accepts(frame, message.get_msgId()):
                self._forwarder.heard(self._link.port, message, frame)
                self._act(message)
            i += length

    def _decode(self, frame: bytes) -> Any | None:
        try:
            return self._parser.decode(bytearray(frame))
        except mavlink.MAVError:
            return None

    def _act(self, message: Any) -> None:
        kind = message.get_type()
        handler = self._handlers.get(kind)
        if handler is not None:
            handler(message)
        elif kind.startswith("PARAM_") and _for_us(message):
            self._parameters.receive(kind, message)

    def _heartbeat(self, message: Any) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._link.ground_station_heard()
            self._autopilot.commander.checks.ground_station_heard(self._autopilot.t)

    def _command_long(self, message: Any) -> None:
        self._command(message, tuple(getattr(message, f"param{i}") for i in range(1, 8)))

    def _command_int(self, message: Any) -> None:
        values = (message.param1, message.param2, message.param3, message.param4, message.x, message.y, message.z)
        self._command(message, values)

    def _manual_control(self, message: Any) -> None:
        if message.target in (0, SYSTEM):
            pilot = self._autopilot.commander.pilot
            pilot.arrived(self._autopilot.t, _sticks(message), STICK_SOURCES[self._link.port])

    def _channels(self, message: Any) -> None:
        if message.target_system in (0, SYSTEM):
            raw = [getattr(message, f"chan{i}_raw") for i in range(1, CHANNELS + 1)]
            self._autopilot.commander.pilot.channels_arrived(self._autopilot.t, raw)

    def _set_up_signing(self, message: Any) -> None:
        self._link.signing.set_up(bytes(message.secret_key), message.initial_timestamp)

    def _timesync(self, message: Any) -> None:
        now = self._autopilot.boot_time
        if message.tc1 == 0:
            self._link.send(mavlink.MAVLink_timesync_message(int(now * 1e9), message.ts1))
        elif message.tc1 > 0:
            self._link.timesync.update(int(now * 1e6), message.tc1, message.ts1)

    def _setpoint(self, message: Any) -> None:
        if not _for_us(message):
            return
        setpoint = setpoints.decode(message, self._autopilot.estimate.yaw)
        if isinstance(setpoint, Notice):
            self._autopilot.commander.notices.append(setpoint)
        else:
            self._autopilot.offboard_setpoint(setpoint)

    def _attitude_target(self, message: Any) -> None:
        target = attitude_setpoints.decode(message) if _for_us(message) else None
        if target is not None:
            self._autopilot.attitude_target(target)

    def _set_mode(self, message: Any) -> None:
        if message.target_system != SYSTEM:
            return
        custom = message.custom_mode
        wanted = (float(message.base_mode & 1), float(custom >> 16 & 0xFF), float(custom >> 24), 0.0, 0.0, 0.0, 0.0)
        result = self._commands.set_mode(wanted, component=message.get_srcComponent())
        self._acknowledge(message, mavlink.MAV_CMD_DO_SET_MODE, int(result))

    def _command(self, message: Any, values: tuple[Any, ...]) -> None:
        if not _for_us(message):
            return
        p1, p2, p3, p4, p5, p6, p7 = map(float, values)
        wanted, component = (p1, p2, p3, p4, p5, p6, p7), message.get_srcComponent()
        for result in self._commands.handle(self._link, message.command, wanted, component=component):
            self._acknowledge(message, message.command, int(result))

    def _acknowledge(self, message: Any, command: int, result: int) -> None:
        source, component = message.get_srcSystem(), message.get_srcComponent()
        self._link.send(mavlink.MAVLink_command_ack_message(command, result, 0, 0, source, component))


def _sticks(message: Any) -> Sticks:
    """MANUAL_CONTROL's axes; one out of its range counts as centred (also a negative throttle)."""
    forward, right, yaw = (
        value / 1000.0 if -1000 <= value <= 1000 else 0.0 for value in (message.x, message.y, message.r)
    )
    up = message.z / 500.0 - 1.0 if 0 <= message.z <= 1000 else 0.0
    return Sticks(forward=forward, right=right, up=up, yaw=yaw)


def _for_us(message: Any) -> bool:
    return message.target_system in (0, SYSTEM) and message.target_component in (0, COMPONENT)


def frame_length(datagram: bytes, i: int) -> int:
    """Length [bytes] that the MAVLink 1 or 2 frame claims which begins at `i`; 0 when none begins there."""
    if datagram[i] == 0xFD and i + 12 <= len(datagram):
        return datagram[i + 1] + (25 if datagram[i + 2] & 1 else 12)
    return datagram[i + 1] + 8 if datagram[i] == 0xFE else 0


def frame_source(frame: bytes) -> tuple[int, int, int]:
    """Give message id, system and component of a whole MAVLink 1 or 2 frame."""
    if frame[0] == 0xFD:
        return int.from_bytes(frame[7:10], "little"), frame[5], frame[6]
    return frame[5], frame[3], frame[4]


def split_frames(datagram: bytes) -> list[bytes]:
    """Cut a datagram into whole frames, as they claim to be; bytes between them are skipped."""
    frames, i = [], 0
    while i + 8 <= len(datagram):
        length = frame_length(datagram, i)
        if length == 0:
            i += 1
            continue
        if i + length > len(datagram):
            break
        frames.append(datagram[i : i + length])
        i += length
    return frames
