"""Writes the MCAP format, over the records of the `mcap` package.

The package's own writer keeps an object with a dictionary for each chunk, 5 MB in ten minutes of flight, and makes an
object of each message. Here the index is kept packed, as it will stand in the file, and messages are packed straight
into the chunk. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from companion.recording.sink import Sink

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_OVERHEAD = 31  # [byte] of a message besides its payload
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_FOOTER_HEAD = struct.Struct("<BQQQ")  # opcode, length, start of the summary, start of its offsets
_FOOTER_LENGTH = 20


class ChunkedWriter:
    """Writes one file, in the order of the calls.

    Args:
        sink: takes the bytes.
        library: name of the writer, as kept in the file.
    """

    def __init__(self, sink: Sink, *, library: str) -> None:
        self._sink = sink
        self._chunk = bytearray()
        self._chunk_times: dict[int, list[tuple[int, int]]] = {}  # channel -> (log time, offset) of its messages
        self._schemas = bytearray()
        self._channels = bytearray()
        self._chunk_indices = bytearray()
        self._metadata_indices = bytearray()
        self._counts: dict[int, int] = {}  # messages of each channel
        self._schema_count = self._chunk_count = self._metadata_count = 0
        self._start: int | None = None  # [ns] earliest log time
        self._end = 0  # [ns] latest log time
        self._sink.write(MAGIC + _packed(Header(profile="", library=library)))

    @property
    def chunk_bytes(self) -> int:
        """Size [byte] of the chunk in progress."""
        return len(self._chunk)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a block of texts."""
        offset = self._sink.tell()
        data = _packed(Metadata(name=name, metadata=dict(values)))
        self._sink.write(data)
        self._metadata_indices += _packed(MetadataIndex(offset=offset, length=len(data), name=name))
        self._metadata_count += 1

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema; give its number."""
        self._schema_count += 1
        record = _packed(Schema(id=self._schema_count, name=name, encoding=encoding, data=data))
        self._schemas += record
        self._chunk += record
        return self._schema_count

    def add_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Add a channel; give its number. `schema`: number of its schema, 0 for none."""
        number = len(self._counts) + 1
        self._counts[number] = 0
        record = _packed(Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema))
        self._channels += record
        self._chunk += record
        return number

    def add_message(self, channel: int, time_ns: int, data: bytes) -> None:
        """Add a message to the chunk in progress."""
        sequence = self._counts[channel]
        head = _MESSAGE.pack(Opcode.MESSAGE, _MESSAGE.size - 9 + len(data), channel, sequence, time_ns, time_ns)
        self._counts[channel] = sequence + 1
        self._chunk_times.setdefault(channel, []).append((time_ns, len(self._chunk)))
        self._chunk += head
        self._chunk += data

    def finish_chunk(self) -> None:
        """Write the chunk in progress, if it has messages."""
        if not self._chunk_times:
            return
        data, times = bytes(self._chunk), self._chunk_times
        self._chunk, self._chunk_times = bytearray(), {}
        start = min(entry[0] for entries in times.values() for entry in entries)
        end = max(entry[0] for entries in times.values() for entry in entries)
        self._start = start if self._start is None else min(self._start, start)
        self._end = max(self._end, end)
        compressed = zstandard.compress(data)
        chunk = _packed(
            Chunk(
                compression="zstd",
                data=compressed,
                message_start_time=start,
                message_end_time=end,
                uncompressed_crc=zlib.crc32(data),
                uncompressed_size=len(data),
            )
        )
        position = self._sink.tell()
        after = position + len(chunk)
        indices, offsets = bytearray(), {}
        for channel, entries in times.items():
            offsets[channel] = after + len(indices)
            indices += _packed(MessageIndex(channel_id=channel, records=entries))
        self._sink.write(chunk + bytes(indices))
        self._sink.flush()
        self._chunk_count += 1
        self._chunk_indices += _packed(
            ChunkIndex(
                message_start_time=start,
                message_end_time=end,
                chunk_start_offset=position,
                chunk_length=len(chunk),
                message_index_offsets=offsets,
                message_index_length=len(indices),
                compression="zstd",
                compressed_size=len(compressed),
                uncompressed_size=len(data),
            )
        )

    def finish(self) -> None:
        """Write what is left, and the summary that lets readers seek."""
        self.finish_chunk()
        self._sink.write(_packed(DataEnd(data_section_crc=0)))
        start = self._sink.tell()
        summary, offsets = bytearray(), bytearray()
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, _packed(self._statistics())),
            (Opcode.CHUNK_INDEX, self._chunk_indices),
            (Opcode.METADATA_INDEX, self._metadata_indices),
        ):
            if group:
                place = start + len(summary)
                offsets += _packed(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(group)))
                summary += group
        offset_start = start + len(summary)
        summary += offsets
        head = _FOOTER_HEAD.pack(Opcode.FOOTER, _FOOTER_LENGTH, start, offset_start)
        footer = Footer(
            summary_start=start, summary_offset_start=offset_start, summary_crc=zlib.crc32(head, zlib.crc32(summary))
        )
        self._sink.write(bytes(summary) + _packed(footer) + MAGIC)
        self._sink.flush()

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._counts),
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            metadata_count=self._metadata_count,
            message_start_time=self._start or 0,
            message_end_time=self._end,
            schema_count=self._schema_count,
        )


def _packed(record: Any) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
