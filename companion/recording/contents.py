"""A recording in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

RECORDING_NAME = "flight.mcap"  # in the directory of a flight
SUMMARY_NAME = "summary.json"  # beside it: the result, and what the clock on the wall said


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One message of a JSON channel."""

    t: float  # [s] companion clock
    data: Mapping[str, Any]  # plain values, as JSON gives them


@dataclass(frozen=True, slots=True, kw_only=True)
class RawRecord:
    """One message of a channel of bytes."""

    t: float  # [s] companion clock
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Everything of one flight, by channel, each in the order of recording."""

    metadata: Mapping[str, Mapping[str, str]]  # name of the block -> key -> text
    messages: Mapping[str, tuple[Record, ...]]  # JSON channels
    raw: Mapping[str, tuple[RawRecord, ...]]  # channels of bytes
    complete: bool  # False: the file ends before its footer; what precedes the break is here

    def of(self, channel: str) -> tuple[Record, ...]:
        """Give the messages of a JSON channel; empty where it does not exist."""
        return self.messages.get(channel, ())

    def last(self, channel: str) -> Mapping[str, Any] | None:
        """Give the newest message of a JSON channel; None where there is none."""
        records = self.of(channel)
        return records[-1].data if records else None
