"""Datagrams to a ground station's own address. Nothing is read: a ground station commands over the autopilot."""

from __future__ import annotations

import socket

from companion.errors import InputError, VehicleError
from companion.link.endpoints import UdpEndpoint, parse_endpoint


def parse_ground_station(url: str, *, source: str = "link.ground_station") -> UdpEndpoint:
    """Read the URL of a ground station, `udp://ADDRESS:PORT`: the address to send to.

    Args:
        url: the text.
        source: where it stands, for the error message.

    Raises:
        InputError: it is not such a URL.
    """
    endpoint = parse_endpoint(url, source=source)
    if isinstance(endpoint, UdpEndpoint):
        return endpoint
    raise InputError.single(
        source=source,
        wrong=f"{url!r}: a ground station of its own is reached over UDP only",
        right="write it as udp://192.168.1.10:14550, or leave it out: the autopilot forwards to its ground stations",
    )


class GroundStationSender:
    """Sends to one address; an address that nobody listens at costs nothing and is counted.

    Args:
        endpoint: of the ground station.

    Raises:
        VehicleError: this machine has no way to that address.
    """

    def __init__(self, endpoint: UdpEndpoint) -> None:
        family = socket.AF_INET6 if ":" in endpoint.host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.sent = 0
        self.errors = 0
        try:
            self._socket.connect((endpoint.host, endpoint.port))
        except OSError as error:
            self._socket.close()
            raise VehicleError(
                f"{endpoint}: no way to the ground station ({error.strerror or error}); "
                "correct link.ground_station, or leave it out: the autopilot forwards to its ground stations"
            ) from error

    def send(self, data: bytes) -> None:
        """Send one datagram, or drop it where it cannot go now."""
        try:
            self._socket.send(data)
            self.sent += 1
        except OSError:
            self.errors += 1

    def close(self) -> None:
        """Close the socket; a second call does nothing."""
        self._socket.close()
