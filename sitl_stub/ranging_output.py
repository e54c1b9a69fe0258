"""Sends the packets of the simulated ranging radio to a port on loopback."""

import contextlib
import socket
from collections.abc import Iterable

HOST = "127.0.0.1"
PORT = 14660
"""Where a companion that is configured for the simulator listens."""


class RangingOutput:
    """One UDP socket that only sends.

    Args:
        port: on loopback, on which the companion listens.
    """

    def __init__(self, port: int = PORT) -> None:
        self._peer = (HOST, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, packets: Iterable[bytes]) -> None:
        """Send packets; what nobody takes is lost, as on the air."""
        for packet in packets:
            with contextlib.suppress(OSError):
                self._socket.sendto(packet, self._peer)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
