"""Transports over byte streams (TCP, serial), and their twin in memory."""

from __future__ import annotations

import asyncio
import contextlib
import os
from copy import copy

from companion.clock import Clock
from companion.errors import VehicleError
from companion.link.endpoints import SerialEndpoint, TcpEndpoint
from companion.link.framing import Framer, StreamFramer
from companion.link.lines import Line, SerialLine, TcpLine
from companion.link.transport import ArrivalQueue, Received, TransportStatistics

_READ = 4096  # [bytes] at once
_OPEN_TIMEOUT = 3.0  # [s]
_REOPEN_PAUSE = 0.5  # [s]


class _FrameQueue:
    """Cuts what comes into frames, which wait to be taken."""

    def __init__(self, clock: Clock, framer: Framer | None = None) -> None:
        self._clock = clock
        self._queue = ArrivalQueue()
        self._framer = StreamFramer() if framer is None else framer

    def feed(self, data: bytes) -> None:
        t = self._clock.now()
        for frame in self._framer.feed(data):
            self._queue.put(t, frame)

    def take(self) -> list[Received]:
        return self._queue.take()

    def broken_off(self) -> None:
        """The stream has ended: what has begun will not be completed."""
        self._framer.forget()

    def statistics(self, *, sent: int, send_errors: int = 0, reopened: int = 0) -> TransportStatistics:
        """Give what has been counted, here and by whoever sends."""
        framing = self._framer.statistics()
        return TransportStatistics(
            received=framing.frames,
            sent=sent,
            dropped=self._queue.dropped,
            send_errors=send_errors,
            skipped=framing.skipped,
            reopened=reopened,
        )


class StreamTransport:
    """Talks over one byte stream, and opens it again where it breaks off.

    Nothing waits to be sent but the rest of a frame that has begun: while the stream does not take more, whole frames
    are dropped and counted. A setpoint that comes late is worse than none.

    Args:
        name: for messages.
        line: what is opened.
        clock: stamps arrivals.
        framer: cuts what comes into frames; None: MAVLink's.
    """

    def __init__(self, name: str, line: Line, clock: Clock, framer: Framer | None = None) -> None:
        self._name = name
        self._line = line
        self._arrived = _FrameQueue(clock, framer)
        self._loop = asyncio.get_running_loop()
        self._descriptor: int | None = None  # while it is open
        self._opening: int | None = None
        self._opened: asyncio.Future[None] = self._loop.create_future()  # of the first opening
        self._retry: asyncio.TimerHandle | None = None
        self._rest = b""
        self._closed = False
        self._sent = self._send_errors = self._openings = 0

    @classmethod
    async def open(
        cls, endpoint: TcpEndpoint | SerialEndpoint, *, clock: Clock, framer: Framer | None = None
    ) -> StreamTransport:
        """Open the stream.

        Args:
            endpoint: what to open.
            clock: stamps arrivals.
            framer: cuts what comes into frames; None: MAVLink's.

        Raises:
            VehicleError: it cannot be opened.
        """
        line = TcpLine(endpoint) if isinstance(endpoint, TcpEndpoint) else SerialLine(endpoint)
        transport = cls(str(endpoint), line, clock, framer)
        try:
            transport._begin()
            async with asyncio.timeout(_OPEN_TIMEOUT):
                await transport._opened
        except OSError as error:  # TimeoutError is one
            await transport.close()
            reason = error.strerror or "no answer"
            raise VehicleError(f"{endpoint}: cannot be opened ({reason}); {_advice(endpoint)}") from error
        return transport

    def send(self, data: bytes) -> None:
        """Send one frame; nothing while the stream is broken."""
        if self._descriptor is None:
            return
        if self._rest:
            self._send_errors += 1
            return
        try:
            count = os.write(self._descriptor, data)
        except BlockingIOError:
            self._send_errors += 1
            return
        except OSError:
            self._send_errors += 1
            self._broken()
            return
        self._sent += 1
        if count < len(data):
            self._rest = data[count:]
            self._loop.add_writer(self._descriptor, self._send_rest)

    def receive(self) -> list[Received]:
        """Give the frames that have come since the last call, each as one datagram."""
        return self._arrived.take()

    def statistics(self) -> TransportStatistics:
        """Give what has been counted."""
        return self._arrived.statistics(
            sent=self._sent, send_errors=self._send_errors, reopened=max(0, self._openings - 1)
        )

    @property
    def connected(self) -> bool:
        """Whether the stream is open now."""
        return self._descriptor is not None

    async def close(self) -> None:
        """Close the stream."""
        self._closed = True
        if self._retry is not None:
            self._retry.cancel()
        self._let_go()
        self._opened.cancel()

    # ---- opening and breaking off

    def _begin(self) -> None:
        self._opening = self._line.begin()
        self._loop.add_writer(self._opening, self._confirm)

    def _confirm(self) -> None:
        """Go on once the stream can be written to: it is open, or opening it has failed."""
        descriptor = self._opening
        if descriptor is None:
            return
        self._loop.remove_writer(descriptor)
        self._opening = None
        try:
            self._line.confirm()
        except OSError as error:
            if not self._opened.done():
                self._opened.set_exception(error)
            else:
                self._broken()
            return
        self._descriptor = descriptor
        self._openings += 1
        self._loop.add_reader(descriptor, self._read)
        if not self._opened.done():
            self._opened.set_result(None)

    def _broken(self) -> None:
        self._let_go()
        if not self._closed:
            self._retry = self._loop.call_later(_REOPEN_PAUSE, self._begin_again)

    def _begin_again(self) -> None:
        try:
            self._begin()
        except OSError:
            self._broken()

    def _let_go(self) -> None:
        for descriptor in (self._descriptor, self._opening):
            if descriptor is not None:
                self._loop.remove_reader(descriptor)
                self._loop.remove_writer(descriptor)
        self._descriptor = self._opening = None
        self._rest = b""
        self._arrived.broken_off()
        self._line.end()

    # ---- bytes

    def _read(self) -> None:
        if self._descriptor is None:
            return
        try:
            data = os.read(self._descriptor, _READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._arrived.feed(data)
        else:  # the other end has closed, or the device is gone
            self._broken()

    def _send_rest(self) -> None:
        if self._descriptor is None:
            return
        try:
            self._rest = self._rest[os.write(self._descriptor, self._rest) :]
        except BlockingIOError:
            return
        except OSError:
            self._broken()
            return
        if not self._rest:
            self._loop.remove_writer(self._descriptor)


def _advice(endpoint: TcpEndpoint | SerialEndpoint) -> str:
    if isinstance(endpoint, TcpEndpoint):
        return "check that a program listens there, and the address"
    with contextlib.suppress(OSError):
        if not os.access(endpoint.device, os.R_OK | os.W_OK) and os.path.lexists(endpoint.device):
            return "run as a member of the device's group (often 'dialout')"
    return "check that the device is there, is a serial one, and that no other program uses it"


class MemoryStream:
    """One end of a byte stream in memory: the twin of TCP and serial.

    Args:
        clock: stamps arrivals.
        piece: bytes arrive in pieces of this length; frames are cut anywhere.
        framer: cuts what comes into frames; None: MAVLink's.
    """

    def __init__(self, clock: Clock, piece: int, framer: Framer | None = None) -> None:
        self._arrived = _FrameQueue(clock, framer)
        self._piece = piece
        self._other: MemoryStream | None = None
        self._sent = 0

    @classmethod
    def pair(cls, clock: Clock, *, piece: int = 16, framer: Framer | None = None) -> tuple[MemoryStream, MemoryStream]:
        """Give both ends; `framer` of either, for what is not MAVLink."""
        one, other = cls(clock, piece, copy(framer)), cls(clock, piece, copy(framer))
        one._other, other._other = other, one
        return one, other

    def send(self, data: bytes) -> None:
        """Send bytes, frames or not; nothing once either end is closed."""
        if self._other is None:
            return
        self._sent += 1
        for start in range(0, len(data), self._piece):
            self._other._arrived.feed(data[start : start + self._piece])

    def receive(self) -> list[Received]:
        """Give the frames that have come since the last call."""
        return self._arrived.take()

    def statistics(self) -> TransportStatistics:
        """Give what has been counted."""
        return self._arrived.statistics(sent=self._sent)

    async def close(self) -> None:
        """Cut the stream."""
        if self._other is not None:
            self._other._other = None
            self._other = None
