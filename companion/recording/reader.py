"""Reads a recording, also one that ends in the middle because the program or the machine died."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Container, Iterator
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, Metadata
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from zstandard import ZstdError

from companion.documents.files import NO_SUCH_FILE, hint_for_missing
from companion.errors import RecordingError
from companion.recording.contents import RawRecord, Record, Recording

RECORD_LIMIT = 256 * 2**20  # [byte] no record of ours is larger; a damaged length field would be
_DAMAGE = (McapError, ZstdError, EOFError, ValueError, OverflowError, struct.error, MemoryError, KeyError)
_HEAD = struct.Struct("<BQ")  # opcode and length of every record
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


def read_recording(path: str | os.PathLike[str], channels: Container[str] | None = None) -> Recording:
    """Read a recording.

    A file that ends early, or is damaged from some byte on, gives everything before that and `complete` False.

    Args:
        path: the file.
        channels: read only these; None: all.

    Raises:
        RecordingError: there is no such file, it cannot be read, or it is no recording.
    """
    contents = _Contents(channels)
    for record in _records(os.fspath(path)):
        if isinstance(record, Chunk):
            try:
                contents.take_chunk(record)
            except _DAMAGE:
                break
        elif isinstance(record, Metadata):
            contents.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Footer):
            contents.complete = True
    return contents.recording()


class _Contents:
    """What has been read so far."""

    def __init__(self, wanted: Container[str] | None) -> None:
        self.metadata: dict[str, dict[str, str]] = {}
        self.complete = False
        self._wanted = wanted
        self._json: dict[int, list[Record]] = {}  # by channel id: those wanted
        self._raw: dict[int, list[RawRecord]] = {}
        self._names: dict[int, str] = {}

    def take_chunk(self, chunk: Chunk) -> None:
        """Take the channels and messages of one chunk (mcap's own reader makes an object of each: slow)."""
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        data = stream.read(length)
        position = 0
        while position < length:
            opcode, size = _HEAD.unpack_from(data, position)
            start = position + _HEAD.size
            position = start + size
            if opcode == Opcode.MESSAGE:
                self._take_message(data, start, position)
            elif opcode == Opcode.CHANNEL:
                self._take_channel(data[start:position])

    def recording(self) -> Recording:
        """Give it all, by the channels' names."""
        return Recording(
            metadata=self.metadata,
            messages={self._names[k]: tuple(records) for k, records in self._json.items() if records},
            raw={self._names[k]: tuple(records) for k, records in self._raw.items() if records},
            complete=self.complete,
        )

    def _take_channel(self, data: bytes) -> None:
        channel = Channel.read(ReadDataStream(BytesIO(data)))
        self._names[channel.id] = channel.topic
        if self._wanted is not None and channel.topic not in self._wanted:
            return
        if channel.message_encoding == "json":
            self._json.setdefault(channel.id, [])
        else:
            self._raw.setdefault(channel.id, [])

    def _take_message(self, data: bytes, start: int, end: int) -> None:
        channel, _, log_time, _ = _MESSAGE.unpack_from(data, start)
        payload = start + _MESSAGE.size
        if (records := self._json.get(channel)) is not None:
            records.append(Record(t=log_time / 1e9, data=json.loads(data[payload:end])))
        elif (raw := self._raw.get(channel)) is not None:
            raw.append(RawRecord(t=log_time / 1e9, data=data[payload:end]))


def _records(source: str) -> Iterator[Any]:
    try:
        with open(source, "rb") as file:
            if file.read(5) != b"\x89MCAP":
                raise RecordingError(f"{source}: this is not an MCAP recording; give a file that companion recorded")
            file.seek(0)
            try:
                yield from StreamReader(file, emit_chunks=True, record_size_limit=RECORD_LIMIT).records
            except _DAMAGE:
                return
    except FileNotFoundError:
        raise RecordingError(f"{source}: {NO_SUCH_FILE}; {hint_for_missing(source)}") from None
    except OSError as error:
        raise RecordingError(f"{source}: the recording cannot be read: {error.strerror}") from None
