"""Byte streams to be opened: a TCP connection, a serial device. Both are a file descriptor that never blocks."""

from __future__ import annotations

import contextlib
import fcntl
import os
import socket
import termios
import tty
from typing import Protocol

from companion.link.endpoints import SerialEndpoint, TcpEndpoint

# TCP would keep setpoints for a peer that is slow and deliver them late; what is older than this is of no use.
_UNSENT_BYTES = 1024
_UNACKNOWLEDGED_MS = 1000


class Line(Protocol):
    """A byte stream, opened without waiting."""

    def begin(self) -> int:
        """Begin to open it; give its file descriptor.

        Raises:
            OSError: it cannot be opened.
        """

    def confirm(self) -> None:
        """Called when it can be written to for the first time.

        Raises:
            OSError: it could not be opened after all.
        """

    def end(self) -> None:
        """Close it; a second call does nothing."""


class TcpLine:
    """A TCP connection to one address."""

    def __init__(self, endpoint: TcpEndpoint) -> None:
        self._endpoint = endpoint
        self._socket: socket.socket | None = None

    def begin(self) -> int:
        """Begin to connect; raises OSError where that is impossible."""
        self.end()
        family = socket.AF_INET6 if ":" in self._endpoint.host else socket.AF_INET
        connection = socket.socket(family, socket.SOCK_STREAM)
        self._socket = connection
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT_BYTES)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNACKNOWLEDGED_MS)
        with contextlib.suppress(BlockingIOError):
            connection.connect((self._endpoint.host, self._endpoint.port))
        return connection.fileno()

    def confirm(self) -> None:
        """Raise the OSError with which connecting has ended, if any."""
        number = 0 if self._socket is None else self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if number:
            raise OSError(number, os.strerror(number))

    def end(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class SerialLine:
    """A serial device: 8 data bits, no parity, one stop bit, no flow control; for this program alone."""

    def __init__(self, endpoint: SerialEndpoint) -> None:
        self._endpoint = endpoint
        self._descriptor: int | None = None

    def begin(self) -> int:
        """Open the device and set it up; raises OSError where that is impossible."""
        self.end()
        descriptor = os.open(self._endpoint.device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        self._descriptor = descriptor
        try:
            fcntl.ioctl(descriptor, termios.TIOCEXCL)
            set_up_serial(descriptor, self._endpoint.baud)
        except (OSError, termios.error) as error:
            self.end()
            if isinstance(error, termios.error):
                raise OSError(*error.args[:2]) from None
            raise
        return descriptor

    def confirm(self) -> None:
        """A device that is open is ready."""

    def end(self) -> None:
        """Close the device."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def set_up_serial(descriptor: int, baud: int) -> None:
    """Make a terminal device a plain 8N1 line at `baud` [bit/s], and drop what had arrived before.

    Raises:
        OSError, termios.error: it is no serial device, or does not know the rate.
    """
    tty.setraw(descriptor, termios.TCSANOW)
    input_flags, output_flags, control, local, _, _, characters = termios.tcgetattr(descriptor)
    control &= ~(termios.CSTOPB | termios.CRTSCTS)
    control |= termios.CLOCAL | termios.CREAD
    speed = getattr(termios, f"B{baud}")
    attributes = [input_flags, output_flags, control, local, speed, speed, characters]
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
    termios.tcflush(descriptor, termios.TCIOFLUSH)
