from __future__ import annotations

import asyncio
import os
import socket
from dataclasses import replace

import pytest
from test_ranging_decoder import SURVEY, packet

from companion.clock import ManualClock
from companion.errors import InputError, VehicleError
from companion.link.endpoints import SerialEndpoint, UdpEndpoint
from companion.link.stream_transport import MemoryStream
from companion.link.transport import MemoryTransport
from companion.ranging.decoder import RangingDecoder
from companion.ranging.lines import LineFramer, decode_line, plain_line
from companion.ranging.packet import decode_packet
from companion.ranging.parameters import RangingParameters
from companion.ranging.source import (
    RangesBack,
    RangesSilent,
    RangingRemark,
    RangingSource,
    open_ranging,
    parse_ranging_input,
)
from companion.ranging.wire import WireRange

PARAMETERS = RangingParameters(input="udp://127.0.0.1:14660", latency_s=0.0)


class Bench:
    """A source on a connection in memory, and the device at its other end."""

    def __init__(self) -> None:
        self.clock = ManualClock(10.0)
        self.device, ours = MemoryTransport.pair(self.clock)
        decoder = RangingDecoder(decode_packet, SURVEY, PARAMETERS)
        self.source = RangingSource(ours, decoder, PARAMETERS, self.clock.now())
        self._sequence = 0

    def send(self, *items: WireRange) -> None:
        self.device.send(packet(*items, sequence=self._sequence))
        self._sequence += 1

    def poll(self, t: float):
        self.clock.set(t)
        return self.source.poll(t)


def test_readings_come_in_order_and_once() -> None:
    bench = Bench()
    for k in range(3):
        bench.clock.set(10.0 + 0.1 * k)
        bench.send(WireRange(anchor=0x10, range=1.0 + k))
    assert [(round(r.t, 3), r.range) for r in bench.poll(10.3)] == [(10.0, 1.0), (10.1, 2.0), (10.2, 3.0)]
    assert bench.poll(10.4) == ()
    assert bench.source.events() == []


def test_silence_is_told_once_with_its_cause_and_so_is_its_end() -> None:
    bench = Bench()
    bench.poll(10.9)
    assert bench.source.events() == []
    for t in (11.0, 11.1, 12.0):
        bench.poll(t)
    (silent,) = bench.source.events()
    assert isinstance(silent, RangesSilent)
    assert str(silent).startswith("no ranges for 1.0 s: nothing comes")
    assert bench.source.silence(12.0) == pytest.approx(2.0)
    bench.send(WireRange(anchor=0x10, range=1.0))
    assert len(bench.poll(12.1)) == 1
    assert [type(event) for event in bench.source.events()] == [RangesBack]


@pytest.mark.parametrize(
    ("items", "word"),
    [([], "hears no anchor"), ([WireRange(anchor=0x10, range=0.0)], "zero, negative or too long")],
)
def test_messages_without_a_usable_range_are_silence_too(items, word) -> None:
    bench = Bench()
    for k in range(1, 15):
        bench.clock.set(10.0 + 0.1 * k)
        bench.send(*items)
        bench.poll(10.0 + 0.1 * k)
    (silent,) = bench.source.events()
    assert word in str(silent)


def test_remarks_of_the_decoder_become_events() -> None:
    bench = Bench()
    bench.send(WireRange(anchor=0x99, range=1.0))
    bench.poll(10.1)
    (remark,) = bench.source.events()
    assert isinstance(remark, RangingRemark)
    assert "0x0099" in str(remark)


def test_a_silent_dwm1001_is_told_to_print_and_a_talking_one_is_left_alone() -> None:
    clock = ManualClock(0.0)
    device, ours = MemoryStream.pair(clock, framer=LineFramer())
    parameters = replace(PARAMETERS, dwm1001_shell=True)
    source = RangingSource(ours, RangingDecoder(decode_line, SURVEY, parameters), parameters, 0.0)
    heard = []
    for k in range(100):
        clock.set(0.1 * k)
        source.poll(0.1 * k)
        heard += [(round(0.1 * k, 1), item.data) for item in device.receive()]
    assert [line for _, line in heard] == [b"lec", b"lec"]  # the two returns before it are no line
    assert heard[1][0] - heard[0][0] >= 5.0
    for k in range(100, 200):
        clock.set(0.1 * k)
        device.send(plain_line(0x10, 1500, 0) + b"\r\n")
        assert len(source.poll(0.1 * k)) == 1
        assert device.receive() == []


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("none", None),
        ("udp://0.0.0.0:14660", UdpEndpoint(host="0.0.0.0", port=14660)),
        ("serial:///dev/ttyUSB0?baud=115200", SerialEndpoint(device="/dev/ttyUSB0", baud=115200)),
    ],
)
def test_inputs_are_written_as_connections_are(text, endpoint) -> None:
    assert parse_ranging_input(text) == endpoint


@pytest.mark.parametrize("text", ["", "udp://0.0.0.0", "tcp://127.0.0.1", "serial:/dev/ttyUSB0:115200", "usb"])
def test_wrong_inputs_are_refused_with_what_would_be_right(text) -> None:
    with pytest.raises(InputError) as raised:
        parse_ranging_input(text)
    assert "udp://0.0.0.0:14660" in str(raised.value)


def test_the_udp_port_of_the_configuration_is_heard() -> None:
    async def scenario() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
            device.bind(("127.0.0.1", 0))
            port = device.getsockname()[1]
        clock = ManualClock(5.0)
        parameters = replace(PARAMETERS, input=f"udp://127.0.0.1:{port}")
        source = await open_ranging(parameters, SURVEY, clock)
        assert source is not None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
            for k, data in enumerate([b"stranger", packet(WireRange(anchor=0x20, range=2.25), sequence=0)]):
                device.sendto(data, ("127.0.0.1", port))
                async with asyncio.timeout(5.0):
                    while not (readings := source.poll(5.0)) and k:
                        await asyncio.sleep(0.001)
        assert [(r.t, r.anchor, r.range) for r in readings] == [(5.0, 1, 2.0)]
        with pytest.raises(VehicleError, match="cannot listen"):
            await open_ranging(parameters, SURVEY, clock)
        await source.close()
        assert await open_ranging(replace(parameters, input="none"), SURVEY, clock) is None

    asyncio.run(scenario())


@pytest.mark.sitl
def test_a_serial_line_is_heard() -> None:
    async def scenario() -> None:
        master, slave = os.openpty()
        parameters = replace(PARAMETERS, input=f"serial://{os.ttyname(slave)}?baud=115200")
        source = await open_ranging(parameters, SURVEY, ManualClock(5.0))
        assert source is not None
        os.write(master, b"dwm> DIST,1,AN0,0010,0.00,0.00,0.00,3.44\r\ngarbage\r\n")
        async with asyncio.timeout(5.0):
            while not (readings := source.poll(5.0)):
                await asyncio.sleep(0.001)
        assert [(r.anchor, r.range) for r in readings] == [(0, 3.44)]
        await source.close()
        os.close(master)
        os.close(slave)

    asyncio.run(scenario())
