"""Cut a byte stream (serial, TCP) into MAVLink frames.

A stream has no datagrams: frames may come in pieces, and garbage may stand between them. What comes out is one frame
each, as a datagram would hold it, so everything behind is the same for every transport.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from fastcrc import crc16
from pymavlink.dialects.v20 import common as mavlink

from companion.link import incoming

_V1, _V2 = 0xFE, 0xFD
_SIGNED = 0x01
_V1_HEADER, _V2_HEADER, _CHECKSUM, _SIGNATURE = 6, 10, 2, 13
LONGEST_FRAME = _V2_HEADER + 255 + _CHECKSUM + _SIGNATURE

_EXTRAS = {message_id: bytes((m.crc_extra,)) for message_id, m in mavlink.mavlink_map.items()}
_EXTRAS |= {message_id: bytes((extra,)) for message_id, extra in incoming.WANTED.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class FramingStatistics:
    """What a framer has counted."""

    frames: int
    skipped: int  # bytes that belong to no frame


class Framer(Protocol):
    """Cuts a byte stream into the frames of one protocol."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; give the frames that they complete, in order. Never raises."""

    def forget(self) -> None:
        """Drop a frame that has begun: the stream was broken off."""

    def statistics(self) -> FramingStatistics:
        """Give what has been counted."""


class StreamFramer:
    """Finds the frames in a byte stream.

    A frame whose message is known counts if its checksum is right; an unknown one if another frame begins right behind
    it. After anything else the search goes on with the next byte, so a false beginning never hides a good frame. Never
    more than one frame's length is kept from one call to the next.
    """

    def __init__(self) -> None:
        self._buffer = b""
        self._frames = 0
        self._skipped = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; give the frames that they complete, in order. Never raises."""
        buffer = self._buffer + data if self._buffer else data
        frames: list[bytes] = []
        start, size = 0, len(buffer)
        while start < size:
            length = _length(buffer, start)
            if length is None:  # the header is not complete yet
                break
            end = start + length
            verdict = _sound(buffer, start, end) if length else False
            if verdict is None:
                break
            if verdict:
                frames.append(buffer[start:end])
                start = end
            else:
                self._skipped += 1
                start += 1
        self._buffer = buffer[start:]
        self._frames += len(frames)
        return frames

    def forget(self) -> None:
        """Drop a frame that has begun: the stream was broken off."""
        self._skipped += len(self._buffer)
        self._buffer = b""

    @property
    def pending(self) -> int:
        """Bytes kept for the next call; at most LONGEST_FRAME."""
        return len(self._buffer)

    def statistics(self) -> FramingStatistics:
        """Give what has been counted."""
        return FramingStatistics(frames=self._frames, skipped=self._skipped)


def _length(buffer: bytes, start: int) -> int | None:
    """Give the length of the frame that begins at `start`: 0 where none begins, None where more bytes must tell."""
    magic, rest = buffer[start], len(buffer) - start
    if magic == _V1:
        return _V1_HEADER + buffer[start + 1] + _CHECKSUM if rest > 1 else None
    if magic != _V2:
        return 0
    if rest < 3:
        return None
    flags = buffer[start + 2]
    if flags & ~_SIGNED:
        return 0
    return _V2_HEADER + buffer[start + 1] + _CHECKSUM + (_SIGNATURE if flags else 0)


def _sound(buffer: bytes, start: int, end: int) -> bool | None:
    """Tell whether the bytes are a frame; None where more bytes must tell."""
    if end > len(buffer):
        return None
    if buffer[start] == _V1:
        message_id, body = buffer[start + 5], start + _V1_HEADER
    else:
        message_id = int.from_bytes(buffer[start + 7 : start + 10], "little")
        body = start + _V2_HEADER
    extra = _EXTRAS.get(message_id)
    if extra is None:
        return None if end == len(buffer) else buffer[end] in (_V1, _V2)
    tail = body + buffer[start + 1]
    return bool(crc16.mcrf4xx(buffer[start + 1 : tail] + extra) == buffer[tail] | buffer[tail + 1] << 8)
