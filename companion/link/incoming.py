"""Payloads of the messages that the link reads, decoded.

Own decoders: pymavlink builds an object of 17 attributes from an ODOMETRY and knows neither EVENT nor (in its common
dialect) CURRENT_MODE. Layouts are MAVLink's wire order; a payload that the sender cut is filled up with zeros.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

HEARTBEAT = 0
SYS_STATUS = 1
PARAM_VALUE = 22
COMMAND_ACK = 77
TIMESYNC = 111
BATTERY_STATUS = 147
AUTOPILOT_VERSION = 148
ESTIMATOR_STATUS = 230
EXTENDED_SYS_STATE = 245
STATUSTEXT = 253
ODOMETRY = 331
PARAM_ERROR = 345
EVENT = 410
CURRENT_MODE = 436

# CRC_EXTRA of each message that the link reads.
WANTED: dict[int, int] = {
    HEARTBEAT: 50,
    SYS_STATUS: 124,
    PARAM_VALUE: 220,
    COMMAND_ACK: 143,
    TIMESYNC: 34,
    BATTERY_STATUS: 154,
    AUTOPILOT_VERSION: 178,
    ESTIMATOR_STATUS: 163,
    EXTENDED_SYS_STATE: 130,
    STATUSTEXT: 83,
    ODOMETRY: 91,
    PARAM_ERROR: 209,
    EVENT: 160,
    CURRENT_MODE: 193,
}

NAMES: dict[int, str] = {
    HEARTBEAT: "HEARTBEAT",
    SYS_STATUS: "SYS_STATUS",
    PARAM_VALUE: "PARAM_VALUE",
    COMMAND_ACK: "COMMAND_ACK",
    TIMESYNC: "TIMESYNC",
    BATTERY_STATUS: "BATTERY_STATUS",
    AUTOPILOT_VERSION: "AUTOPILOT_VERSION",
    ESTIMATOR_STATUS: "ESTIMATOR_STATUS",
    EXTENDED_SYS_STATE: "EXTENDED_SYS_STATE",
    STATUSTEXT: "STATUSTEXT",
    ODOMETRY: "ODOMETRY",
    PARAM_ERROR: "PARAM_ERROR",
    EVENT: "EVENT",
    CURRENT_MODE: "CURRENT_MODE",
}

_HEARTBEAT = struct.Struct("<IBBBB")
_SYS_STATUS = struct.Struct("<III18xb")
_PARAM_VALUE = struct.Struct("<4s4x16sB")
_PARAM_ERROR = struct.Struct("<4x16sB")
_COMMAND_ACK = struct.Struct("<HBBiBB")
_TIMESYNC = struct.Struct("<qqBB")
_BATTERY_STATUS = struct.Struct("<32xBxxb")
_AUTOPILOT_VERSION = struct.Struct("<16xI16x8s")
_ESTIMATOR_STATUS = struct.Struct("<8x4f16xH")
_EXTENDED_SYS_STATE = struct.Struct("<xB")
_STATUSTEXT = struct.Struct("<B50sHB")
_ODOMETRY = struct.Struct("<Q13f168xBBB")
_EVENT = struct.Struct("<IIHBBB40s")
_CURRENT_MODE = struct.Struct("<I")


def _unpack(layout: struct.Struct, payload: bytes) -> tuple[Any, ...]:
    size = layout.size
    return layout.unpack(payload[:size] if len(payload) >= size else payload.ljust(size, b"\0"))


class Heartbeat(NamedTuple):
    """HEARTBEAT (0)."""

    custom_mode: int
    vehicle_type: int  # MAV_TYPE
    autopilot: int  # MAV_AUTOPILOT
    base_mode: int
    system_status: int  # MAV_STATE

    @property
    def armed(self) -> bool:
        """MAV_MODE_FLAG_SAFETY_ARMED."""
        return bool(self.base_mode & 128)


class SysStatus(NamedTuple):
    """SYS_STATUS (1)."""

    present: int
    enabled: int
    health: int
    battery_remaining: int  # [%], -1 unknown


class ParamValue(NamedTuple):
    """PARAM_VALUE (22)."""

    name: str
    value: float


class ParamError(NamedTuple):
    """PARAM_ERROR (345): a parameter cannot be read or set."""

    name: str
    error: int  # MAV_PARAM_ERROR: 1 does not exist


class CommandAck(NamedTuple):
    """COMMAND_ACK (77)."""

    command: int
    result: int
    progress: int
    result_param2: int
    target_system: int
    target_component: int


class Timesync(NamedTuple):
    """TIMESYNC (111)."""

    tc1: int  # [ns] 0 in a request
    ts1: int  # [ns]
    target_system: int
    target_component: int


class BatteryStatus(NamedTuple):
    """BATTERY_STATUS (147)."""

    id: int
    remaining: int  # [%], -1 unknown


class Version(NamedTuple):
    """AUTOPILOT_VERSION (148)."""

    flight_software: int  # major, minor, patch, kind: one byte each
    custom: bytes  # first 8 bytes of the source's hash, last byte first


class EstimatorStatus(NamedTuple):
    """ESTIMATOR_STATUS (230). A test ratio above 1 means that measurements are refused; 0 where there are none."""

    velocity_ratio: float
    horizontal_ratio: float  # of the horizontal position
    vertical_ratio: float  # of the height
    heading_ratio: float  # of the magnetometer
    flags: int  # ESTIMATOR_STATUS_FLAGS


class StatusTextChunk(NamedTuple):
    """STATUSTEXT (253)."""

    severity: int
    text: bytes
    id: int
    chunk: int


class Odometry(NamedTuple):
    """ODOMETRY (331), without its covariances."""

    time_usec: int
    numbers: tuple[float, ...]  # position 3 [m], quaternion w x y z, velocity 3 [m/s], angular velocity 3 [rad/s]
    frame: int  # MAV_FRAME of the position
    child_frame: int  # MAV_FRAME of the velocity
    reset_counter: int


class Event(NamedTuple):
    """EVENT (410)."""

    id: int
    time_boot_ms: int
    sequence: int
    log_level: int  # external: 0 emergency … 3 error, 4 warning, 6 info, 8 protocol
    arguments: bytes


def heartbeat(payload: bytes) -> Heartbeat:
    """Decode HEARTBEAT."""
    return Heartbeat(*_unpack(_HEARTBEAT, payload))


def sys_status(payload: bytes) -> SysStatus:
    """Decode SYS_STATUS."""
    return SysStatus(*_unpack(_SYS_STATUS, payload))


def param_value(payload: bytes) -> ParamValue:
    """Decode PARAM_VALUE; PX4 sends integers as their bytes in the place of the float."""
    raw, name, kind = _unpack(_PARAM_VALUE, payload)
    layout = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}.get(kind, "<f")
    return ParamValue(name.split(b"\0", 1)[0].decode("ascii", "replace"), float(struct.unpack(layout, raw)[0]))


def param_error(payload: bytes) -> ParamError:
    """Decode PARAM_ERROR."""
    name, error = _unpack(_PARAM_ERROR, payload)
    return ParamError(name.split(b"\0", 1)[0].decode("ascii", "replace"), error)


def command_ack(payload: bytes) -> CommandAck:
    """Decode COMMAND_ACK."""
    return CommandAck(*_unpack(_COMMAND_ACK, payload))


def timesync(payload: bytes) -> Timesync:
    """Decode TIMESYNC."""
    return Timesync(*_unpack(_TIMESYNC, payload))


def battery_status(payload: bytes) -> BatteryStatus:
    """Decode BATTERY_STATUS."""
    return BatteryStatus(*_unpack(_BATTERY_STATUS, payload))


def autopilot_version(payload: bytes) -> Version:
    """Decode AUTOPILOT_VERSION."""
    return Version(*_unpack(_AUTOPILOT_VERSION, payload))


def estimator_status(payload: bytes) -> EstimatorStatus:
    """Decode ESTIMATOR_STATUS."""
    return EstimatorStatus(*_unpack(_ESTIMATOR_STATUS, payload))


def landed_state(payload: bytes) -> int:
    """Decode the MAV_LANDED_STATE of EXTENDED_SYS_STATE."""
    return int(_unpack(_EXTENDED_SYS_STATE, payload)[0])


def status_text(payload: bytes) -> StatusTextChunk:
    """Decode STATUSTEXT."""
    return StatusTextChunk(*_unpack(_STATUSTEXT, payload))


def odometry(payload: bytes) -> Odometry:
    """Decode ODOMETRY."""
    numbers = _unpack(_ODOMETRY, payload)
    return Odometry(numbers[0], numbers[1:14], numbers[14], numbers[15], numbers[16])


def event(payload: bytes) -> Event:
    """Decode EVENT."""
    event_id, time_boot_ms, sequence, _component, _system, levels, arguments = _unpack(_EVENT, payload)
    return Event(event_id, time_boot_ms, sequence, levels & 0x0F, arguments)


def current_mode(payload: bytes) -> int:
    """Decode the custom_mode of CURRENT_MODE."""
    return int(_unpack(_CURRENT_MODE, payload)[0])
