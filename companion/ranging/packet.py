"""The UDP packet "companion ranging"; docs/components/ranging.md describes it byte by byte."""

from __future__ import annotations

import binascii
import struct

from companion.ranging.wire import Fault, WireMessage, WireRange

MAGIC = b"CRNG"
VERSION = 1
MOST_RANGES = 28  # 498 bytes: every IPv4 host takes 508 in one piece (RFC 791: 576 less the longest headers)
QUALITY_UNKNOWN = 255
_HEADER = struct.Struct("<4sBBIQ")  # magic, version, count, sequence, tag
_RANGE = struct.Struct("<QIIB")  # anchor, range [mm], age [us], quality [%]
_CHECKSUM = struct.Struct("<I")
_LEAST = _HEADER.size + _CHECKSUM.size


def is_packet(data: bytes) -> bool:
    """Tell whether a datagram is a whole packet of this format."""
    return isinstance(decode_packet(data), WireMessage)


def encode_packet(message: WireMessage) -> bytes:
    """Write a message as a packet: what a firmware or a bridge does, and tests.

    Raises:
        ValueError: it has no tag or no sequence, too many ranges, or a number that the format does not hold.
    """
    if message.tag is None or message.sequence is None or len(message.ranges) > MOST_RANGES:
        raise ValueError(f"a packet has a tag, a sequence, and at most {MOST_RANGES} ranges")
    body = _HEADER.pack(MAGIC, VERSION, len(message.ranges), message.sequence, message.tag)
    try:
        for item in message.ranges:
            quality = QUALITY_UNKNOWN if item.quality is None else item.quality
            body += _RANGE.pack(item.anchor, round(1e3 * item.range), round(1e6 * item.age), quality)
    except struct.error as error:
        raise ValueError(f"a range does not fit the format: {error}") from None
    return body + _CHECKSUM.pack(binascii.crc32(body))


def decode_packet(data: bytes) -> WireMessage | Fault:
    """Read a packet, or say what is wrong with it. Never raises."""
    if data[:4] != MAGIC:
        return Fault.FOREIGN
    if len(data) < _LEAST:
        return Fault.TRUNCATED
    _, version, count, sequence, tag = _HEADER.unpack_from(data)
    if version != VERSION:
        return Fault.VERSION
    if count > MOST_RANGES or len(data) != _LEAST + count * _RANGE.size:
        return Fault.TRUNCATED
    if binascii.crc32(data[: -_CHECKSUM.size]) != _CHECKSUM.unpack_from(data, len(data) - _CHECKSUM.size)[0]:
        return Fault.CHECKSUM
    ranges = tuple(
        WireRange(
            anchor=anchor,
            range=millimetres * 1e-3,
            age=microseconds * 1e-6,
            quality=None if quality == QUALITY_UNKNOWN else quality,
        )
        for anchor, millimetres, microseconds, quality in _RANGE.iter_unpack(data[_HEADER.size : -_CHECKSUM.size])
    )
    return WireMessage(ranges=ranges, tag=tag, sequence=sequence)
