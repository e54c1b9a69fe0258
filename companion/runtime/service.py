"""Tell systemd that the program is up and alive: sd_notify's protocol, one datagram on a local socket."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping


class ServiceNotifier:
    """Sends readiness, status and watchdog kicks; does nothing where no service manager listens.

    Nothing here blocks or raises: a service manager that does not listen must not disturb the flight.

    Args:
        environment: holds NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID where systemd started the program.
        process_id: of this process; a watchdog that is meant for another one is left alone.
    """

    def __init__(self, environment: Mapping[str, str], process_id: int) -> None:
        self._address = _address(environment.get("NOTIFY_SOCKET", ""))
        self.watchdog_timeout = _watchdog_timeout(environment, process_id) if self._address else None
        self._next_kick = float("-inf")
        self._socket: socket.socket | None = None
        self.failures = 0  # datagrams that could not be sent
        if self._address is not None:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)

    @classmethod
    def from_environment(cls) -> ServiceNotifier:
        """Build it from this process's environment."""
        return cls(os.environ, os.getpid())

    def ready(self, status: str) -> None:
        """Start-up is over."""
        self._send(f"READY=1\nSTATUS={_one_line(status)}")

    def status(self, text: str) -> None:
        """Give one plain line for `systemctl status`."""
        self._send(f"STATUS={_one_line(text)}")

    def tick(self, t: float) -> None:
        """Kick the watchdog, at most four times in its timeout; to be called by each guardian tick at `t` [s]."""
        if self.watchdog_timeout is None or t < self._next_kick:
            return
        self._next_kick = t + 0.25 * self.watchdog_timeout
        self._send("WATCHDOG=1")

    def stopping(self, status: str) -> None:
        """The program is about to end, in good order."""
        self._send(f"STOPPING=1\nSTATUS={_one_line(status)}")

    def close(self) -> None:
        """Close the socket; a second call does nothing."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is None or self._address is None:
            return
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError:
            self.failures += 1


def _address(name: str) -> str | None:
    """Give the socket's address; a leading @ stands for the abstract namespace."""
    if name.startswith("@"):
        return "\0" + name[1:]
    return name if name.startswith("/") else None


def _watchdog_timeout(environment: Mapping[str, str], process_id: int) -> float | None:
    """Give the watchdog's timeout [s], or None where there is none for this process."""
    microseconds = environment.get("WATCHDOG_USEC", "")
    owner = environment.get("WATCHDOG_PID", str(process_id))
    if not microseconds.isdecimal() or int(microseconds) == 0 or owner != str(process_id):
        return None
    return int(microseconds) * 1e-6


def _one_line(text: str) -> str:
    return " ".join(text.split())
