"""The UDP port on which an autopilot is heard: datagrams with the time at which they arrived."""

import asyncio
import socket
import struct
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

SO_TIMESTAMPNS = 35
"""Linux: the kernel adds its time of arrival to each datagram; Python's socket module has no name for it."""
BUFFER = 4 << 20
"""Bytes that may wait while a picture is made: some seconds of telemetry."""
DATAGRAM = 4096

Address = tuple[str, int]


def parse_url(url: str) -> Address:
    """Split `udp://ADDRESS:PORT`; raises `ValueError` that says what would be right."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if parts.scheme != "udp" or not host or not port or parts.path not in ("", "/"):
        raise ValueError(f"{url!r} is no address: write udp://ADDRESS:PORT, for example udp://127.0.0.1:14550")
    return host, port


class AutopilotPort:
    """A UDP socket that listens where the autopilot sends to, and answers whoever is heard there.

    Times of arrival are the kernel's [s, Unix]: a program that was busy reads late, but does not stamp late. Only their
    differences mean anything. Where the kernel gives none, the time of reading is taken.
    """

    def __init__(self, address: Address) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
            self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            self._socket.setblocking(False)
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            reason = error.strerror or error
            raise OSError(
                f"cannot listen on udp {address[0]}:{address[1]} ({reason}): is a ground station open?"
            ) from error
        self._ready = asyncio.Event()

    @property
    def address(self) -> Address:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    async def wait(self, timeout: float) -> None:
        """Wait until something has arrived, at most `timeout` [s]."""
        loop = asyncio.get_running_loop()
        self._ready.clear()
        loop.add_reader(self._socket, self._ready.set)
        timer = loop.call_later(timeout, self._ready.set)
        try:
            await self._ready.wait()
        finally:
            timer.cancel()
            loop.remove_reader(self._socket)

    def receive(self) -> Iterator[tuple[float, bytes, Address]]:
        """Give what has arrived: time of arrival [s], datagram, sender."""
        while True:
            try:
                data, extra, _, sender = self._socket.recvmsg(DATAGRAM, socket.CMSG_SPACE(16))
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # an answer of ours found nobody: the autopilot is away
            yield _arrival(extra), data, sender

    def send(self, datagram: bytes, address: Address) -> None:
        """Send one datagram; an autopilot that is away is no error."""
        try:
            self._socket.sendto(datagram, address)
        except (BlockingIOError, ConnectionError):
            return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def clock() -> float:
    """The clock of the arrival times [s]."""
    return time.clock_gettime(time.CLOCK_REALTIME)


def _arrival(extra: list[tuple[int, int, bytes]]) -> float:
    for level, kind, data in extra:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(data) >= 16:
            seconds, nanoseconds = struct.unpack("qq", data[:16])
            return float(seconds + nanoseconds * 1e-9)
    return clock()
