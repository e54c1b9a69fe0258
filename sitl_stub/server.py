"""The simulator in real time: MAVLink over UDP on loopback, the camera as MJPEG over HTTP."""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
import numpy.typing as npt

from sitl_stub.ranging_output import PORT, RangingOutput
from sitl_stub.simulation import STEP, Simulation
from sitl_stub.vehicle.mavlink_io import PORTS, Port

HOST = "127.0.0.1"
BEHIND_MAX = 0.25
"""When the simulation falls behind the clock by more than this [s] it gives up the lost time: it runs slower."""


class Video(Protocol):
    """Where camera pictures go."""

    def publish(
        self, image: npt.NDArray[np.uint8], t_capture: float | None = None, sequence: int | None = None
    ) -> None:
        """Offer the newest picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerPorts:
    """UDP ports on which the companion and the ground station listen."""

    onboard: int = 14540
    ground: int = 14550
    ranging: int = PORT


class UdpLink(asyncio.DatagramProtocol):
    """One socket of the autopilot: sends to a fixed port on loopback, takes what comes from loopback."""

    def __init__(self, peer: int, receive: Callable[[bytes], None]) -> None:
        self._peer = (HOST, peer)
        self._receive = receive
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the socket."""
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002
        """Hand a datagram to the autopilot."""
        self._receive(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens yet: telemetry is sent all the same, as PX4 does."""

    def send(self, datagrams: list[bytes]) -> None:
        """Send datagrams."""
        transport = self._transport
        if transport is not None and not transport.is_closing():
            for datagram in datagrams:
                transport.sendto(datagram, self._peer)

    def close(self) -> None:
        """Close the socket."""
        if self._transport is not None:
            self._transport.close()


class Server:
    """Runs a simulation against the event loop's monotonic clock."""

    def __init__(self, simulation: Simulation, ports: ServerPorts, video: Video | None = None) -> None:
        self.simulation = simulation
        self._ports = ports
        self._video = video
        self._links: dict[Port, UdpLink] = {}
        self._ranging = RangingOutput(ports.ranging)
        self.lost_time = 0.0
        """Wall time [s] that the simulation could not keep up with."""

    async def run(self, stop: asyncio.Event, duration: float | None = None) -> None:
        """Run until `stop` is set, or for `duration` seconds of simulation time."""
        loop = asyncio.get_running_loop()
        peers: dict[Port, int] = {"onboard": self._ports.onboard, "ground": self._ports.ground}
        for port in PORTS:
            _, link = await loop.create_datagram_endpoint(
                lambda port=port: UdpLink(peers[port], lambda data: self._received(port, data)),  # type: ignore[misc]
                local_addr=(HOST, 0),
            )
            self._links[port] = link
        try:
            await self._tick(loop, stop, duration)
        finally:
            for link in self._links.values():
                link.close()
            self._ranging.close()

    async def _tick(self, loop: asyncio.AbstractEventLoop, stop: asyncio.Event, duration: float | None) -> None:
        simulation = self.simulation
        start = loop.time() - simulation.t
        while not stop.is_set() and (duration is None or simulation.t < duration):
            behind = loop.time() - start - simulation.t
            if behind > BEHIND_MAX:
                start += behind
                self.lost_time += behind
            simulation.advance(loop.time() - start)
            self._flush()
            self._ranging.send(simulation.ranges())
            for frame in simulation.frames():
                if self._video is not None and frame.image is not None:
                    self._video.publish(frame.image, frame.t_capture, frame.sequence)
            pause = max(0.0, start + simulation.t + STEP - loop.time())
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), pause + 1e-4)

    def _received(self, port: Port, data: bytes) -> None:
        self.simulation.receive(port, data)
        self._links[port].send(self.simulation.transmit(port))

    def _flush(self) -> None:
        for port, link in self._links.items():
            link.send(self.simulation.transmit(port))
