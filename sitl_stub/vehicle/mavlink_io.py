"""MAVLink links: framing, signing, streams at their rates, and what arrives."""

import hashlib
import struct
from typing import TYPE_CHECKING, Any, Literal

from pymavlink.dialects.v20 import all as mavlink
from pymavlink.generator.mavcrc import x25crc

from sitl_stub.vehicle import setpoints
from sitl_stub.vehicle.commands import CommandHandler
from sitl_stub.vehicle.navigator import Sticks
from sitl_stub.vehicle.notices import Event, Notice
from sitl_stub.vehicle.parameters import ParameterServer
from sitl_stub.vehicle.telemetry import Telemetry

if TYPE_CHECKING:
    from sitl_stub.vehicle.autopilot import Autopilot

Port = Literal["onboard", "ground"]
PORTS: tuple[Port, ...] = ("onboard", "ground")
SYSTEM, COMPONENT = 1, 1
EVENT_ID, EVENT_CRC_EXTRA = 410, 160
CHUNK = 50
"""Characters of one STATUSTEXT."""
QUEUE_MAX = 20_000
"""Datagrams kept for a reader that does not come (about 40 s); then the oldest go, as on a real socket."""
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
CURRENT_MODE = mavlink.MAVLINK_MSG_ID_CURRENT_MODE

RATES: dict[Port, dict[str, float]] = {
    "onboard": {
        "ATTITUDE": 100.0,
        "ATTITUDE_QUATERNION": 50.0,
        "HIGHRES_IMU": 50.0,
        "GLOBAL_POSITION_INT": 50.0,
        "LOCAL_POSITION_NED": 30.0,
        "ODOMETRY": 30.0,
        "TIMESYNC": 10.0,
        "ALTITUDE": 10.0,
        "DISTANCE_SENSOR": 10.0,
        "ATTITUDE_TARGET": 10.0,
        "POSITION_TARGET_LOCAL_NED": 10.0,
        "SERVO_OUTPUT_RAW": 10.0,
        "VFR_HUD": 10.0,
        "GPS_RAW_INT": 8.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "HEARTBEAT": 1.0,
        "ESTIMATOR_STATUS": 1.0,
        "SYSTEM_TIME": 1.0,
        "BATTERY_STATUS": 0.5,
        "CURRENT_MODE": 0.5,
        "HOME_POSITION": 0.5,
    },
    "ground": {
        "ATTITUDE": 50.0,
        "ATTITUDE_QUATERNION": 50.0,
        "ATTITUDE_TARGET": 50.0,
        "LOCAL_POSITION_NED": 50.0,
        "POSITION_TARGET_LOCAL_NED": 50.0,
        "GLOBAL_POSITION_INT": 50.0,
        "SERVO_OUTPUT_RAW": 50.0,
        "GPS_RAW_INT": 5.0,
        "VFR_HUD": 4.0,
        "HEARTBEAT": 1.0,
        "ALTITUDE": 1.0,
        "EXTENDED_SYS_STATE": 1.0,
        "SYS_STATUS": 1.0,
        "SYSTEM_TIME": 1.0,
        "BATTERY_STATUS": 0.5,
        "CURRENT_MODE": 0.5,
        "DISTANCE_SENSOR": 0.5,
        "ESTIMATOR_STATUS": 0.5,
        "HOME_POSITION": 0.5,
    },
}
"""Messages a second on each link, as measured on PX4 v1.17."""


class Link:
    """One MAVLink link of the autopilot. Nothing is encoded before somebody reads or writes it."""

    def __init__(self, port: Port, autopilot: "Autopilot", telemetry: Telemetry, commands: CommandHandler) -> None:
        self.port = port
        self._autopilot = autopilot
        self._telemetry = telemetry
        self._commands = commands
        self._parameters = ParameterServer(autopilot, self.send)
        self._mav = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        signing = self._mav.signing
        # PX4 signs every frame even without a key: all zeros, link id 255, a counter as timestamp
        signing.secret_key, signing.link_id, signing.timestamp, signing.sign_outgoing = bytes(32), 255, 1, True
        self._parser = mavlink.MAVLink(None)
        self._queue: list[bytes] = []
        numbers = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}"): 1.0 / rate for name, rate in RATES[port].items()}
        self._defaults = {number: interval for number, interval in numbers.items() if number in telemetry.makers}
        self._intervals = dict(self._defaults)
        self._due: dict[int, float] = {}
        self._next_due = 0.0
        self._open = False
        self._mode_count = 0
        self._text_number = 0
        self.has_ground_station = False
        """Whether a ground station's heartbeat was heard: only then STATUSTEXT is sent."""

    # sending

    def take(self) -> list[bytes]:
        """Hand out what was sent since the last call."""
        self._start()
        queue, self._queue = self._queue, []
        return queue

    def _start(self) -> None:
        if not self._open:
            self._open = True
            self._due = dict.fromkeys(self._intervals, self._autopilot.t)
            self._next_due = self._autopilot.t

    def send(self, message: Any) -> None:
        """Encode one message and queue it."""
        mav = self._mav
        self._put(bytes(message.pack(mav)))
        mav.seq = (mav.seq + 1) & 0xFF

    def _put(self, frame: bytes) -> None:
        self._queue.append(frame)
        if len(self._queue) > QUEUE_MAX:
            del self._queue[: QUEUE_MAX // 4]

    def step(self) -> None:
        """Send what is due."""
        if not self._open:
            return
        self._parameters.step()
        autopilot = self._autopilot
        if self._mode_count != autopilot.mode_count:
            self._mode_count = autopilot.mode_count
            if CURRENT_MODE in self._intervals:
                self.send_once(CURRENT_MODE)
        t = autopilot.t + 1e-9
        if t < self._next_due:
            return
        due, intervals, makers = self._due, self._intervals, self._telemetry.makers
        for number, when in due.items():
            if when <= t:
                interval = intervals[number]
                due[number] = when + interval if when + interval > t else t + interval
                if number != HEARTBEAT or autopilot.faults.heartbeat:
                    self.send(makers[number]())
        self._next_due = min(due.values())

    def send_once(self, number: int) -> bool:
        """Send one message of this id now; False when the autopilot has none such."""
        maker = self._telemetry.makers.get(number)
        if maker is None:
            return False
        self.send(maker())
        return True

    def set_interval(self, number: int, interval: float) -> bool:
        """Set the interval [s] of a stream: 0 default, below 0 off. False when there is no such message."""
        if number not in self._telemetry.makers:
            return False
        self._start()
        if interval == 0.0:
            interval = self._defaults.get(number, -1.0)
        self._intervals.pop(number, None)
        self._due.pop(number, None)
        if interval > 0.0:
            self._intervals[number] = interval
            self._due[number] = self._autopilot.t
            self._next_due = min(self._next_due, self._autopilot.t)
        return True

    def send_interval(self, number: int) -> None:
        """Send MESSAGE_INTERVAL."""
        interval = self._intervals.get(number)
        microseconds = round(interval * 1e6) if interval is not None else -1 if number in self._telemetry.makers else 0
        self.send(mavlink.MAVLink_message_interval_message(number, microseconds))

    def send_notice(self, notice: Notice, sequence: int) -> None:
        """Send a notice's event to everyone, its text to ground stations."""
        if not self._open:
            return
        if notice.event is not None:
            self._send_event(notice.event, sequence)
        if notice.text and self.has_ground_station:
            text = notice.text.encode()
            for chunk, start in enumerate(range(0, len(text), CHUNK)):
                part = text[start : start + CHUNK]
                self.send(mavlink.MAVLink_statustext_message(notice.severity, part, self._text_number, chunk))
            self._text_number = (self._text_number + 1) & 0xFFFF

    def _send_event(self, event: Event, sequence: int) -> None:
        """EVENT (id 410) by hand: no dialect of PyPI's pymavlink has it."""
        milliseconds = int(self._autopilot.boot_time * 1e3) & 0xFFFFFFFF
        levels = event.internal << 4 | event.level
        payload = struct.pack("<IIHBBB", event.number, milliseconds, sequence, 0, 0, levels) + event.arguments
        payload = payload.rstrip(b"\0") or b"\0"
        mav = self._mav
        header = struct.pack("<BBBBBBB", len(payload), 1, 0, mav.seq, SYSTEM, COMPONENT, EVENT_ID & 0xFF)
        body = header + (EVENT_ID >> 8).to_bytes(2, "little") + payload
        checksum = x25crc(body)
        checksum.accumulate(bytes([EVENT_CRC_EXTRA]))
        frame = bytearray(b"\xfd" + body + struct.pack("<H", checksum.crc))
        self._put(bytes(frame) + self._signature(bytes(frame)))
        mav.seq = (mav.seq + 1) & 0xFF

    def _signature(self, frame: bytes) -> bytes:
        signing = self._mav.signing
        stamp = bytes([signing.link_id]) + struct.pack("<Q", signing.timestamp)[:6]
        signing.timestamp += 1
        return stamp + hashlib.sha256(bytes(32) + frame + stamp).digest()[:6]

    # receiving

    def receive(self, datagram: bytes) -> None:
        """Act on every sound frame of a datagram; garbage is skipped."""
        self._start()
        for frame in split_frames(datagram):
            try:
                message = self._parser.decode(bytearray(frame))
            except mavlink.MAVError:
                continue
            self._act(message)

    def _act(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "SET_POSITION_TARGET_LOCAL_NED":
            self._setpoint(message)
        elif kind == "TIMESYNC":
            if message.tc1 == 0:
                self.send(mavlink.MAVLink_timesync_message(int(self._autopilot.boot_time * 1e9), message.ts1))
        elif kind == "HEARTBEAT":
            self.has_ground_station |= message.type == mavlink.MAV_TYPE_GCS
        elif kind == "COMMAND_LONG":
            values = tuple(getattr(message, f"param{i}") for i in range(1, 8))
            self._command(message, message.command, values)
        elif kind == "COMMAND_INT":
            values = (message.param1, message.param2, message.param3, message.param4, message.x, message.y, message.z)
            self._command(message, message.command, values)
        elif kind == "MANUAL_CONTROL" and message.target in (0, SYSTEM):
            # what is out of range counts as centred, also a throttle below zero
            up = message.z / 500.0 - 1.0 if 0 <= message.z <= 1000 else 0.0
            sticks = Sticks(forward=message.x / 1000.0, right=message.y / 1000.0, up=up, yaw=message.r / 1000.0)
            self._autopilot.commander.sticks_arrived(sticks)
        elif kind == "SET_MODE" and message.target_system == SYSTEM:
            custom = message.custom_mode
            wanted = (float(message.base_mode & 1), float(custom >> 16 & 0xFF), float(custom >> 24), 0.0, 0.0, 0.0, 0.0)
            result = self._commands.set_mode(wanted)
            self._acknowledge(message, mavlink.MAV_CMD_DO_SET_MODE, int(result))
        elif kind.startswith("PARAM_") and _for_us(message):
            self._parameters.receive(kind, message)

    def _setpoint(self, message: Any) -> None:
        if not _for_us(message):
            return
        setpoint = setpoints.decode(message, self._autopilot.estimate.yaw)
        if isinstance(setpoint, Notice):
            self._autopilot.commander.notices.append(setpoint)
        else:
            self._autopilot.offboard_setpoint(setpoint)

    def _command(self, message: Any, command: int, values: tuple[Any, ...]) -> None:
        if not _for_us(message):
            return
        p1, p2, p3, p4, p5, p6, p7 = map(float, values)
        for result in self._commands.handle(self, command, (p1, p2, p3, p4, p5, p6, p7)):
            self._acknowledge(message, command, int(result))

    def _acknowledge(self, message: Any, command: int, result: int) -> None:
        source, component = message.get_srcSystem(), message.get_srcComponent()
        self.send(mavlink.MAVLink_command_ack_message(command, result, 0, 0, source, component))


class Links:
    """Both links; they share the autopilot, and notices go to each."""

    def __init__(self, autopilot: "Autopilot") -> None:
        telemetry, commands = autopilot.telemetry(), CommandHandler(autopilot)
        self._autopilot = autopilot
        self._links = {port: Link(port, autopilot, telemetry, commands) for port in PORTS}
        self._sequence = 0

    def __getitem__(self, port: Port) -> Link:
        return self._links[port]

    def step(self) -> None:
        """Send what is due on both links."""
        pending = self._autopilot.commander.notices
        if pending:
            for notice in pending:
                for link in self._links.values():
                    link.send_notice(notice, self._sequence)
                self._sequence = (self._sequence + (notice.event is not None)) & 0xFFFF
            pending.clear()
        for link in self._links.values():
            link.step()


def _for_us(message: Any) -> bool:
    return message.target_system in (0, SYSTEM) and message.target_component in (0, COMPONENT)


def split_frames(datagram: bytes) -> list[bytes]:
    """Cut a datagram into whole MAVLink 1 and 2 frames; bytes between them are skipped."""
    frames, i, size = [], 0, len(datagram)
    while i + 8 <= size:
        magic = datagram[i]
        if magic == 0xFD and i + 12 <= size:
            length = datagram[i + 1] + (25 if datagram[i + 2] & 1 else 12)
        elif magic == 0xFE:
            length = datagram[i + 1] + 8
        else:
            i += 1
            continue
        if i + length > size:
            break
        frames.append(datagram[i : i + length])
        i += length
    return frames
