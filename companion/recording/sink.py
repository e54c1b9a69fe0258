"""Where a recording's bytes go: straight into a file, or through a thread that owns the file.

In flight a slow or stalled disk must not hold up the control loop: the thread takes finished chunks from a bounded
queue, and the recorder drops messages while the queue is full. A sink remembers the first error and ignores what
follows it; it never raises after it has been opened.
"""

from __future__ import annotations

import os
import queue
import shutil
import threading
from io import BufferedWriter
from typing import Protocol

from companion.errors import RecordingError

RESERVE_BYTES = 64 * 2**20  # [byte] free space that a recording leaves on the disk
CHECK_EVERY_BYTES = 2**20  # [byte] written between two looks at the free space
QUEUE_LENGTH = 64  # finished chunks that may wait: 32 s of a normal flight
CLOSE_TIMEOUT = 5.0  # [s] a stalled disk may hold up the end of the program this long
_END = None


class Sink(Protocol):
    """A stream of bytes that is only appended to."""

    @property
    def problem(self) -> str | None:
        """What stopped it, in plain words; None while all is well."""

    @property
    def full(self) -> bool:
        """Whether more would have to wait."""

    def write(self, data: bytes) -> int:
        """Append bytes."""

    def tell(self) -> int:
        """Give the number of bytes appended so far."""

    def flush(self) -> None:
        """Hand everything to the operating system."""

    def close(self) -> None:
        """Finish."""


class FileSink:
    """Writes in the caller's thread: for simulation, where waiting is harmless.

    Raises:
        RecordingError: the file cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = os.fspath(path)
        self._file = _open(self._path)
        self._position = 0
        self._checked = -CHECK_EVERY_BYTES
        self._problem: str | None = None

    @property
    def problem(self) -> str | None:
        """What stopped it; None while all is well."""
        return self._problem

    @property
    def full(self) -> bool:
        """Whether more would have to wait: never."""
        return False

    def write(self, data: bytes) -> int:
        """Append bytes, unless something stopped it before."""
        self._position += len(data)
        if self._problem is None:
            try:
                self._check_space()
                self._file.write(data)
            except (OSError, ValueError) as error:
                self._fail(error)
        return len(data)

    def tell(self) -> int:
        """Give the number of bytes appended so far."""
        return self._position

    def flush(self) -> None:
        """Hand everything to the operating system."""
        if self._problem is None:
            try:
                self._file.flush()
            except (OSError, ValueError) as error:
                self._fail(error)

    def close(self) -> None:
        """Close the file; what the disk still holds back is lost, not raised."""
        try:
            self._file.close()
        except (OSError, ValueError) as error:
            self._fail(error)

    def _check_space(self) -> None:
        if self._position - self._checked < CHECK_EVERY_BYTES:
            return
        self._checked = self._position
        free = shutil.disk_usage(os.path.dirname(self._path) or ".").free
        if free < RESERVE_BYTES:
            raise OSError(f"only {free // 2**20} MB are free, {RESERVE_BYTES // 2**20} MB are kept for the system")

    def _fail(self, error: Exception) -> None:
        if self._problem is None:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._problem = f"{self._path}: {reason}"


class BackgroundSink:
    """Writes in a thread of its own: for flight.

    Raises:
        RecordingError: the file cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str], *, queue_length: int = QUEUE_LENGTH) -> None:
        self._file = FileSink(path)
        self._pending = bytearray()
        self._position = 0
        self._queue: queue.Queue[bytes | None] = queue.Queue(maxsize=queue_length)
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @property
    def problem(self) -> str | None:
        """What stopped it; None while all is well."""
        return self._file.problem

    @property
    def full(self) -> bool:
        """Whether the disk has not kept up: the recorder then drops whole messages, so the file stays readable."""
        return self._queue.full()

    def write(self, data: bytes) -> int:
        """Append bytes; they are on their way after `flush`."""
        self._pending += data
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        """Give the number of bytes appended so far."""
        return self._position

    def flush(self) -> None:
        """Pass everything to the thread, or keep it for the next time while the queue is full."""
        if not self._pending:
            return
        try:
            self._queue.put_nowait(bytes(self._pending))
        except queue.Full:
            return
        self._pending.clear()

    def close(self) -> None:
        """Let the thread finish, but not longer than the time allowed."""
        for item in (bytes(self._pending), _END):
            try:
                self._queue.put(item, timeout=CLOSE_TIMEOUT)
            except queue.Full:
                return
        self._pending.clear()
        self._thread.join(timeout=CLOSE_TIMEOUT)

    def _run(self) -> None:
        while (data := self._queue.get()) is not _END:
            self._file.write(data)
            self._file.flush()
        self._file.close()


def _open(path: str) -> BufferedWriter:
    try:
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
        return open(path, "wb")
    except OSError as error:
        raise RecordingError(
            f"{path}: the recording cannot be made: {error.strerror}; give a directory that may be written to"
        ) from None
