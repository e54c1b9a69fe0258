"""Text lines of serial ranging devices: a plain one with checksum, and `les` and `lec` of Decawave's DWM1001."""

from __future__ import annotations

import re
from functools import reduce
from operator import xor

from companion.link.framing import FramingStatistics
from companion.ranging.wire import Fault, WireMessage, WireRange

LONGEST_LINE = 1024  # bytes; eight anchors of `lec` need some 300

_PLAIN = re.compile(rb"\$?(R,([0-9A-Fa-f]{1,16}),([0-9]{1,9}),([0-9]{1,9}))\*([0-9A-Fa-f]{2})")
_NUMBER = rb"-?[0-9]{1,6}\.[0-9]{1,3}"
_PLACE = rb"%b,%b,%b" % (_NUMBER, _NUMBER, _NUMBER)
_RANGE = rb"([0-9]{1,6}\.[0-9]{2})"  # both print two decimals: fewer are a line that was cut
_LES_RANGE = rb"([0-9A-Fa-f]{4})\[%b\]=%b" % (_PLACE, _RANGE)
_LES = re.compile(rb"%b(?: %b)*(?: le_us=[0-9]+)?(?: est\[%b,[0-9]+\])?" % (_LES_RANGE, _LES_RANGE, _PLACE))
_LES_RANGES = re.compile(_LES_RANGE)
_LEC_RANGE = rb",AN([0-9]{1,2}),([0-9A-Fa-f]{4}),%b,%b" % (_PLACE, _RANGE)
_LEC = re.compile(rb"DIST,([0-9]{1,2})((?:%b)*)(?:,POS,%b,[0-9]+)?" % (_LEC_RANGE, _PLACE))
_LEC_RANGES = re.compile(_LEC_RANGE)
_BEGINNINGS = (b"R,", b"$R,", b"DIST,")
_PROMPT = re.compile(rb"^(?:dwm> ?)+")  # of the DWM1001's shell; a line may stand right behind it


class LineFramer:
    """Cuts a byte stream at the ends of its lines. What is longer than any line is dropped and counted."""

    def __init__(self) -> None:
        self._buffer = b""
        self._lines = 0
        self._skipped = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; give the lines that they complete, without their ends. Never raises."""
        *whole, self._buffer = (self._buffer + data).replace(b"\r", b"\n").split(b"\n")
        lines = [line for line in whole if line and len(line) <= LONGEST_LINE]
        self._skipped += sum(len(line) for line in whole if len(line) > LONGEST_LINE)
        if len(self._buffer) > LONGEST_LINE:  # its end will be found wrong by whoever reads it
            self._skipped += len(self._buffer) - LONGEST_LINE
            self._buffer = self._buffer[-LONGEST_LINE:]
        self._lines += len(lines)
        return lines

    def forget(self) -> None:
        """Drop a line that has begun: the stream was broken off."""
        self._skipped += len(self._buffer)
        self._buffer = b""

    def statistics(self) -> FramingStatistics:
        """Give what has been counted."""
        return FramingStatistics(frames=self._lines, skipped=self._skipped)


def decode_line(line: bytes) -> WireMessage | Fault:
    """Read one line, without its end, in any of the three formats, or say what is wrong with it. Never raises."""
    text = _PROMPT.sub(b"", line.strip())
    if text.startswith((b"R,", b"$R,")):
        return _plain(text)
    if text.startswith(b"DIST,"):
        return _lec(text)
    if _LES.fullmatch(text):
        return _message(_LES_RANGES.findall(text))
    torn = b"]=" in text or any(beginning in text for beginning in _BEGINNINGS)
    return Fault.MALFORMED if torn else Fault.FOREIGN


def plain_line(anchor: int, range_mm: int, age_ms: int) -> bytes:
    """Write the plain line, without its end: what a firmware does, and tests."""
    body = b"R,%X,%d,%d" % (anchor, range_mm, age_ms)
    return b"%b*%02X" % (body, _nmea_checksum(body))


def _nmea_checksum(body: bytes) -> int:
    """Give NMEA 0183's checksum: all bytes between `$` and `*`, exclusive-or."""
    return reduce(xor, body, 0)


def _plain(text: bytes) -> WireMessage | Fault:
    match = _PLAIN.fullmatch(text)
    if match is None:
        return Fault.MALFORMED if b"*" in text else Fault.TRUNCATED
    body, anchor, millimetres, milliseconds, checksum = match.groups()
    if _nmea_checksum(body) != int(checksum, 16):
        return Fault.CHECKSUM
    item = WireRange(anchor=int(anchor, 16), range=int(millimetres) * 1e-3, age=int(milliseconds) * 1e-3)
    return WireMessage(ranges=(item,))


def _lec(text: bytes) -> WireMessage | Fault:
    match = _LEC.fullmatch(text)
    if match is None:
        return Fault.MALFORMED
    found = _LEC_RANGES.findall(match.group(2))
    if [int(number) for number, _, _ in found] != list(range(int(match.group(1)))):
        return Fault.MALFORMED  # lines that run into each other, at high rates, repeat or lack an anchor
    return _message([(anchor, metres) for _, anchor, metres in found])


def _message(found: list[tuple[bytes, bytes]]) -> WireMessage | Fault:
    if len({anchor for anchor, _ in found}) != len(found):
        return Fault.MALFORMED
    return WireMessage(ranges=tuple(WireRange(anchor=int(anchor, 16), range=float(metres)) for anchor, metres in found))
