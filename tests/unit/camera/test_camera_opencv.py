from __future__ import annotations

import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np
import pytest

from companion.camera.opencv import OpenCvCamera, OpenCvCameraParameters
from companion.camera.source import CameraFrozen, CameraRecovered, CameraStalled
from companion.camera.watch import WatchParameters
from companion.clock import MonotonicClock
from companion.errors import CameraError, CameraNotReadyError

WIDTH, HEIGHT = 64, 48


def picture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)


def camera(source, **changes) -> OpenCvCamera:
    fields = {"source": str(source), "width": WIDTH, "height": HEIGHT, "open_timeout": 5.0, "read_timeout": 0.6}
    return OpenCvCamera(OpenCvCameraParameters(**(fields | changes)), MonotonicClock())


def until(condition, limit=10.0):
    end = time.monotonic() + limit
    while not (result := condition()):
        assert time.monotonic() < end, "it did not come to pass"
        time.sleep(0.005)
    return result


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "a video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (WIDTH, HEIGHT))
    for k in range(20):
        writer.write(cv2.cvtColor(picture(k), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


class MjpegServer:
    """Serves pictures at 50 Hz over loopback; `mode` says what it does."""

    def __init__(self) -> None:
        self.mode = "live"
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                k = 0
                try:
                    while server.mode != "end":
                        k += 1
                        time.sleep(0.02)
                        if server.mode == "silent":
                            continue
                        image = picture(0 if server.mode == "frozen" else k)
                        data = cv2.imencode(".jpg", image)[1].tobytes()
                        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                        self.wfile.write(head.encode() + data + b"\r\n")
                except OSError:
                    return

            def log_message(self, *_):
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/camera.mjpg"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()

    def close(self) -> None:
        self.mode = "end"
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@pytest.fixture
def server():
    server = MjpegServer()
    yield server
    server.close()


class TestFile:
    def test_pictures_are_grey_numbered_and_stamped(self, video):
        source = camera(video, latency_s=0.03)
        source.start()
        frame = until(source.newest)
        assert frame.image.shape == (HEIGHT, WIDTH)
        assert frame.image.dtype == np.uint8
        assert frame.t_arrival - frame.t == pytest.approx(0.03)
        later = until(lambda: (new := source.newest()).sequence > frame.sequence and new)
        assert later.t > frame.t
        source.stop()
        source.stop()

    def test_the_end_of_the_video_is_a_stall_with_its_reason(self, video):
        source = camera(video)
        source.start()
        (event,) = until(source.events)
        assert isinstance(event, CameraStalled)
        assert event.reason == "the video has ended"
        assert source.newest().sequence == 19
        source.stop()


@pytest.mark.sitl
class TestStream:
    def test_frozen_and_silent_streams_are_noticed(self, server):
        source = camera(server.url, watch=WatchParameters(stall_timeout=0.4, frozen_timeout=0.3))
        source.start()
        first = until(source.newest)
        until(lambda: source.newest().sequence > first.sequence + 5)
        assert source.events() == []
        server.mode = "frozen"
        assert isinstance(until(source.events)[0], CameraFrozen)
        held = source.newest().sequence
        time.sleep(0.1)
        assert source.newest().sequence == held
        server.mode = "live"
        assert isinstance(until(source.events)[0], CameraRecovered)
        server.mode = "silent"
        assert isinstance(until(source.events)[0], CameraStalled)
        source.stop()

    def test_it_comes_back_after_the_server_cut_the_stream(self, server):
        source = camera(server.url)
        source.start()
        server.mode = "end"
        (event,) = until(source.events)
        assert isinstance(event, CameraStalled)
        assert event.reason
        before = source.newest().sequence
        server.mode = "live"
        assert isinstance(until(source.events)[0], CameraRecovered)
        assert until(lambda: source.newest().sequence > before)
        source.stop()


class TestRefusals:
    def refuse(self, source, *, kind=CameraError, **changes) -> str:
        with pytest.raises(CameraError) as caught:
            camera(source, **changes).start()
        assert caught.type is kind
        return str(caught.value)

    def test_missing_file(self, tmp_path):
        message = self.refuse(tmp_path / "none.avi")
        assert "No such file" in message
        assert "give an index, a device, a video file" in message

    def test_missing_device(self):
        assert "No such file" in self.refuse("/dev/video97", kind=CameraNotReadyError)

    def test_missing_index(self):
        assert "camera '97': cannot be opened" in self.refuse("97", kind=CameraNotReadyError, open_timeout=3.0)

    def test_directory(self, tmp_path):
        assert "that is a directory" in self.refuse(tmp_path)

    def test_no_video(self, tmp_path):
        path = tmp_path / "text.avi"
        path.write_text("not a video")
        message = self.refuse(path)
        assert "cannot be opened" in message or "no picture" in message

    def test_wrong_size(self, video):
        message = self.refuse(video, width=640, height=480)
        assert "gives pictures of 64x48, the configuration says 640x480" in message

    @pytest.mark.sitl
    def test_nobody_serves(self):
        message = self.refuse("http://127.0.0.1:9/camera.mjpg", kind=CameraNotReadyError, open_timeout=3.0)
        assert "check that the program that serves it runs" in message

    @pytest.mark.sitl
    def test_a_stream_without_pictures(self, server):
        server.mode = "silent"
        message = self.refuse(server.url, kind=CameraNotReadyError, open_timeout=1.0)
        assert "no picture" in message or "cannot be opened" in message
