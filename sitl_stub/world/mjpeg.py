"""The camera as a network camera: JPEG pictures over HTTP (multipart/x-mixed-replace) that `cv2.VideoCapture` opens."""

from __future__ import annotations

import asyncio
import contextlib

import cv2
import numpy as np
import numpy.typing as npt
from aiohttp import web

BOUNDARY = "frame"
PATHS = ("/", "/camera.mjpeg")
JPEG_QUALITY = 96
_END_TIMEOUT = 1.0  # [s] for streams to end when the server closes


class MjpegServer:
    """Serves the newest picture to any number of viewers on `PATHS`; a slow viewer skips pictures, it delays nobody.

    Each part carries the headers X-Sequence and, where known, X-Capture-Time: simulation time in seconds of the middle
    of the exposure. `port` 0 takes any free port, see `port` after `start`.
    """

    def __init__(self, port: int = 0, host: str = "127.0.0.1") -> None:
        self._host = host
        self._wanted_port = port
        self._viewers: set[asyncio.Queue[bytes | None]] = set()
        self._runner: web.AppRunner | None = None
        self._counted = 0
        self.port = port

    async def start(self) -> None:
        """Listen; raises `OSError` where the port is taken."""
        application = web.Application()
        for path in PATHS:
            application.router.add_get(path, self._stream)
        runner = web.AppRunner(application, access_log=None, shutdown_timeout=_END_TIMEOUT)
        await runner.setup()
        try:
            await web.TCPSite(runner, self._host, self._wanted_port).start()
        except OSError:
            await runner.cleanup()
            raise
        self._runner = runner
        self.port = int(runner.addresses[0][1])

    def publish(
        self, image: npt.NDArray[np.uint8], t_capture: float | None = None, sequence: int | None = None
    ) -> None:
        """Show a picture to all viewers. Nothing is encoded while nobody looks.

        Args:
            image: (height, width) grey.
            t_capture: [s] simulation time of the middle of the exposure.
            sequence: number of the exposure; None counts the pictures published.
        """
        number = self._counted if sequence is None else sequence
        self._counted += 1
        if not self._viewers:
            return
        encoded, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not encoded:
            raise ValueError(f"a picture of shape {image.shape} and type {image.dtype} cannot be encoded")
        body = data.tobytes()
        head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(body)}\r\nX-Sequence: {number}\r\n"
        if t_capture is not None:
            head += f"X-Capture-Time: {t_capture:.6f}\r\n"
        self._offer(head.encode("ascii") + b"\r\n" + body + b"\r\n")

    def _offer(self, part: bytes | None) -> None:
        for viewer in self._viewers:
            if viewer.full():
                viewer.get_nowait()
            viewer.put_nowait(part)

    async def _stream(self, request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse(
            headers={
                "Content-Type": f"multipart/x-mixed-replace; boundary={BOUNDARY}",
                "Cache-Control": "no-store",
                "Connection": "close",
            }
        )
        viewer: asyncio.Queue[bytes | None] = asyncio.Queue(maxsize=1)
        self._viewers.add(viewer)
        try:
            with contextlib.suppress(ConnectionError):
                await response.prepare(request)
                while (part := await viewer.get()) is not None:
                    await response.write(part)
                await response.write(f"--{BOUNDARY}--\r\n".encode("ascii"))
        finally:
            self._viewers.discard(viewer)
        return response

    async def close(self) -> None:
        """End all streams and stop listening."""
        self._offer(None)
        if self._runner is not None:
            await self._runner.cleanup()
            self._runner = None
