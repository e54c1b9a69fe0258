"""Open the transport that a connection URL names."""

from __future__ import annotations

from collections.abc import Callable

from companion.clock import Clock
from companion.link.endpoints import UdpEndpoint, parse_endpoint
from companion.link.stream_transport import StreamTransport
from companion.link.transport import Transport, UdpTransport


async def open_transport(
    url: str, *, clock: Clock, recognises: Callable[[bytes], bool], source: str = "--connect"
) -> Transport:
    """Open the transport that a connection URL names.

    Args:
        url: see `parse_endpoint`.
        clock: stamps arrivals.
        recognises: tells whether a datagram comes from the vehicle; a stream has only one other end.
        source: where the URL stands, for the error message.

    Raises:
        InputError: the URL is wrong.
        VehicleError: it cannot be opened.
    """
    endpoint = parse_endpoint(url, source=source)
    if isinstance(endpoint, UdpEndpoint):
        return await UdpTransport.open(endpoint, clock=clock, recognises=recognises)
    return await StreamTransport.open(endpoint, clock=clock)
