"""Records to an MCAP file that survives a crash and is the same, bit for bit, for the same calls.

Chunks are at most 64 KiB (a single larger message has one of its own) and cover less than 0.5 s, so a killed program
loses half a second; `companion.recording.reader` reads what remains. Nothing in the file comes from a clock, a random
number or the machine: equal calls give equal bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import IO, Any, cast

from mcap.writer import CompressionType, Writer

from companion.recording.schemas import channel_schema
from companion.recording.serialise import encode_json
from companion.recording.sink import BackgroundSink, FileSink, Sink

CHUNK_BYTES = 64 * 1024  # [byte] largest uncompressed chunk
CHUNK_SPAN = 0.5  # [s] longest span of one chunk
LIBRARY = "companion"  # fixed: the version stands in the metadata
MESSAGE_OVERHEAD = 31  # [byte] opcode, length, channel, sequence and two times of an MCAP message
RAW_ENCODING = "application/octet-stream"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderState:
    """How a recording fares."""

    recorded: int  # messages taken
    dropped: int  # messages lost: after a failure, while the disk stalled, or impossible to write
    problem: str | None  # the first thing that went wrong; None while all is well


@dataclass(slots=True)
class _Channel:
    id: int
    count: int = 0


class McapRecorder:
    """Writes one file. After it has been made it never raises: it stops, counts what is lost and says why, once.

    Args:
        path: the file; its directory is made, an older file is replaced.
        metadata: blocks of texts kept with the flight: configuration in effect, mission, seed, version.
        background: write in a thread (flight) rather than in the caller's (simulation).

    Raises:
        RecordingError: the file cannot be made.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        *,
        background: bool = False,
    ) -> None:
        self._sink: Sink = BackgroundSink(path) if background else FileSink(path)
        self._writer: Any = Writer(
            cast("IO[bytes]", self._sink), chunk_size=2**31, compression=CompressionType.ZSTD, enable_data_crcs=False
        )
        self._channels: dict[str, _Channel] = {}
        self._chunk_start: float | None = None  # [s] time of the first message of the open chunk
        self._chunk_bytes = 0
        self._recorded = 0
        self._dropped = 0
        self._problem: str | None = None
        self._told = False
        self._stopped = False
        self._closed = False
        self._guard(self._begin, metadata or {})

    @property
    def state(self) -> RecorderState:
        """How the recording fares."""
        return RecorderState(
            recorded=self._recorded, dropped=self._dropped, problem=self._problem or self._sink.problem
        )

    def take_problem(self) -> str | None:
        """Give the first thing that went wrong, once; None before and afterwards."""
        problem = self.state.problem
        if problem is None or self._told:
            return None
        self._told = True
        return problem

    def record(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        """Keep one message; see `Recorder.record`."""
        self._guard(self._record_json, channel, t, data, message=True)

    def record_bytes(self, channel: str, t: float, data: bytes) -> None:
        """Keep bytes as they are."""
        self._guard(self._record_raw, channel, t, data, message=True)

    def close(self) -> None:
        """Write the index and close the file."""
        if self._closed:
            return
        self._guard(self._writer.finish)
        self._closed = True
        self._sink.close()

    def _guard(self, action: Callable[..., None], *arguments: object, message: bool = False) -> None:
        """Run one action. A flight must not end because its recording does, so every error ends here."""
        if self._closed or self._stopped or self._sink.problem is not None or (message and self._sink.full):
            self._dropped += message
            return
        try:
            action(*arguments)
        except (TypeError, ValueError, OverflowError, RecursionError, UnicodeError) as error:
            self._dropped += message
            self._problem = self._problem or f"{arguments[0] if message else 'recording'}: {error}"
        except Exception as error:
            self._dropped += message
            self._stopped = True
            self._problem = self._problem or f"the recording stopped: {type(error).__name__}: {error}"

    def _begin(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        self._writer.start(profile="", library=LIBRARY)
        for name, values in metadata.items():
            self._writer.add_metadata(name, {str(key): str(value) for key, value in values.items()})
        self._sink.flush()

    def _record_json(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        time_ns = _nanoseconds(t)
        payload = encode_json(data)
        self._make_room(t, len(payload))
        known = self._channels.get(channel)
        if known is None:
            schema = channel_schema(channel, data)
            schema_id = self._writer.register_schema(name=channel, encoding="jsonschema", data=schema)
            known = self._register(channel, "json", schema_id)
            self._chunk_bytes += len(schema) + len(channel) + 64
        self._append(known, time_ns, payload)

    def _record_raw(self, channel: str, t: float, data: bytes) -> None:
        time_ns = _nanoseconds(t)
        self._make_room(t, len(data))
        known = self._channels.get(channel)
        if known is None:
            known = self._register(channel, RAW_ENCODING, 0)
            self._chunk_bytes += len(channel) + 64
        self._append(known, time_ns, data)

    def _register(self, channel: str, encoding: str, schema_id: int) -> _Channel:
        identity = self._writer.register_channel(topic=channel, message_encoding=encoding, schema_id=schema_id)
        self._channels[channel] = made = _Channel(identity)
        return made

    def _make_room(self, t: float, size: int) -> None:
        """Finish the chunk if this message would make it too long or too large."""
        start = self._chunk_start
        if start is None:
            self._chunk_start = t
            return
        if abs(t - start) >= CHUNK_SPAN or self._chunk_bytes + size + MESSAGE_OVERHEAD > CHUNK_BYTES:
            self._writer.flush()
            self._chunk_start, self._chunk_bytes = t, 0

    def _append(self, channel: _Channel, time_ns: int, payload: bytes) -> None:
        self._writer.add_message(channel.id, time_ns, payload, time_ns, channel.count)
        channel.count += 1
        self._chunk_bytes += len(payload) + MESSAGE_OVERHEAD
        self._recorded += 1


def _nanoseconds(t: float) -> int:
    if not 0.0 <= t < 1.8e10:
        raise ValueError(f"the time {t} s cannot be written; it must be finite and not negative")
    return round(t * 1e9)
