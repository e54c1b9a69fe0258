"""MAVLink links: framing, streams at their rates, texts and events."""

import struct
from typing import Any

from pymavlink.dialects.v20 import all as mavlink
from pymavlink.generator.mavcrc import x25crc

from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.commands import CommandHandler
from sitl_stub.vehicle.forwarding import Forwarder
from sitl_stub.vehicle.ground_link import GroundLink
from sitl_stub.vehicle.notices import Event, Notice
from sitl_stub.vehicle.parameters import ParameterServer
from sitl_stub.vehicle.receiver import COMPONENT, SYSTEM, Receiver, split_frames
from sitl_stub.vehicle.signing import Signing
from sitl_stub.vehicle.stream_rates import PORTS, RATES, Port
from sitl_stub.vehicle.telemetry import Telemetry
from sitl_stub.vehicle.timesync import Timesync

__all__ = ["PORTS", "Link", "Links", "Port", "split_frames"]

EVENT_ID, EVENT_CRC_EXTRA = 410, 160
PROTOCOL_VERSION_ID, PROTOCOL_VERSION_CRC_EXTRA = 300, 217
CHUNK = 50
"""Characters of one STATUSTEXT."""
QUEUE_MAX = 20_000
"""Datagrams kept for a reader that does not come (about 40 s); then the oldest go, as on a real socket."""
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
CURRENT_MODE = mavlink.MAVLINK_MSG_ID_CURRENT_MODE


class Link:
    """One MAVLink link of the autopilot. Nothing is encoded before somebody reads or writes it."""

    def __init__(
        self,
        port: Port,
        autopilot: Autopilot,
        telemetry: Telemetry,
        commands: CommandHandler,
        forwarder: Forwarder,
    ) -> None:
        self.port = port
        self._autopilot = autopilot
        self._telemetry = telemetry
        self._parameters = ParameterServer(autopilot, self.send)
        self._mav = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self.signing = Signing(autopilot.parameters, self._mav.signing)
        self.timesync = Timesync()
        self._forwarder = forwarder
        forwarder.add(port, self._forward)
        self._receiver = Receiver(self, autopilot, commands, self._parameters, forwarder)
        self._queue: list[bytes] = []
        numbers = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}"): 1.0 / rate for name, rate in RATES[port].items()}
        self._defaults = {number: interval for number, interval in numbers.items() if number in telemetry.makers}
        self._intervals = dict(self._defaults)
        self._due: dict[int, float] = {}
        self._next_due = 0.0
        self._open = False
        self._boots = 0
        self._mode_count = 0
        self._text_number = 0
        self._ground = GroundLink()

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

    def _forward(self, frame: bytes) -> None:
        """Pass on a frame of somebody else, where there is a reader."""
        if self._open:
            self._put(frame)

    def step(self) -> None:
        """Send what is due."""
        autopilot = self._autopilot
        if not self._open or not autopilot.running:
            return
        if self._boots != autopilot.boot_count:
            self._reboot()
        self._parameters.step()
        self._send_text()
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

    def _reboot(self) -> None:
        """Forget what others asked for; the signing key is kept, as it is stored."""
        self._boots = self._autopilot.boot_count
        self._intervals = dict(self._defaults)
        self._ground = GroundLink()
        self._forwarder.forget(self.port)
        self.timesync = Timesync()
        self._mav.seq = self._text_number = 0
        self._open = False
        self._start()

    def send_once(self, number: int) -> bool:
        """Send one message of this id now; False when the autopilot has none such."""
        if number == PROTOCOL_VERSION_ID:
            self.send_protocol_version()
            return True
        if number == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            for message in self._telemetry.status.available_modes():
                self.send(message)
            return True
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

    def ground_station_heard(self) -> None:
        """A ground station's heartbeat has come on this link."""
        self._ground.heard(self._autopilot.boot_time)

    def send_notice(self, notice: Notice, sequence: int) -> None:
        """Send a notice's event to everyone; its text waits for its turn, and for a ground station."""
        if not self._open:
            return
        if notice.event is not None:
            self._send_event(notice.event, sequence)
        if notice.text:
            self._ground.put(self._autopilot.boot_time, notice)

    def _send_text(self) -> None:
        notice = self._ground.take(self._autopilot.boot_time)
        if notice is None:
            return
        text = notice.text.encode()
        for chunk, start in enumerate(range(0, len(text), CHUNK)):
            part = text[start : start + CHUNK]
            self.send(mavlink.MAVLink_statustext_message(notice.severity, part, self._text_number, chunk))
        self._text_number = (self._text_number + 1) & 0xFFFF

    def _send_event(self, event: Event, sequence: int) -> None:
        """EVENT (id 410) by hand: no dialect of PyPI's pymavlink has it, nor PROTOCOL_VERSION."""
        milliseconds = int(self._autopilot.boot_time * 1e3) & 0xFFFFFFFF
        levels = event.internal << 4 | event.level
        payload = struct.pack("<IIHBBB", event.number, milliseconds, sequence, 0, 0, levels) + event.arguments
        self._send_raw(EVENT_ID, EVENT_CRC_EXTRA, payload)

    def send_protocol_version(self) -> None:
        """PROTOCOL_VERSION (id 300) by hand: MAVLink 2.0, and PX4's range of versions."""
        payload = struct.pack("<HHH", 200, 100, 200) + bytes(16)
        self._send_raw(PROTOCOL_VERSION_ID, PROTOCOL_VERSION_CRC_EXTRA, payload)

    def _send_raw(self, number: int, crc_extra: int, payload: bytes) -> None:
        payload = payload.rstrip(b"\0") or b"\0"
        mav = self._mav
        header = struct.pack("<BBBBBBB", len(payload), 1, 0, mav.seq, SYSTEM, COMPONENT, number & 0xFF)
        body = header + (number >> 8).to_bytes(2, "little") + payload
        checksum = x25crc(body)
        checksum.accumulate(bytes([crc_extra]))
        frame = b"\xfd" + body + struct.pack("<H", checksum.crc)
        self._put(frame + self.signing.sign(frame))
        mav.seq = (mav.seq + 1) & 0xFF

    def receive(self, datagram: bytes) -> None:
        """Act on every sound frame of a datagram; garbage is skipped. An autopilot that boots hears nothing."""
        if self._autopilot.running:
            self._start()
            self._receiver.receive(datagram)


class Links:
    """Both links; they share the autopilot, and notices go to each."""

    def __init__(self, autopilot: Autopilot, telemetry: Telemetry) -> None:
        commands = CommandHandler(autopilot)
        self._autopilot = autopilot
        forwarder = Forwarder(autopilot.parameters)
        self._links = {port: Link(port, autopilot, telemetry, commands, forwarder) for port in PORTS}
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
