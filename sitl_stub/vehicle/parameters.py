"""The parameter protocol: PARAM_REQUEST_READ, PARAM_REQUEST_LIST, PARAM_SET and the hash of all values."""

import struct
import zlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mavlink

if TYPE_CHECKING:
    from sitl_stub.vehicle.autopilot import Autopilot

NAME_SIZE = 16
PER_STEP = 4
"""Parameters sent at each physics step of a list: 1000 a second, as PX4 does."""
UINT32, INT32, REAL32 = 5, 6, 9
DOES_NOT_EXIST, READ_ONLY, TYPE_MISMATCH = 1, 5, 7
HASH = "_HASH_CHECK"
HASH_INDEX, IDLE = -1, -2
NO_INDEX = 65535


def parameter_hash(values: Mapping[str, float | int]) -> int:
    """CRC-32 over names and 4-byte values in alphabetical order, as PX4's `param_hash_check` computes it."""
    state = 0
    for name in sorted(values):
        state = _crc32_part(name.encode(), state)
        state = _crc32_part(_bytes(values[name]), state)
    return state


def _crc32_part(data: bytes, state: int) -> int:
    """NuttX's crc32part: the reflected CRC-32 without inversion before and after."""
    return zlib.crc32(data, state ^ 0xFFFFFFFF) ^ 0xFFFFFFFF


def _bytes(value: float | int) -> bytes:
    return struct.pack("<i", value) if isinstance(value, int) else struct.pack("<f", value)


class ParameterServer:
    """Answers for one link. Integers travel bytewise in the float field, as PX4 sends them."""

    def __init__(self, autopilot: "Autopilot", send: Callable[[Any], None]) -> None:
        self._autopilot = autopilot
        self._send = send
        self._names = sorted(autopilot.parameters)
        self._indices = {name: index for index, name in enumerate(self._names)}
        self._list_at = IDLE

    def step(self) -> None:
        """Send the next part of a list that was asked for."""
        if self._list_at == IDLE:
            return
        for _ in range(PER_STEP):
            if self._list_at == HASH_INDEX:
                self._send_hash()
            else:
                self._send_value(self._list_at)
            self._list_at += 1
            if self._list_at >= len(self._names):
                self._list_at = IDLE
                return

    def receive(self, kind: str, message: Any) -> None:
        """Act on one message of the protocol."""
        if kind == "PARAM_REQUEST_LIST":
            self._list_at = HASH_INDEX if self._list_at == IDLE else 0
        elif kind == "PARAM_REQUEST_READ":
            self._read(message)
        elif kind == "PARAM_SET":
            self._set(message)

    def _read(self, message: Any) -> None:
        name, index = message.param_id, message.param_index
        if index < 0 and name == HASH:
            self._send_hash()
            return
        index = self._indices.get(name, -1) if index < 0 else index
        if 0 <= index < len(self._names):
            self._send_value(index)
        else:
            self._send_error(message, name, DOES_NOT_EXIST)

    def _set(self, message: Any) -> None:
        name, parameters = message.param_id, self._autopilot.parameters
        if name == HASH:
            # a ground station that has the values already: stop sending them
            self._list_at = IDLE
            self._send_error(message, name, READ_ONLY)
            return
        if name not in parameters:
            self._send_error(message, name, DOES_NOT_EXIST)
            return
        whole = isinstance(parameters[name], int)
        if message.param_type != (INT32 if whole else REAL32):
            self._send_error(message, name, TYPE_MISMATCH)
            return
        value = message.param_value
        parameters[name] = struct.unpack("<i", struct.pack("<f", value))[0] if whole else float(value)
        self._autopilot.parameter_changed()
        self._send_value(self._indices[name])

    def _send_value(self, index: int) -> None:
        name = self._names[index]
        value = self._autopilot.parameters[name]
        kind = INT32 if isinstance(value, int) else REAL32
        coded = struct.unpack("<f", _bytes(value))[0]
        self._send(mavlink.MAVLink_param_value_message(name.encode(), coded, kind, len(self._names), index))

    def _send_hash(self) -> None:
        coded = struct.unpack("<f", struct.pack("<I", parameter_hash(self._autopilot.parameters)))[0]
        self._send(mavlink.MAVLink_param_value_message(HASH.encode(), coded, UINT32, len(self._names), NO_INDEX))

    def _send_error(self, message: Any, name: str, error: int) -> None:
        source, component = message.get_srcSystem(), message.get_srcComponent()
        index = getattr(message, "param_index", -1)
        self._send(mavlink.MAVLink_param_error_message(source, component, name.encode()[:NAME_SIZE], index, error))
