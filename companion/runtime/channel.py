"""The socket between the guardian's process and the planner's: messages with bounds, never blocking either side.

From the planner come handover frames (`companion/guardian/handover_frame.py`), of which nothing is trusted: damaged,
old or repeated ones are counted and dropped, of many the newest counts. To the planner goes telemetry, pickled, since
the planner trusts the guardian. Whatever finds the other side's queue full is dropped and counted.
"""

from __future__ import annotations

import pickle
import socket
from dataclasses import replace

from companion.guardian.handover import Handover, Order
from companion.guardian.handover_frame import MAX_FRAME, FrameError, check, decode, encode
from companion.runtime.telemetry import Telemetry

_BUFFER = 1 << 20  # [bytes] asked of the kernel for telemetry
_AT_ONCE = 512  # messages taken in one go: a flood must not hold up a tick
_TELEMETRY_MAX = 1 << 19  # [bytes]


def pair() -> tuple[socket.socket, socket.socket]:
    """Give both ends: the guardian's and the planner's."""
    guardian, planner = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    guardian.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
    return guardian, planner


class _End:
    """One end of the socket."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._socket = end
        self.closed = False  # the other side is gone
        self.unsent = 0  # messages that found no room
        self.unsound = 0  # messages that were not understood

    def fileno(self) -> int:
        """Give the socket's file descriptor."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close this end; the other side learns of it."""
        self.closed = True
        self._socket.close()

    def _send(self, data: bytes) -> bool:
        if self.closed:
            return False
        try:
            self._socket.send(data)
        except (BlockingIOError, InterruptedError):
            self.unsent += 1
            return False
        except OSError as error:
            self.unsent += 1
            self.closed = self.closed or isinstance(error, ConnectionError)
            return False
        return True

    def _receive(self, size: int) -> bytes | None:
        """Give the next message, or None where there is none now."""
        if self.closed:
            return None
        try:
            data = self._socket.recv(size)
        except (BlockingIOError, InterruptedError):
            return None
        except OSError:
            data = b""
        if not data:
            self.closed = True
            return None
        return data


class PlannerPort(_End):
    """The guardian's end."""

    def __init__(self, end: socket.socket) -> None:
        super().__init__(end)
        self._sequence = -1

    def send(self, telemetry: Telemetry) -> None:
        """Tell the planner; where it does not fit, without the raw datagrams."""
        data = pickle.dumps(telemetry, protocol=5)
        if len(data) > _TELEMETRY_MAX:
            data = pickle.dumps(replace(telemetry, datagrams=()), protocol=5)
        self._send(data)

    def receive(self) -> Handover | None:
        """Give the newest sound handover since the last call, with the orders of all; None where there is none."""
        newest: bytes | None = None
        orders: frozenset[Order] = frozenset()
        for _ in range(_AT_ONCE):
            frame = self._receive(MAX_FRAME + 1)
            if frame is None:
                break
            try:
                head = check(frame)
            except FrameError:
                self.unsound += 1
                continue
            if head.sequence <= self._sequence:
                self.unsound += 1
                continue
            self._sequence, newest = head.sequence, frame
            orders |= head.orders
        if newest is None:
            return None
        try:
            return replace(decode(newest), orders=orders)
        except FrameError:
            self.unsound += 1
            return None


class GuardianPort(_End):
    """The planner's end."""

    def __init__(self, end: socket.socket) -> None:
        super().__init__(end)
        self._sequence = 0

    def send(self, handover: Handover) -> None:
        """Hand over to the guardian.

        Raises:
            ValueError: the handover cannot be put into a frame.
        """
        self._sequence += 1
        self._send(encode(handover, self._sequence))

    def receive(self) -> Telemetry | None:
        """Give what has come since the last call as one; None where there is nothing."""
        joined: Telemetry | None = None
        while (data := self._receive(2 * _TELEMETRY_MAX)) is not None:
            try:
                telemetry: Telemetry = pickle.loads(data)
            except (pickle.UnpicklingError, EOFError):
                self.unsound += 1
                continue
            joined = telemetry if joined is None else _joined(joined, telemetry)
        return joined


def _joined(first: Telemetry, second: Telemetry) -> Telemetry:
    return replace(
        second,
        datagrams=(*first.datagrams, *second.datagrams),
        states=(*first.states, *second.states),
        events=(*first.events, *second.events),
        sent=(*first.sent, *second.sent),
        orders=(*first.orders, *second.orders),
    )
