from __future__ import annotations

import asyncio
import socket

import pytest

from companion.clock import ManualClock
from companion.errors import InputError, VehicleError
from companion.link.transport import (
    MemoryTransport,
    UdpEndpoint,
    UdpTransport,
    open_transport,
    parse_endpoint,
)


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [
        ("udp://127.0.0.1:14540", "127.0.0.1", 14540),
        ("udp://localhost:14541", "127.0.0.1", 14541),
        ("udp://127.0.0.1", "127.0.0.1", 14540),
        ("udp://0.0.0.0:5000/", "0.0.0.0", 5000),
        ("udp://[::1]:14540", "::1", 14540),
    ],
)
def test_good_urls(url, host, port):
    assert parse_endpoint(url) == UdpEndpoint(host=host, port=port)
    assert parse_endpoint(str(parse_endpoint(url))) == parse_endpoint(url)


@pytest.mark.parametrize(
    ("url", "word"),
    [
        ("", "scheme"),
        ("127.0.0.1:14540", "scheme"),
        ("udp:14540", "scheme"),
        ("http://127.0.0.1:1", "unknown scheme"),
        ("serial:///dev/ttyHS1:921600", "not built in yet"),
        ("tcp://127.0.0.1:5760", "not built in yet"),
        ("udp://:14540", "address is missing"),
        ("udp://drone.local:14540", "not an IP address"),
        ("udp://127.0.0.1:port", "not a port"),
        ("udp://127.0.0.1:0", "not a port"),
        ("udp://127.0.0.1:70000", "not a port"),
        ("udp://127.0.0.1:\u0661", "not a port"),
        ("udp://127.0.0.1:2:3", "not a"),
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
