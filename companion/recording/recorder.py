"""What a recorder is, and the two that keep nothing on disk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from companion.recording.contents import RawRecord, Record, Recording


class Recorder(Protocol):
    """Takes what happens, with the time it happened at. Never raises, never blocks the caller for long."""

    def record(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        """Keep one message.

        Args:
            channel: its channel; the keys of one channel's messages stay the same.
            t: time [s] of the companion's clock.
            data: plain values (numbers, text, booleans, None, and lists and mappings of them); see
                `companion.recording.serialise.to_record`.
        """

    def record_bytes(self, channel: str, t: float, data: bytes) -> None:
        """Keep bytes as they are: a MAVLink frame, an encoded picture."""

    def close(self) -> None:
        """Finish the recording. Later calls are ignored."""


class NullRecorder:
    """Keeps nothing."""

    def record(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        """Ignore a message."""

    def record_bytes(self, channel: str, t: float, data: bytes) -> None:
        """Ignore bytes."""

    def close(self) -> None:
        """Do nothing."""


class MemoryRecorder:
    """Keeps everything in memory: for tests, and for flights that are looked at as soon as they end."""

    def __init__(self, metadata: Mapping[str, Mapping[str, str]] | None = None) -> None:
        self._metadata = {name: dict(values) for name, values in (metadata or {}).items()}
        self._messages: dict[str, list[Record]] = {}
        self._raw: dict[str, list[RawRecord]] = {}
        self._closed = False

    def record(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        """Keep one message."""
        if not self._closed:
            self._messages.setdefault(channel, []).append(Record(t=t, data=dict(data)))

    def record_bytes(self, channel: str, t: float, data: bytes) -> None:
        """Keep bytes."""
        if not self._closed:
            self._raw.setdefault(channel, []).append(RawRecord(t=t, data=bytes(data)))

    def close(self) -> None:
        """Take no more."""
        self._closed = True

    def recording(self) -> Recording:
        """Give what has been recorded so far."""
        return Recording(
            metadata={name: dict(values) for name, values in self._metadata.items()},
            messages={channel: tuple(records) for channel, records in self._messages.items()},
            raw={channel: tuple(records) for channel, records in self._raw.items()},
            complete=True,
        )
