from __future__ import annotations

import binascii
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.ranging.lines import LONGEST_LINE, LineFramer, _nmea_checksum, decode_line, plain_line
from companion.ranging.packet import MOST_RANGES, decode_packet, encode_packet, is_packet
from companion.ranging.wire import Fault, WireMessage, WireRange

_SETTINGS = settings(max_examples=100, deadline=None)
LES = (
    b"022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 DCAE[0.00,8.03,0.00]=7.73 "
    b"5431[0.00,0.00,0.00]=9.01 le_us=3082 est[6.97,5.17,-1.77,53]"
)
LEC = (
    b"DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,7.95,0.00,0.00,5.68,AN2,DCAE,0.00,8.03,0.00,7.76,"
    b"AN3,5431,0.00,0.00,0.00,8.73,POS,6.95,5.37,-1.97,52"
)
# two lines that ran into each other, as DWM1001s print them at high rates
TORN = (
    b"DIST,4,AN0,0090,0.00,0.00,0.00,3.25,AN1,D91E,0.00,0.00,0.00,3.33,AN2,0487,0.00,0.00,0.00,0.18,"
    b"AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,0.00"
)

ranges = st.builds(
    WireRange,
    anchor=st.integers(0, 2**64 - 1),
    range=st.integers(0, 2**32 - 1).map(lambda mm: mm * 1e-3),
    age=st.integers(0, 2**32 - 1).map(lambda us: us * 1e-6),
    quality=st.none() | st.integers(0, 100),
)
messages = st.builds(
    WireMessage,
    ranges=st.lists(ranges, max_size=MOST_RANGES).map(tuple),
    tag=st.integers(0, 2**64 - 1),
    sequence=st.integers(0, 2**32 - 1),
)


def packet() -> bytes:
    item = WireRange(anchor=0x022E, range=3.381, age=0.0125, quality=90)
    return encode_packet(WireMessage(ranges=(item, item), tag=7, sequence=5))


def test_the_packet_is_as_documented_byte_by_byte() -> None:
    item = WireRange(anchor=0x022E, range=3.381, age=0.0125, quality=None)
    body = b"CRNG" + bytes([1, 1]) + struct.pack("<I", 5) + struct.pack("<Q", 7)
    body += struct.pack("<Q", 0x022E) + struct.pack("<I", 3381) + struct.pack("<I", 12500) + bytes([255])
    expected = body + struct.pack("<I", binascii.crc32(body))
    assert encode_packet(WireMessage(ranges=(item,), tag=7, sequence=5)) == expected
    assert len(expected) == 18 + 17 + 4


@_SETTINGS
@given(messages)
def test_what_is_encoded_is_decoded(message: WireMessage) -> None:
    assert decode_packet(encode_packet(message)) == message


def test_the_longest_packet_fits_into_any_network() -> None:
    item = WireRange(anchor=1, range=1.0)
    assert len(encode_packet(WireMessage(ranges=(item,) * MOST_RANGES, tag=0, sequence=0))) <= 508
    for wrong in (
        WireMessage(ranges=(item,) * (MOST_RANGES + 1), tag=0, sequence=0),
        WireMessage(ranges=(item,), tag=0),
        WireMessage(ranges=(WireRange(anchor=1, range=-1.0),), tag=0, sequence=0),
    ):
        with pytest.raises(ValueError, match="range"):
            encode_packet(wrong)


def test_every_cut_and_every_changed_byte_of_a_packet_is_noticed() -> None:
    good = packet()
    assert is_packet(good)
    for length in range(len(good)):
        assert decode_packet(good[:length]) in (Fault.FOREIGN, Fault.TRUNCATED)
    for place in range(len(good)):
        changed = bytearray(good)
        changed[place] ^= 0x40
        assert isinstance(decode_packet(bytes(changed)), Fault)
    assert decode_packet(good + b"\x00") is Fault.TRUNCATED
    assert decode_packet(good[:4] + b"\x02" + good[5:]) is Fault.VERSION


@_SETTINGS
@given(st.binary(max_size=300), st.booleans())
def test_no_bytes_make_a_decoder_raise(data: bytes, with_magic: bool) -> None:
    assert isinstance(decode_packet(b"CRNG\x01" + data if with_magic else data), WireMessage | Fault)
    for beginning in (b"", b"R,", b"DIST,4,AN0,", b"022E[7.94,"):
        assert isinstance(decode_line(beginning + data), WireMessage | Fault)


@pytest.mark.parametrize(("line", "metres"), [(LES, [3.38, 5.49, 7.73, 9.01]), (LEC, [3.44, 5.68, 7.76, 8.73])])
def test_lines_of_a_dwm1001_are_read(line: bytes, metres: list[float]) -> None:
    for text in (line, b"dwm> " + line, line + b" "):
        message = decode_line(text)
        assert isinstance(message, WireMessage)
        assert [item.anchor for item in message.ranges] == [0x022E, 0x9280, 0xDCAE, 0x5431]
        assert [item.range for item in message.ranges] == metres
    assert decode_line(b"DIST,0") == WireMessage(ranges=())
    assert decode_line(b"022E[7.94,8.03,0.00]=3.38") == WireMessage(ranges=(WireRange(anchor=0x022E, range=3.38),))


def test_no_cut_line_gives_a_range_that_was_not_measured() -> None:
    for line in (LES, LEC, plain_line(0x022E, 3380, 12)):
        whole = decode_line(line)
        assert isinstance(whole, WireMessage)
        for length in range(len(line)):
            cut = decode_line(line[:length])
            assert isinstance(cut, Fault) or set(cut.ranges) <= set(whole.ranges)
    assert decode_line(TORN) is Fault.MALFORMED


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        (b"POS,7.10,5.24,-2.03,53", Fault.FOREIGN),
        (b"DWM1001 TWR Real Time Location System", Fault.FOREIGN),
        (b"R,22E,3380,12*00", Fault.CHECKSUM),
        (b"R,22E,3380,12", Fault.TRUNCATED),
        (b"R,22E,33x0,12*00", Fault.MALFORMED),
        (b"xR,22E,3380,12*00", Fault.MALFORMED),
        (b"DIST,2,AN0,022E,7.94,8.03,0.00,3.44", Fault.MALFORMED),
        (b"022E[7.94,8.03,0.00]=3.38 022E[7.94,8.03,0.00]=3.39", Fault.MALFORMED),
    ],
)
def test_what_is_wrong_with_a_line_is_told_apart(line: bytes, fault: Fault) -> None:
    assert decode_line(line) is fault


def test_the_plain_line_has_nmeas_checksum_and_may_begin_as_nmea_does() -> None:
    line = plain_line(0x22E, 3380, 12)
    assert line == b"R,22E,3380,12*30"
    gga = b"GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"  # a sentence known from receivers' manuals
    assert _nmea_checksum(gga) == 0x47
    expected = WireMessage(ranges=(WireRange(anchor=0x22E, range=3.38, age=0.012),))
    assert decode_line(line) == decode_line(b"$" + line) == expected


@_SETTINGS
@given(st.lists(st.integers(1, 40), max_size=30))
def test_a_stream_gives_the_same_lines_however_it_is_cut(lengths: list[int]) -> None:
    stream = b"\r\n".join([b"first", LES, LEC, b"", plain_line(1, 2, 3), b""])
    framer, lines, start = LineFramer(), [], 0
    for length in [*lengths, len(stream)]:
        lines += framer.feed(stream[start : start + length])
        start += length
    assert lines == [b"first", LES, LEC, plain_line(1, 2, 3)]


def test_a_line_without_end_is_dropped_and_never_fills_the_memory() -> None:
    framer = LineFramer()
    for _ in range(100):
        assert framer.feed(b"x" * 1000) == []
    assert len(framer._buffer) <= LONGEST_LINE
    framer.forget()
    assert framer.feed(b"next\n") == [b"next"]
    assert framer.statistics().skipped == 100_000
