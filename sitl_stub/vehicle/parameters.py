"""The parameter protocol: PARAM_REQUEST_READ, PARAM_REQUEST_LIST, PARAM_SET."""

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mavlink

if TYPE_CHECKING:
    from sitl_stub.vehicle.autopilot import Autopilot

NAME_SIZE = 16
PER_STEP = 4
"""Parameters sent at each physics step of a list: 1000 a second, as PX4 does."""
INT32, REAL32 = 6, 9
DOES_NOT_EXIST, TYPE_MISMATCH = 1, 7


class ParameterServer:
    """Answers for one link. Integers travel bytewise in the float field, as PX4 sends them."""

    def __init__(self, autopilot: "Autopilot", send: Callable[[Any], None]) -> None:
        self._autopilot = autopilot
        self._send = send
        self._names = sorted(autopilot.parameters)
        self._list_at = len(self._names)

    def step(self) -> None:
        """Send the next part of a list that was asked for."""
        for _ in range(PER_STEP):
            if self._list_at >= len(self._names):
                return
            self._send_value(self._list_at)
            self._list_at += 1

    def receive(self, kind: str, message: Any) -> None:
        """Act on one message of the protocol."""
        if kind == "PARAM_REQUEST_LIST":
            self._list_at = 0
        elif kind == "PARAM_REQUEST_READ":
            name = message.param_id
            index = message.param_index if message.param_index >= 0 else self._index(name)
            if 0 <= index < len(self._names):
                self._send_value(index)
            else:
                self._send_error(message, name, DOES_NOT_EXIST)
        elif kind == "PARAM_SET":
            self._set(message)

    def _index(self, name: str) -> int:
        return self._names.index(name) if name in self._autopilot.parameters else -1

    def _set(self, message: Any) -> None:
        name, parameters = message.param_id, self._autopilot.parameters
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
        self._send_value(self._index(name))

    def _send_value(self, index: int) -> None:
        name = self._names[index]
        value = self._autopilot.parameters[name]
        whole = isinstance(value, int)
        coded = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
        kind = INT32 if whole else REAL32
        self._send(mavlink.MAVLink_param_value_message(name.encode(), coded, kind, len(self._names), index))

    def _send_error(self, message: Any, name: str, error: int) -> None:
        source, component = message.get_srcSystem(), message.get_srcComponent()
        index = getattr(message, "param_index", -1)
        self._send(mavlink.MAVLink_param_error_message(source, component, name.encode()[:NAME_SIZE], index, error))
