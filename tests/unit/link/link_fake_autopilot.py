"""A small autopilot for the link's tests: speaks pymavlink, signs nothing, obeys switches."""

from __future__ import annotations

import struct

from fastcrc import crc16
from pymavlink.dialects.v20 import common as mavlink

OFFBOARD, LOITER, LAND, POSCTL = 6 << 16, 3 << 24 | 4 << 16, 6 << 24 | 4 << 16, 3 << 16
READY_FLAGS = 831


def raw_frame(message_id: int, payload: bytes, extra: int, *, system=1, component=1, sequence=0) -> bytes:
    payload = payload.rstrip(b"\0") or b"\0"
    head = bytes((len(payload), 0, 0, sequence, system, component)) + message_id.to_bytes(3, "little")
    crc = crc16.mcrf4xx(head + payload + bytes((extra,)))
    return b"\xfd" + head + payload + crc.to_bytes(2, "little")


def signed(frame: bytes, extra: int) -> bytes:
    """The same frame as PX4 sends it without a key: incompat flag 1 and 13 bytes more."""
    body = bytes((frame[1], 1)) + frame[3:-2]
    crc = crc16.mcrf4xx(body + bytes((extra,)))
    return b"\xfd" + body + crc.to_bytes(2, "little") + b"\xff" + bytes(12)


def event_frame(event_id: int, *, log_level: int, arguments: bytes = b"") -> bytes:
    payload = struct.pack("<IIHBBB40s", event_id, 1000, 7, 0, 0, log_level << 4 | log_level, arguments)
    return raw_frame(410, payload, 160)


class FakeAutopilot:
    def __init__(self, *, system=1, vehicle_type=2, autopilot=12, boot_offset=100.0):
        self.mavlink = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.vehicle_type, self.autopilot = vehicle_type, autopilot
        self.boot_offset = boot_offset  # companion time minus boot time
        self.mode, self.armed = LOITER, False
        self.received: list = []
        self.silent_commands: set[int] = set()
        self.arm_result, self.mode_result = 0, 0
        self.obey = True
        self.intervals: dict[int, float] = {}
        self.deaf_to_intervals: set[int] = set()

    # what it says

    def pack(self, message) -> bytes:
        data = bytes(message.pack(self.mavlink))
        self.mavlink.seq = (self.mavlink.seq + 1) % 256
        return data

    def heartbeat(self) -> bytes:
        base = 29 | (128 if self.armed else 0)
        return self.pack(mavlink.MAVLink_heartbeat_message(self.vehicle_type, self.autopilot, base, self.mode, 3, 3))

    def current_mode(self) -> bytes:
        return raw_frame(436, struct.pack("<IIB", self.mode, self.mode, 0), 193)

    def ack(self, command: int, result: int, *, system=1, component=191) -> bytes:
        return self.pack(mavlink.MAVLink_command_ack_message(command, result, 0, 0, system, component))

    def odometry(
        self,
        t: float,
        *,
        position=(1.0, 2.0, -3.0),
        velocity=(0.5, 0.0, 0.0),
        q=(1.0, 0.0, 0.0, 0.0),
        rates=(0.0, 0.0, 0.0),
        frame=1,
        child=1,
        reset=11,
    ) -> bytes:
        return self.pack(
            mavlink.MAVLink_odometry_message(
                round((t - self.boot_offset) * 1e6),
                frame,
                child,
                *position,
                list(q),
                *velocity,
                *rates,
                [0.0] * 21,
                [0.0] * 21,
                reset,
                8,
                0,
            )
        )

    def estimator(self, flags=READY_FLAGS) -> bytes:
        return self.pack(mavlink.MAVLink_estimator_status_message(0, flags, 0, 0, 0, 0, 0, 0, 0, 0))

    def sys_status(self, *, enabled=0x0301402F, health=0x1320C83F, battery=80) -> bytes:
        return self.pack(
            mavlink.MAVLink_sys_status_message(0x0300402F, enabled, health, 0, 12000, -1, battery, 0, 0, 0, 0, 0, 0)
        )

    def status_text(self, text: str, *, identifier=0, chunk=0, severity=2) -> bytes:
        return self.pack(mavlink.MAVLink_statustext_message(severity, text.encode(), identifier, chunk))

    # what it hears

    def hear(self, datagrams: list[bytes], t: float) -> list[bytes]:
        """Take datagrams at companion time `t`; give the answers."""
        answers: list[bytes] = []
        for datagram in datagrams:
            parser = mavlink.MAVLink(None)
            for message in parser.parse_buffer(datagram) or []:
                self.received.append(message)
                answers += self._answer(message, t)
        return answers

    def commands(self, command: int) -> list:
        return [m for m in self.received if m.get_type() == "COMMAND_LONG" and m.command == command]

    def _answer(self, message, t: float) -> list[bytes]:
        kind = message.get_type()
        if kind == "TIMESYNC" and message.tc1 == 0:
            now = round((t - self.boot_offset) * 1e9)
            return [self.pack(mavlink.MAVLink_timesync_message(now, message.ts1))]
        if kind == "PARAM_REQUEST_READ" and message.param_id == "COM_RC_OVERRIDE":
            value = struct.unpack("<f", struct.pack("<i", 3))[0]
            return [self.pack(mavlink.MAVLink_param_value_message(b"COM_RC_OVERRIDE", value, 6, 1, 0))]
        if kind == "COMMAND_LONG" and message.command not in self.silent_commands:
            return self._command(message)
        return []

    def _command(self, message) -> list[bytes]:
        if message.command == 176:
            if self.mode_result == 0 and self.obey:
                self.mode = int(message.param2) << 16 | int(message.param3) << 24
            return [self.ack(176, 0), self.ack(176, self.mode_result), self.current_mode()]
        if message.command == 400:
            if self.arm_result == 0 and self.obey:
                self.armed = message.param1 == 1.0
            return [self.ack(400, self.arm_result)]
        if message.command == 511:
            if int(message.param1) not in self.deaf_to_intervals:
                self.intervals[int(message.param1)] = message.param2 * 1e-6
            return [self.ack(511, 0)]
        if message.command == 512:
            if int(message.param1) == 0:
                return [self.heartbeat(), self.ack(512, 0)]
            version = mavlink.MAVLink_autopilot_version_message(
                0, 17891392, 0, 0, 0, [0, 0, 0, 253, 175, 214, 222, 89], [0] * 8, [0] * 8, 0, 0, 0
            )
            return [self.pack(version), self.ack(512, 0)]
        return [self.ack(message.command, 3)]
