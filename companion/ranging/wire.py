"""What one message of a ranging device says, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Fault(Enum):
    """Why a message, or one range of it, was not used."""

    FOREIGN = "not a ranging message"
    VERSION = "of another version of the format"
    TRUNCATED = "cut short, or of the wrong length"
    CHECKSUM = "wrong checksum"
    MALFORMED = "a field that cannot be read"
    OTHER_TAG = "from another tag"
    DUPLICATE = "received twice"
    LATE = "overtaken by a later message"
    UNKNOWN_ANCHOR = "to an anchor that the survey does not have"
    IMPLAUSIBLE = "zero, negative or too long"
    STALE = "too old"
    DISTRUSTED = "of quality 0: the device itself holds it for wrong"


@dataclass(frozen=True, slots=True, kw_only=True)
class WireRange:
    """One range as the device says it."""

    anchor: int  # hardware id
    range: float  # [m]
    age: float = 0.0  # [s] from the measurement until the message was sent
    quality: int | None = None  # [%] by the device's own judgement, None where it gives none


@dataclass(frozen=True, slots=True, kw_only=True)
class WireMessage:
    """The ranges of one message."""

    ranges: tuple[WireRange, ...]
    tag: int | None = None  # hardware id of the device that measured, None where the format has none
    sequence: int | None = None  # counts up by one from message to message, modulo 2**32
