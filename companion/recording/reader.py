"""Reads a recording, also one that ends in the middle because the program or the machine died."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Footer, Message, Metadata
from mcap.stream_reader import StreamReader
from zstandard import ZstdError

from companion.errors import RecordingError
from companion.recording.contents import RawRecord, Record, Recording

RECORD_LIMIT = 256 * 2**20  # [byte] no record of ours is larger; a damaged length field would be
_DAMAGE = (McapError, ZstdError, EOFError, ValueError, struct.error, MemoryError, KeyError)


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Read a whole recording.

    A file that ends early, or is damaged from some byte on, gives everything before that and `complete` False.

    Raises:
        RecordingError: there is no such file, it cannot be read, or it is no recording.
    """
    source = os.fspath(path)
    metadata: dict[str, dict[str, str]] = {}
    channels: dict[int, Channel] = {}
    messages: dict[str, list[Record]] = {}
    raw: dict[str, list[RawRecord]] = {}
    complete = False
    for record in _records(source):
        if isinstance(record, Message):
            try:
                _take(record, channels, messages, raw)
            except (ValueError, KeyError):  # damage that left the outer structure intact
                break
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Metadata):
            metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Footer):
            complete = True
    return Recording(
        metadata=metadata,
        messages={name: tuple(records) for name, records in messages.items()},
        raw={name: tuple(records) for name, records in raw.items()},
        complete=complete,
    )


def _records(source: str) -> Iterator[Any]:
    try:
        with open(source, "rb") as file:
            if file.read(5) != b"\x89MCAP":
                raise RecordingError(f"{source}: this is not an MCAP recording; give a file that companion recorded")
            file.seek(0)
            try:
                yield from StreamReader(file, validate_crcs=True, record_size_limit=RECORD_LIMIT).records
            except _DAMAGE:
                return
    except OSError as error:
        raise RecordingError(f"{source}: the recording cannot be read: {error.strerror}") from None


def _take(
    message: Message,
    channels: dict[int, Channel],
    messages: dict[str, list[Record]],
    raw: dict[str, list[RawRecord]],
) -> None:
    channel = channels[message.channel_id]
    t = message.log_time / 1e9
    if channel.message_encoding == "json":
        messages.setdefault(channel.topic, []).append(Record(t=t, data=json.loads(message.data)))
    else:
        raw.setdefault(channel.topic, []).append(RawRecord(t=t, data=message.data))
