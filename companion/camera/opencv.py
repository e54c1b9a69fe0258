"""A camera, a video file or a video stream, read with OpenCV on a thread of its own."""

from __future__ import annotations

import os
import re
import stat
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from companion.camera.source import CameraEvent
from companion.camera.watch import CameraWatch, WatchParameters
from companion.clock import Clock
from companion.errors import CameraError, CameraNotReadyError
from companion.geometry.arrays import Image
from companion.messages.perception import CameraFrame

_STREAM = re.compile(r"(https?|rtsp|udp|tcp)://.+")
_EVENTS_KEPT = 256
_RETRY_PAUSE = 0.02  # [s] after a failed read
_FAILURES_TO_REOPEN = 5  # in a row
_REOPEN_PAUSE = 0.5  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenCvCameraParameters:
    """Which camera, and how it behaves."""

    source: str = "0"  # index ("0"), device ("/dev/video0"), video file, or URL ("http://127.0.0.1:8080/camera")
    latency_s: Annotated[float, Ge(0.0)] = 0.040  # from the middle of the exposure to the arrival here
    width: Annotated[int, Gt(0)] = 640  # [px] expected: the calibration holds for this size only
    height: Annotated[int, Gt(0)] = 480  # [px]
    open_timeout: Annotated[float, Gt(0.0)] = 10.0  # [s] until the first picture
    read_timeout: Annotated[float, Gt(0.0)] = 2.0  # [s] a stream may be silent before its read gives up
    watch: WatchParameters = field(default_factory=WatchParameters)


class OpenCvCamera:
    """Opens a source with cv2.VideoCapture and keeps its newest picture.

    A capture stamp does not come through VideoCapture, so the middle of the exposure is taken as the arrival minus
    the configured latency. Frozen repetitions are not given out. In flight trouble is an event, never an exception.

    Args:
        parameters: which camera.
        clock: stamps arrivals.
    """

    def __init__(self, parameters: OpenCvCameraParameters, clock: Clock) -> None:
        self._parameters = parameters
        self._clock = clock
        self._changed = threading.Condition()
        self._stopping = False
        self._newest: CameraFrame | None = None
        self._first_size: tuple[int, int] | None = None  # height, width [px]
        self._failure: str | None = None  # why nothing (more) comes
        self._hopeless = False  # and nothing will
        self._sequence = 0
        self._events: list[CameraEvent] = []
        self._watch = CameraWatch(parameters.watch, clock.now())
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the camera and wait for its first picture; blocks up to the open timeout.

        Raises:
            CameraNotReadyError: a stream that is not served, a device that is not there, or one without pictures: a
                new object may succeed later.
            CameraError: another object would not do either: no such file, or pictures of another size.
        """
        _check_source(self._parameters.source)
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()
        with self._changed:
            self._changed.wait_for(
                lambda: self._first_size is not None or self._hopeless, self._parameters.open_timeout
            )
            size, failure = self._first_size, self._failure
        wanted = (self._parameters.height, self._parameters.width)
        if size == wanted:
            return
        self.stop()
        name = f"camera {self._parameters.source!r}"
        if size is not None:
            raise CameraError(
                f"{name} gives pictures of {size[1]}x{size[0]}, the configuration says {wanted[1]}x{wanted[0]}; "
                "set the size and the calibration that belong to this camera"
            )
        if failure is None:
            failure = f"no picture within {self._parameters.open_timeout:g} s"
        raise _missing(self._parameters.source)(f"{name}: {failure}; {_advice(self._parameters.source)}")

    def newest(self) -> CameraFrame | None:
        """Give the newest picture, or None while there is none; its sequence tells whether it is a new one."""
        with self._changed:
            return self._newest

    def events(self) -> list[CameraEvent]:
        """Give what has happened since the last call."""
        with self._changed:
            self._note(self._watch.look(self._clock.now(), self._failure or "no picture comes"))
            events, self._events = self._events, []
            return events

    def stop(self) -> None:
        """Let the camera go. A read that hangs is left to its thread, which ends with the program."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(self._parameters.read_timeout + 0.5)
            self._thread = None

    # ---- the reader's thread

    def _run(self) -> None:
        """Open and read; open anew when a camera that once worked has gone."""
        while not self._stopping:
            capture = cv2.VideoCapture()
            try:
                again = self._read_all(capture)
            except cv2.error as error:
                again = self._fail(f"OpenCV: {str(error.err or error).strip()}", hopeless=self._sequence == 0)
            finally:
                capture.release()
            if not again:
                return
            self._wait(_REOPEN_PAUSE)

    def _read_all(self, capture: cv2.VideoCapture) -> bool:
        """Read until it goes no further; give whether opening it anew may help."""
        if not _open(capture, self._parameters):
            return self._fail("cannot be opened", hopeless=self._sequence == 0)
        is_file = _is_video_file(self._parameters.source)
        rate = capture.get(cv2.CAP_PROP_FPS) if is_file else 0.0
        pause = 1.0 / rate if 1.0 <= rate <= 1000.0 else 0.0
        failures = 0
        while not self._stopping:
            good, image = capture.read()
            t = self._clock.now()
            if good and image is not None:
                failures = 0
                self._keep(_grey(image), t)
                self._wait(pause)
            elif is_file:
                text = "the video has ended" if self._sequence else "holds no picture that can be read"
                return self._fail(text, hopeless=True)
            else:
                failures += 1
                self._fail("the camera gives no picture", hopeless=False)
                if failures >= _FAILURES_TO_REOPEN:
                    return True
                self._wait(_RETRY_PAUSE)
        return False

    def _keep(self, image: Image, t: float) -> None:
        frame = CameraFrame(t=t - self._parameters.latency_s, t_arrival=t, sequence=self._sequence, image=image)
        self._sequence += 1
        right = image.shape == (self._parameters.height, self._parameters.width)
        with self._changed:
            self._failure = None if right else f"pictures of {image.shape[1]}x{image.shape[0]} come"
            if right:
                self._note(self._watch.arrived(image, t))
                if not self._watch.frozen:
                    self._newest = frame
            if self._first_size is None:
                self._first_size = (image.shape[0], image.shape[1])
                self._changed.notify_all()

    def _fail(self, reason: str, *, hopeless: bool) -> bool:
        """Note why no picture comes; give whether there is hope."""
        with self._changed:
            self._failure = reason
            self._hopeless = hopeless
            self._changed.notify_all()
        return not hopeless

    def _note(self, events: list[CameraEvent]) -> None:
        self._events += events
        del self._events[:-_EVENTS_KEPT]

    def _wait(self, duration: float) -> None:
        if duration > 0.0:
            with self._changed:
                self._changed.wait_for(lambda: self._stopping, duration)


def _check_source(source: str) -> None:
    """Find what is wrong with a source before OpenCV does, which says little."""
    if source.isdecimal() or _STREAM.fullmatch(source):
        return
    path = Path(source)
    try:
        mode = path.stat().st_mode
    except OSError as error:
        text = f"camera {source!r}: {error.strerror or 'cannot be found'}; {_advice(source)}"
        raise _missing(source)(text) from None
    if stat.S_ISDIR(mode):
        raise CameraError(f"camera {source!r}: that is a directory; {_advice(source)}")
    if not os.access(path, os.R_OK):
        raise CameraError(f"camera {source!r}: no permission to read it; run as a member of its group (often 'video')")


def _missing(source: str) -> type[CameraError]:
    """Give the kind of error of a source without pictures: a stream or a device may still come up, a file will not."""
    comes_up = source.isdecimal() or source.startswith("/dev/") or _STREAM.fullmatch(source) is not None
    return CameraNotReadyError if comes_up else CameraError


def _is_video_file(source: str) -> bool:
    return not source.isdecimal() and not _STREAM.fullmatch(source) and Path(source).is_file()


def _advice(source: str) -> str:
    """Say what would be right."""
    if _STREAM.fullmatch(source):
        return "check that the program that serves it runs, and the address"
    present = ", ".join(sorted(str(path) for path in Path("/dev").glob("video[0-9]*"))) or "none"
    return f"give an index, a device, a video file or an http address (devices here: {present})"


def _open(capture: cv2.VideoCapture, parameters: OpenCvCameraParameters) -> bool:
    source = parameters.source
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # its warnings say less than our message
    try:
        if source.isdecimal() or source.startswith("/dev/"):
            opened = capture.open(int(source)) if source.isdecimal() else capture.open(source, cv2.CAP_V4L2)
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, parameters.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, parameters.height)
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
            return opened
        if _STREAM.fullmatch(source):
            limits = [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
                round(parameters.open_timeout * 1e3),
                cv2.CAP_PROP_READ_TIMEOUT_MSEC,
                round(parameters.read_timeout * 1e3),
            ]
            return capture.open(source, cv2.CAP_FFMPEG, limits)
        return capture.open(source)
    finally:
        cv2.utils.logging.setLogLevel(level)


def _grey(image: NDArray[Any]) -> Image:
    """Give a grey picture (height, width) of a colour or grey one."""
    if image.ndim == 3:
        image = image[:, :, 0] if image.shape[2] == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(image, dtype=np.uint8)
