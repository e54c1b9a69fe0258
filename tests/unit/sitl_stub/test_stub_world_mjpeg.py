"""The network camera: what OpenCV reads, and what stands in the parts' headers."""

from __future__ import annotations

import asyncio
import threading

import aiohttp
import cv2
import numpy as np
import pytest

from sitl_stub.world.mjpeg import MjpegServer


def picture(value: int) -> np.ndarray:
    image = np.full((480, 640), value, dtype=np.uint8)
    image[100:200, 300:400] = 255 - value
    return image


def test_opencv_reads_the_stream() -> None:
    frames: list[np.ndarray] = []

    async def serve() -> None:
        server = MjpegServer()
        await server.start()
        done = threading.Event()

        def watch() -> None:
            capture = cv2.VideoCapture(f"http://127.0.0.1:{server.port}/camera.mjpeg")
            try:
                while len(frames) < 3:
                    good, image = capture.read()
                    if not good:
                        break
                    frames.append(image[..., 0])
            finally:
                capture.release()
                done.set()

        watcher = threading.Thread(target=watch)
        watcher.start()
        for number in range(600):
            if done.is_set():
                break
            server.publish(picture(60), number / 30.0, number)
            await asyncio.sleep(0.01)
        await server.close()
        await asyncio.to_thread(watcher.join)

    asyncio.run(serve())
    assert len(frames) == 3
    assert np.abs(frames[-1].astype(int) - picture(60)).mean() < 1.0


def test_parts_carry_time_and_sequence_and_closing_ends_the_stream() -> None:
    async def run() -> bytes:
        server = MjpegServer()
        await server.start()
        async with aiohttp.ClientSession() as session, session.get(f"http://127.0.0.1:{server.port}/") as response:
            server.publish(picture(10), 1.25, 7)
            first = await response.content.readuntil(b"\r\n\r\n")
            await server.close()
            rest = await response.content.read()
        assert rest.endswith(b"--frame--\r\n")
        return first

    head = asyncio.run(run()).decode()
    assert "X-Capture-Time: 1.250000" in head
    assert "X-Sequence: 7" in head
    assert "Content-Type: image/jpeg" in head


def test_a_slow_viewer_gets_the_newest_picture() -> None:
    async def run() -> list[str]:
        server = MjpegServer()
        await server.start()
        seen = []
        async with aiohttp.ClientSession() as session, session.get(f"http://127.0.0.1:{server.port}/") as response:
            for number in range(5):  # without giving the viewer a chance to run
                server.publish(picture(10), float(number), number)
            for _ in range(1):
                seen.append((await response.content.readuntil(b"\r\n\r\n")).decode())
            await server.close()
        return seen

    assert "X-Sequence: 4" in asyncio.run(run())[0]


def test_a_taken_port_is_refused() -> None:
    async def run() -> None:
        first = MjpegServer()
        await first.start()
        second = MjpegServer(first.port)
        try:
            with pytest.raises(OSError, match="in use"):
                await second.start()
        finally:
            await second.close()
            await first.close()

    asyncio.run(run())
