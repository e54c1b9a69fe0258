"""Records to an MCAP file that survives a crash and is the same, bit for bit, for the same calls.

Chunks are at most 64 KiB (a single larger message has one of its own) and cover less than 0.5 s, so a killed program
loses half a second; `companion.recording.reader` reads what remains. Nothing in the file comes from a clock, a random
number or the machine: equal calls give equal bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from companion.recording.chunked_writer import MESSAGE_OVERHEAD, ChunkedWriter
from companion.recording.schemas import channel_schema
from companion.recording.serialise import encode_json
from companion.recording.sink import BackgroundSink, FileSink, Sink

CHUNK_BYTES = 64 * 1024  # [byte] largest uncompressed chunk
CHUNK_SPAN = 0.5  # [s] longest span of one chunk
LIBRARY = "companion"  # fixed: the version stands in the metadata
ROOM_OVERHEAD = MESSAGE_OVERHEAD + 300  # [byte] with the records of a new channel and its schema, payloads apart
RAW_ENCODING = "application/octet-stream"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderState:
    """How a recording fares."""

    recorded: int  # messages taken
    dropped: int  # messages lost: after a failure, while the disk stalled, or impossible to write
    problem: str | None  # the first thing that went wrong; None while all is well


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
        self._writer = ChunkedWriter(self._sink, library=LIBRARY)
        self._channels: dict[str, int] = {}
        self._chunk_start: float | None = None  # [s] time of the first message of the open chunk
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
        for name, values in metadata.items():
            self._writer.add_metadata(name, {str(key): str(value) for key, value in values.items()})
        self._sink.flush()

    def _record_json(self, channel: str, t: float, data: Mapping[str, object]) -> None:
        time_ns = _nanoseconds(t)
        payload = encode_json(data)
        known = self._channels.get(channel)
        schema = channel_schema(channel, data) if known is None else b""
        self._make_room(t, len(payload) + len(schema))
        if known is None:
            number = self._writer.add_schema(channel, "jsonschema", schema)
            known = self._channels[channel] = self._writer.add_channel(channel, "json", number)
        self._writer.add_message(known, time_ns, payload)
        self._recorded += 1

    def _record_raw(self, channel: str, t: float, data: bytes) -> None:
        time_ns = _nanoseconds(t)
        self._make_room(t, len(data))
        known = self._channels.get(channel)
        if known is None:
            known = self._channels[channel] = self._writer.add_channel(channel, RAW_ENCODING, 0)
        self._writer.add_message(known, time_ns, data)
        self._recorded += 1

    def _make_room(self, t: float, size: int) -> None:
        """Finish the chunk if this message would make it too long or too large."""
        start = self._chunk_start
        if start is None:
            self._chunk_start = t
        elif abs(t - start) >= CHUNK_SPAN or self._writer.chunk_bytes + size + ROOM_OVERHEAD > CHUNK_BYTES:
            self._writer.finish_chunk()
            self._chunk_start = t


def _nanoseconds(t: float) -> int:
    if not 0.0 <= t < 1.8e10:
        raise ValueError(f"the time {t} s cannot be written; it must be finite and not negative")
    return round(t * 1e9)
