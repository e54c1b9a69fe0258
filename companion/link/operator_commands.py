"""Orders of the operator by MAVLink, from the ground station, over the autopilot that forwards them.

COMMAND_LONG to the companion's own component, MAV_CMD_USER_1 (31010), param1: 1 engage, 2 hold, 3 abort, 4 land.
Answered with COMMAND_ACK: accepted; temporarily rejected, where the vehicle's or the mission's state does not allow
it; denied, for another param1.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from companion.link.frames import FrameReader
from companion.link.outgoing import Encoder
from companion.link.signing import Signing
from companion.messages.operator import OperatorOrder

USER_1 = 31010
_COMMAND_LONG, _CRC_EXTRA = 76, 152
_ID_BYTES = _COMMAND_LONG.to_bytes(3, "little")
_LAYOUT = struct.Struct("<7fHBB")
_KEPT = 16  # orders that nobody takes; later ones are dropped
_ORDERS = {float(order.value): order for order in OperatorOrder}


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorParameters:
    """The ground station whose orders are obeyed."""

    system_id: Annotated[int, Ge(1), Le(255)] = 255
    component_id: Annotated[int, Ge(1), Le(255)] = 190  # MAV_COMP_ID_MISSIONPLANNER: QGroundControl too


class Request(NamedTuple):
    """One command that waits for its answer."""

    order: OperatorOrder | None  # None: one that the companion does not know


class OperatorCommands:
    """Finds the operator's commands in datagrams, and answers them.

    Args:
        parameters: whose orders are obeyed.
        system: the vehicle's, and so the companion's, system id.
        own_component: the companion's component id.
        encoder: builds the answers.
        signing: with the key that the ground station has too; None: whatever comes is believed.
    """

    def __init__(
        self,
        parameters: OperatorParameters,
        *,
        system: int,
        own_component: int,
        encoder: Encoder,
        signing: Signing | None = None,
    ) -> None:
        self._from = (parameters.system_id, parameters.component_id)
        self._to = (system, own_component)
        self._encoder = encoder
        self._reader = FrameReader(
            {_COMMAND_LONG: _CRC_EXTRA},
            system=parameters.system_id,
            component=parameters.component_id,
            believes=None
            if signing is None
            else lambda frame, signed: signing.verify(frame, signed=signed, source=self._from),
        )
        self._requests: list[Request] = []

    def receive(self, datagram: bytes) -> None:
        """Take one datagram. Never raises for its content."""
        if _ID_BYTES not in datagram:  # nearly all datagrams end here
            return
        for frame in self._reader.read(datagram):
            payload = frame.payload.ljust(_LAYOUT.size, b"\0")
            numbers = _LAYOUT.unpack(payload[: _LAYOUT.size])
            if numbers[7] == USER_1 and numbers[8:10] == self._to and len(self._requests) < _KEPT:
                self._requests.append(Request(_ORDERS.get(numbers[0])))

    def take(self) -> list[Request]:
        """Give the commands since the last call, in order; each is to be answered."""
        requests, self._requests = self._requests, []
        return requests

    def answer(self, request: Request, *, accepted: bool) -> bytes:
        """Give the datagram that answers a command."""
        system, component = self._from
        return self._encoder.acknowledge(
            USER_1, accepted=accepted, known=request.order is not None, system=system, component=component
        )
