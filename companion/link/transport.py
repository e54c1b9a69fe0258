"""What carries datagrams: UDP, and its twin in memory."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, cast

from companion.clock import Clock
from companion.errors import VehicleError
from companion.link.endpoints import UdpEndpoint

QUEUE = 2048  # datagrams that nobody takes; older ones are dropped
_PEER_TIMEOUT = 0.5  # [s] a peer that is silent for so long may be replaced by another one

Address = tuple[str, int]


class Received(NamedTuple):
    """One datagram."""

    t: float  # [s] arrival
    data: bytes


class Transport(Protocol):
    """Carries datagrams to one vehicle and back. The queue of what came in is bounded; the oldest is dropped."""

    def send(self, data: bytes) -> None:
        """Send one datagram; silently nothing while there is nobody to send to."""

    def receive(self) -> list[Received]:
        """Give what has come since the last call, in order."""

    async def close(self) -> None:
        """Stop; a second call does nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransportStatistics:
    """What a transport has counted."""

    received: int  # datagrams from the peer; frames of a stream
    sent: int
    dropped: int  # from the peer, that nobody took in time
    send_errors: int  # not sent: the socket or device did not take it
    strangers: int = 0  # datagrams from anyone who is not the peer
    skipped: int = 0  # bytes of a stream that belong to no frame
    reopened: int = 0  # times that a broken stream was opened again


class UdpTransport(asyncio.DatagramProtocol):
    """Listens on one UDP port and talks to one peer; it never speaks first.

    The peer is the first sender of a datagram that `recognises` accepts; answers go to it alone, and datagrams from
    anyone else are counted and dropped. When it has been silent for 0.5 s another one may take its place: PX4 sends
    hundreds of messages a second, and a router that restarts (voxl-vision-hub sends from a port of its own choosing)
    comes back from another port.

    Args:
        clock: stamps arrivals.
        recognises: tells whether a datagram comes from the vehicle; asked only of senders that are not the peer.
    """

    def __init__(self, clock: Clock, recognises: Callable[[bytes], bool]) -> None:
        self._clock = clock
        self._recognises = recognises
        self._queue: deque[Received] = deque()
        self._socket: asyncio.DatagramTransport | None = None
        self._closed = asyncio.Event()
        self._peer: Address | None = None
        self._t_peer = float("-inf")
        self._received = self._sent = self._dropped = self._strangers = self._send_errors = 0

    @classmethod
    async def open(cls, endpoint: UdpEndpoint, *, clock: Clock, recognises: Callable[[bytes], bool]) -> UdpTransport:
        """Bind the port.

        Raises:
            VehicleError: the port cannot be had.
        """
        loop = asyncio.get_running_loop()
        try:
            _, protocol = await loop.create_datagram_endpoint(
                lambda: cls(clock, recognises), local_addr=(endpoint.host, endpoint.port)
            )
        except OSError as error:
            reason = error.strerror or str(error)
            raise VehicleError(
                f"{endpoint}: cannot listen there ({reason}); "
                "stop the other program that uses the port, or choose an address of this machine and a free port"
            ) from error
        return protocol

    @property
    def peer(self) -> Address | None:
        """Whom it talks to."""
        return self._peer

    @property
    def local_port(self) -> int:
        """The port that it listens on."""
        if self._socket is None:
            raise VehicleError("the connection is closed; open it first")
        return int(self._socket.get_extra_info("sockname")[1])

    def send(self, data: bytes) -> None:
        """Send one datagram to the peer; nothing while there is none."""
        if self._socket is None or self._peer is None or self._socket.is_closing():
            return
        self._socket.sendto(data, self._peer)
        self._sent += 1

    def receive(self) -> list[Received]:
        """Give what has come from the peer since the last call."""
        received = list(self._queue)
        self._queue.clear()
        return received

    def statistics(self) -> TransportStatistics:
        """Give what has been counted."""
        return TransportStatistics(
            received=self._received,
            sent=self._sent,
            dropped=self._dropped,
            strangers=self._strangers,
            send_errors=self._send_errors,
        )

    async def close(self) -> None:
        """Close the port."""
        if self._socket is not None:
            self._socket.close()
            await self._closed.wait()
            self._socket = None

    # ---- asyncio's side

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the socket."""
        self._socket = cast(asyncio.DatagramTransport, transport)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Note that the socket is closed."""
        self._closed.set()

    def error_received(self, exc: Exception) -> None:  # noqa: ARG002 - asyncio's signature
        """Count an error of the socket, such as nobody listening at the peer."""
        self._send_errors += 1

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take a datagram from the peer; find the peer first."""
        t = self._clock.now()
        address = (addr[0], addr[1])
        if address != self._peer:
            if (self._peer is not None and t - self._t_peer < _PEER_TIMEOUT) or not self._recognises(data):
                self._strangers += 1
                return
            self._peer = address
        self._t_peer = t
        self._received += 1
        if len(self._queue) >= QUEUE:
            self._queue.popleft()
            self._dropped += 1
        self._queue.append(Received(t, data))


class MemoryTransport:
    """One end of a connection in memory: what one end sends, the other receives at once.

    The twin of UDP. An end that only listens sends nothing before it has received something, as UdpTransport does.
    """

    def __init__(self, clock: Clock, *, listens: bool) -> None:
        self._clock = clock
        self._listens = listens
        self._queue: deque[Received] = deque()
        self._other: MemoryTransport | None = None
        self._received = self._sent = self._dropped = 0

    @classmethod
    def pair(cls, clock: Clock, *, first_listens: bool = False) -> tuple[MemoryTransport, MemoryTransport]:
        """Give both ends; the first may be one that only listens until it has heard something."""
        one, other = cls(clock, listens=first_listens), cls(clock, listens=False)
        one._other, other._other = other, one
        return one, other

    def send(self, data: bytes) -> None:
        """Put one datagram into the other end's queue; nothing once either end is closed."""
        if self._other is None or (self._listens and not self._received):
            return
        self._sent += 1
        self._other._take(data)

    def _take(self, data: bytes) -> None:
        self._received += 1
        if len(self._queue) >= QUEUE:
            self._queue.popleft()
            self._dropped += 1
        self._queue.append(Received(self._clock.now(), data))

    def receive(self) -> list[Received]:
        """Give what has come since the last call."""
        received = list(self._queue)
        self._queue.clear()
        return received

    def statistics(self) -> TransportStatistics:
        """Give what has been counted."""
        return TransportStatistics(received=self._received, sent=self._sent, dropped=self._dropped, send_errors=0)

    async def close(self) -> None:
        """Cut the connection."""
        if self._other is not None:
            self._other._other = None
            self._other = None
