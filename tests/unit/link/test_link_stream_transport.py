from __future__ import annotations

import asyncio
import os
import socket
import termios

import pytest
from link_fake_autopilot import FakeAutopilot

from companion.clock import ManualClock
from companion.errors import VehicleError
from companion.link.connect import open_transport
from companion.link.lines import set_up_serial
from companion.link.stream_transport import MemoryStream, StreamTransport

pytestmark = pytest.mark.sitl


async def until(condition) -> None:
    async with asyncio.timeout(5.0):
        while not condition():
            await asyncio.sleep(0.001)


async def opened(url: str, clock: ManualClock) -> StreamTransport:
    transport = await open_transport(url, clock=clock, recognises=lambda _: False)
    assert isinstance(transport, StreamTransport)
    return transport


class Listener:
    """A TCP server with one connection at a time."""

    def __init__(self, port: int = 0) -> None:
        self.socket = socket.create_server(("127.0.0.1", port))
        self.socket.settimeout(2.0)
        self.port = self.socket.getsockname()[1]

    def accept(self) -> socket.socket:
        connection, _ = self.socket.accept()
        connection.settimeout(2.0)
        return connection


def test_tcp_carries_frames_both_ways_and_stamps_their_arrival():
    async def scenario() -> None:
        listener, clock = Listener(), ManualClock(7.0)
        with listener.socket:
            transport = await opened(f"tcp://127.0.0.1:{listener.port}", clock)
            with listener.accept() as vehicle:
                frames = [FakeAutopilot().heartbeat() for _ in range(3)]
                stream = b"\x00garbage" + b"".join(frames)
                vehicle.sendall(stream[:30])
                vehicle.sendall(stream[30:])
                await until(lambda: transport.statistics().received == 3)
                assert [(item.t, item.data) for item in transport.receive()] == [(7.0, frame) for frame in frames]
                assert transport.statistics().skipped == 8
                transport.send(b"answer")
                assert vehicle.recv(100) == b"answer"
            await transport.close()
            await transport.close()
            transport.send(b"after the end")

    asyncio.run(scenario())


def test_tcp_is_opened_again_where_it_breaks_off():
    async def scenario() -> None:
        listener = Listener()
        with listener.socket:
            transport = await opened(f"tcp://127.0.0.1:{listener.port}", ManualClock())
            beat = FakeAutopilot().heartbeat()
            with listener.accept() as vehicle:
                vehicle.sendall(beat[:9])  # half a frame, which must not spoil the next connection
                await until(lambda: transport.connected)
            await until(lambda: not transport.connected)
            transport.send(b"to nobody")
            await until(lambda: transport.connected)
            with listener.accept() as vehicle:
                vehicle.sendall(beat)
                await until(lambda: transport.statistics().received == 1)
            assert transport.statistics().reopened == 1
            await transport.close()

    asyncio.run(scenario())


def test_a_peer_that_does_not_read_gets_no_old_setpoints_later():
    async def scenario() -> None:
        listener = Listener()
        with listener.socket:
            transport = await opened(f"tcp://127.0.0.1:{listener.port}", ManualClock())
            with listener.accept() as vehicle:
                frame = bytes(1000)
                for _ in range(20000):
                    transport.send(frame)
                    await asyncio.sleep(0.0)
                statistics = transport.statistics()
                assert statistics.send_errors > 0
                kept = statistics.sent * len(frame)
                vehicle.setblocking(False)
                arrived = 0
                async with asyncio.timeout(5.0):
                    while arrived < kept:  # whole frames only: what was begun is finished
                        try:
                            arrived += len(vehicle.recv(1 << 20))
                        except BlockingIOError:
                            await asyncio.sleep(0.001)
                assert arrived == kept
            await transport.close()

    asyncio.run(scenario())


@pytest.mark.parametrize("kind", ["tcp", "nothing", "file"])
def test_what_cannot_be_opened_is_a_plain_error(kind, tmp_path):
    async def scenario() -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        (tmp_path / "file").touch()
        url = {
            "tcp": f"tcp://127.0.0.1:{port}",
            "nothing": f"serial://{tmp_path}/nothing",
            "file": f"serial://{tmp_path}/file",
        }[kind]
        with pytest.raises(VehicleError, match=r"cannot be opened .*; check"):
            await opened(url, ManualClock())

    asyncio.run(scenario())


def test_serial_carries_frames_both_ways():
    async def scenario() -> None:
        autopilot_side, device_side = os.openpty()
        try:
            clock = ManualClock(3.0)
            transport = await opened(f"serial://{os.ttyname(device_side)}?baud=921600", clock)
            frames = [FakeAutopilot().odometry(101.0 + k) for k in range(4)]
            stream = b"\n\r\x11\x13" + b"".join(frames)  # nothing of it is translated or taken as flow control
            for start in range(0, len(stream), 50):
                os.write(autopilot_side, stream[start : start + 50])
            await until(lambda: transport.statistics().received == 4)
            assert [(item.t, item.data) for item in transport.receive()] == [(3.0, frame) for frame in frames]
            transport.send(b"\x03\x04answer\n")
            await until(lambda: True)
            assert os.read(autopilot_side, 100) == b"\x03\x04answer\n"
            await transport.close()
        finally:
            os.close(autopilot_side)
            os.close(device_side)

    asyncio.run(scenario())


def test_a_serial_line_is_8n1_at_the_rate_asked_for():
    autopilot_side, device_side = os.openpty()
    try:
        set_up_serial(device_side, 460800)
        _, output, control, local, speed_in, speed_out, _ = termios.tcgetattr(device_side)
        assert (speed_in, speed_out) == (termios.B460800, termios.B460800)
        assert control & termios.CSIZE == termios.CS8
        assert not control & (termios.PARENB | termios.CSTOPB | termios.CRTSCTS)
        assert not local & (termios.ICANON | termios.ECHO | termios.ISIG)
        assert not output & termios.OPOST
    finally:
        os.close(autopilot_side)
        os.close(device_side)


def test_a_serial_device_that_is_pulled_out_breaks_the_line_and_nothing_else():
    async def scenario() -> None:
        autopilot_side, device_side = os.openpty()
        transport = await opened(f"serial://{os.ttyname(device_side)}", ManualClock())
        os.close(device_side)
        os.close(autopilot_side)
        await until(lambda: not transport.connected)
        transport.send(b"into the void")
        assert transport.receive() == []
        await transport.close()

    asyncio.run(scenario())


def test_memory_twin_cuts_frames_as_a_stream_does():
    clock = ManualClock(5.0)
    one, other = MemoryStream.pair(clock, piece=7)
    frames = [FakeAutopilot().odometry(101.0 + k) for k in range(3)]
    one.send(b"noise")
    for frame in frames:
        one.send(frame)
    assert [(item.t, item.data) for item in other.receive()] == [(5.0, frame) for frame in frames]
    assert other.receive() == []
    assert other.statistics().skipped == 5
    asyncio.run(other.close())
    one.send(frames[0])
    assert other.receive() == []
    assert one.statistics().sent == 4
