from __future__ import annotations

import asyncio
import socket

import pytest

from companion.clock import ManualClock
from companion.errors import InputError, VehicleError
from companion.link.connect import open_transport
from companion.link.endpoints import SerialEndpoint, TcpEndpoint, UdpEndpoint, parse_endpoint
from companion.link.transport import MemoryTransport, UdpTransport


@pytest.mark.parametrize(
    ("url", "endpoint"),
    [
        ("udp://127.0.0.1:14540", UdpEndpoint(host="127.0.0.1", port=14540)),
        ("udp://localhost:14541", UdpEndpoint(host="127.0.0.1", port=14541)),
        ("udp://127.0.0.1", UdpEndpoint(host="127.0.0.1", port=14540)),
        ("udp://0.0.0.0:5000/", UdpEndpoint(host="0.0.0.0", port=5000)),
        ("udp://[::1]:14540", UdpEndpoint(host="::1", port=14540)),
        ("tcp://10.41.1.1:5760", TcpEndpoint(host="10.41.1.1", port=5760)),
        ("tcp://localhost", TcpEndpoint(host="127.0.0.1", port=5760)),
        ("serial:///dev/ttyHS1", SerialEndpoint(device="/dev/ttyHS1", baud=921600)),
        ("serial:///dev/serial/by-id/x?baud=57600", SerialEndpoint(device="/dev/serial/by-id/x", baud=57600)),
    ],
)
def test_good_urls(url, endpoint):
    assert parse_endpoint(url) == endpoint
    assert parse_endpoint(str(endpoint)) == endpoint


@pytest.mark.parametrize(
    ("url", "word"),
    [
        ("", "scheme"),
        ("127.0.0.1:14540", "scheme"),
        ("udp:14540", "scheme"),
        ("http://127.0.0.1:1", "unknown scheme"),
        ("udp://:14540", "address is missing"),
        ("udp://drone.local:14540", "not an IP address"),
        ("tcp://drone.local:5760", "not an IP address"),
        ("udp://127.0.0.1:port", "not a port"),
        ("udp://127.0.0.1:0", "not a port"),
        ("tcp://127.0.0.1:70000", "not a port"),
        ("udp://127.0.0.1:\u0661", "not a port"),
        ("udp://127.0.0.1:2:3", "not a"),
        ("serial://", "device is missing"),
        ("serial://ttyHS1", "is no device"),
        ("serial:///dev/ttyHS1:921600", "no rate stands there"),
        ("serial:///dev/ttyHS1?baud=921", "not a rate"),
        ("serial:///dev/ttyHS1?baud=", "not a rate"),
        ("serial:///dev/ttyHS1?speed=921600", "unknown option speed"),
        ("serial:///dev/ttyHS1?921600", "unknown option"),
    ],
)
def test_bad_urls_say_what_is_wrong_and_what_is_right(url, word):
    with pytest.raises(InputError) as caught:
        parse_endpoint(url, source="config.yaml")
    (problem,) = caught.value.problems
    assert word in problem.wrong
    assert problem.source == "config.yaml"
    assert problem.right


def sender() -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    one.settimeout(2.0)
    return one


async def until(condition) -> None:
    async with asyncio.timeout(5.0):
        while not condition():
            await asyncio.sleep(0.001)


async def open_any(clock: ManualClock) -> UdpTransport:
    # Port 0 takes a free one; the URL itself never gives 0.
    endpoint = UdpEndpoint(host="127.0.0.1", port=0)
    return await UdpTransport.open(endpoint, clock=clock, recognises=lambda data: data.startswith(b"ok"))


@pytest.mark.sitl
def test_udp_talks_to_one_peer_only():
    async def scenario() -> None:
        clock = ManualClock(10.0)
        transport = await open_any(clock)
        target = ("127.0.0.1", transport.local_port)
        with sender() as vehicle, sender() as stranger:
            transport.send(b"to nobody")
            stranger.sendto(b"noise", target)
            await until(lambda: transport.statistics().strangers == 1)
            assert transport.peer is None
            vehicle.sendto(b"ok 1", target)
            await until(lambda: transport.peer == vehicle.getsockname())
            stranger.sendto(b"ok, I am the vehicle", target)
            await until(lambda: transport.statistics().strangers == 2)
            assert [(item.t, item.data) for item in transport.receive()] == [(10.0, b"ok 1")]
            assert transport.receive() == []
            transport.send(b"answer")
            assert vehicle.recv(100) == b"answer"
            clock.set(14.0)  # the vehicle has been silent for 4 s: another one may come
            stranger.sendto(b"ok 2", target)
            await until(lambda: transport.peer == stranger.getsockname())
            assert transport.statistics().sent == 1
        await transport.close()
        await transport.close()
        transport.send(b"after the end")

    asyncio.run(scenario())


@pytest.mark.sitl
def test_udp_queue_is_bounded_and_keeps_the_newest():
    async def scenario() -> None:
        transport = await open_any(ManualClock(0.0))
        for k in range(3000):
            transport.datagram_received(b"ok%d" % k, ("127.0.0.1", 9))
        received = transport.receive()
        assert len(received) == 2048
        assert received[-1].data == b"ok2999"
        assert transport.statistics().dropped == 3000 - 2048
        await transport.close()

    asyncio.run(scenario())


@pytest.mark.sitl
def test_a_taken_port_is_a_plain_error():
    async def scenario() -> None:
        with sender() as other:
            port = other.getsockname()[1]
            with pytest.raises(VehicleError, match="stop the other program"):
                await open_transport(f"udp://127.0.0.1:{port}", clock=ManualClock(), recognises=lambda _: True)

    asyncio.run(scenario())


def test_memory_twin():
    clock = ManualClock(3.0)
    one, other = MemoryTransport.pair(clock)
    one.send(b"a")
    clock.set(4.0)
    one.send(b"b")
    assert [(item.t, item.data) for item in other.receive()] == [(3.0, b"a"), (4.0, b"b")]
    assert other.receive() == []
    assert one.receive() == []
    asyncio.run(other.close())
    one.send(b"into the void")
    assert other.receive() == []
    assert one.statistics().sent == 2


@pytest.mark.sitl
def test_a_router_that_comes_back_from_another_port_is_found_again_at_once():
    """The local link of a VOXL 2: voxl-vision-hub sends from a port of its own choosing, and first."""

    async def scenario() -> None:
        clock = ManualClock(10.0)
        transport = await open_any(clock)
        target = ("127.0.0.1", transport.local_port)
        transport.send(b"nobody is there")
        assert transport.statistics().sent == 0
        with sender() as hub:
            hub.sendto(b"ok 1", target)
            await until(lambda: transport.peer == hub.getsockname())
        clock.set(10.6)
        with sender() as restarted:
            restarted.sendto(b"ok 2", target)
            await until(lambda: transport.peer == restarted.getsockname())
            transport.send(b"answer")
            assert restarted.recv(100) == b"answer"
        await transport.close()

    asyncio.run(scenario())


def test_the_twin_of_an_end_that_only_listens_never_speaks_first():
    one, vehicle = MemoryTransport.pair(ManualClock(), first_listens=True)
    one.send(b"too early")
    assert vehicle.receive() == []
    vehicle.send(b"telemetry")
    one.send(b"answer")
    assert [item.data for item in vehicle.receive()] == [b"answer"]


def test_the_queue_of_the_twin_is_bounded_too():
    one, other = MemoryTransport.pair(ManualClock())
    for k in range(3000):
        one.send(b"%d" % k)
    received = other.receive()
    assert len(received) == 2048
    assert received[-1].data == b"2999"
    assert other.statistics().dropped == 3000 - 2048
