"""Cut datagrams into MAVLink frames.

Nothing survives from one datagram to the next, so a damaged one costs only itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from fastcrc import crc16

_V1, _V2 = 0xFE, 0xFD
_MAGICS = (_V1, _V2)
_V1_OVERHEAD, _V2_OVERHEAD, _SIGNATURE = 8, 12, 13
_SIGNED = 0x01
_SOURCES_KEPT = 16


class Frame(NamedTuple):
    """One frame from the vehicle whose checksum is right."""

    message_id: int
    payload: bytes  # trailing zeros may have been cut by the sender


class FrameReader:
    """Finds the frames of one sender in datagrams, and counts everything else.

    Frames of messages that nobody wants are skipped by their header, without the cost of the checksum.
    PX4 signs every frame, without a key too.

    Args:
        wanted: message id to its CRC_EXTRA.
        system: system id of the vehicle.
        component: component id of its autopilot.
        believes: tells of a whole frame of the vehicle, and whether it is signed, whether it may be believed; None:
            signatures are not checked. It is asked before anything is taken from the frame.
    """

    def __init__(
        self,
        wanted: Mapping[int, int],
        *,
        system: int,
        component: int,
        believes: Callable[[bytes, bool], bool] | None = None,
    ) -> None:
        self._wanted = {message_id: bytes((extra,)) for message_id, extra in wanted.items()}
        self._system = system
        self._component = component
        self._believes = believes
        self._sequence: int | None = None
        self.frames = 0  # from the vehicle, wanted or not
        self.lost = 0  # gaps in the vehicle's sequence numbers
        self.foreign = 0  # from anyone else
        self.unbelieved = 0  # said to be from the vehicle, with no signature or a wrong one
        self.bad_bytes = 0  # bytes that belong to no frame
        self.foreign_sources: dict[tuple[int, int], int] = {}  # (system, component) to frames; the first few only

    def read(self, datagram: bytes) -> list[Frame]:
        """Give the wanted frames of the vehicle in one datagram, in order. Never raises."""
        found: list[Frame] = []
        position, size = 0, len(datagram)
        while position < size:
            end = self._frame_at(datagram, position, size, found)
            if end == 0:
                self.bad_bytes += 1
                position += 1
            else:
                position = end
        return found

    def _frame_at(self, data: bytes, start: int, size: int, found: list[Frame]) -> int:
        """Take the frame that begins at `start`; give where it ends, or 0 where there is none."""
        magic = data[start]
        if magic == _V2 and size - start >= _V2_OVERHEAD:
            flags = data[start + 2]
            if flags & ~_SIGNED:
                return 0
            body = start + 10
            message_id = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
            sequence, source = data[start + 4], (data[start + 5], data[start + 6])
            end = start + _V2_OVERHEAD + data[start + 1] + (_SIGNATURE if flags else 0)
        elif magic == _V1 and size - start >= _V1_OVERHEAD:
            body = start + 6
            message_id, sequence, source = data[start + 5], data[start + 2], (data[start + 3], data[start + 4])
            end = start + _V1_OVERHEAD + data[start + 1]
        else:
            return 0
        if end > size:
            return 0
        extra = self._wanted.get(message_id)
        if extra is None:
            if end != size and data[end] not in _MAGICS:
                return 0
        else:
            tail = body + data[start + 1]
            if crc16.mcrf4xx(data[start + 1 : tail] + extra) != data[tail] | data[tail + 1] << 8:
                return 0
        if source != (self._system, self._component):
            self._count_foreign(source)
            return end
        if self._believes is not None and not self._believes(data[start:end], magic == _V2 and data[start + 2] != 0):
            self.unbelieved += 1
            return end
        self._count_own(sequence)
        if extra is not None:
            found.append(Frame(message_id, data[body : body + data[start + 1]]))
        return end

    def _count_own(self, sequence: int) -> None:
        self.frames += 1
        if self._sequence is not None:
            gap = (sequence - self._sequence - 1) & 0xFF
            if gap < 128:  # more is a late frame or a restart
                self.lost += gap
        self._sequence = sequence

    def add_foreign(self, other: FrameReader) -> None:
        """Add the foreign frames that another reader has counted."""
        for source, count in other.foreign_sources.items():
            self._count_foreign(source, count)

    def _count_foreign(self, source: tuple[int, int], count: int = 1) -> None:
        self.foreign += count
        if source in self.foreign_sources or len(self.foreign_sources) < _SOURCES_KEPT:
            self.foreign_sources[source] = self.foreign_sources.get(source, 0) + count
