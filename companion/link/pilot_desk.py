"""Texts, numbers and the heartbeat for the pilot and the ground station, bounded in rate.

PX4 forwards one message per turn of its loop between links and keeps room for two (mavlink_main.cpp), so at most one
message leaves with each call of `poll`. A text goes out whole before the next begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.link.outgoing import Encoder
from companion.messages.decision import Mode
from companion.messages.pilot import PilotText, Severity, Stand

CHUNK = 50  # bytes of one STATUSTEXT
LONGEST = 120  # bytes of a text: PX4's log keeps 126
NAME_LENGTH = 9  # characters of a number's name: PX4 keeps nine of MAVLink's ten
_QUEUE = 8  # texts that wait; of more, the least important of the oldest go
_ELLIPSIS = b"..."
_TICK = 1e-6  # [s] ticks that fall on a due time up to rounding count as there

# Numbers of the guidance's modes in the heartbeat: never renumbered, new ones are added at the end.
MODE_NUMBERS = {
    mode: number
    for number, mode in enumerate(
        (
            Mode.PREFLIGHT,
            Mode.TAKEOFF,
            Mode.SEARCH,
            Mode.APPROACH,
            Mode.REORIENT,
            Mode.FOLLOW,
            Mode.ALIGN,
            Mode.LAND,
            Mode.TOUCHDOWN,
            Mode.HOLD,
            Mode.GO_AROUND,
            Mode.ABORT,
            Mode.DONE,
            Mode.AUTOPILOT_LAND,
            Mode.TRANSIT,
        ),
        start=1,
    )
}
_STANDBY, _ACTIVE, _CRITICAL = 3, 4, 5  # MAV_STATE
_STATES = {
    Stand.WAITING: _STANDBY,
    Stand.ENGAGED: _ACTIVE,
    Stand.MUTED: _STANDBY,
    Stand.GUIDING: _ACTIVE,
    Stand.ENDED: _STANDBY,
    Stand.FAILED: _CRITICAL,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PilotParameters:
    """How much the pilot and the ground station are told."""

    text_burst: Annotated[int, Ge(1), Le(50)] = 8  # texts that may go out one after the other
    text_rate: Annotated[float, Gt(0.0), Le(10.0)] = 1.0  # [Hz] of texts after that
    value_rate: Annotated[float, Ge(0.0), Le(2.0)] = 1.0  # [Hz] of each number; 0: none
    unseen_s: Annotated[float, Gt(0.0)] = 1.0  # [s] without the pad, or without pictures, until that is told
    # [m] landing targets are sent while the pad's place is known better than this, horizontally
    target_std_m: Annotated[float, Gt(0.0)] = 0.3
    target_rate: Annotated[float, Gt(0.0), Le(60.0)] = 30.0  # [Hz] of landing targets at most


def mav_state(stand: Stand) -> int:
    """Give the MAV_STATE of the companion's heartbeat."""
    return _STATES[stand]


def custom_mode(stand: Stand, mode: Mode) -> int:
    """Give the custom_mode of the companion's heartbeat: the mode's number, plus 256 times the stand's."""
    return MODE_NUMBERS[mode] | stand.value << 8


def chunks_of(text: str) -> list[bytes]:
    """Cut a text into chunks; the last one is shorter than 50 bytes, which is how MAVLink marks the end.

    Characters that are not printable ASCII become question marks. What is longer than 120 bytes is cut at a word.
    """
    plain = "".join(c if c.isascii() and c.isprintable() else "?" for c in " ".join(text.split()))
    data = plain.encode("ascii")
    if len(data) > LONGEST:
        head = data[: LONGEST - len(_ELLIPSIS)]
        data = (head.rsplit(b" ", 1)[0] if b" " in head else head) + _ELLIPSIS
    if len(data) <= CHUNK:
        return [data]
    chunks = [data[start : start + CHUNK] for start in range(0, len(data), CHUNK)]
    return chunks if len(chunks[-1]) < CHUNK else [*chunks, b""]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chunk:
    severity: Severity
    data: bytes
    number: int
    index: int


class PilotDesk:
    """Holds what is to be told, and gives one message at a time to each of its encoders.

    Args:
        parameters: rates.
        encoders: one for each receiver, each with its own sequence numbers.
    """

    def __init__(self, parameters: PilotParameters, encoders: tuple[Encoder, ...]) -> None:
        self._p = parameters
        self._encoders = encoders
        self._waiting: list[PilotText] = []
        self._left_out = 0
        self._under_way: list[_Chunk] = []
        self._number = 0
        self._tokens = float(parameters.text_burst)
        self._t_tokens: float | None = None
        self._values: dict[str, float] = {}
        self._due: dict[str, float] = {}

    def say(self, text: PilotText) -> None:
        """Take a text; one that waits already with the same words is not taken again."""
        if text in self._waiting:
            return
        self._waiting.append(text)
        if len(self._waiting) > _QUEUE:
            least = max(self._waiting[:-1], key=lambda waiting: waiting.severity)  # the oldest of these
            self._waiting.remove(least)
            self._left_out += 1

    def show(self, values: Mapping[str, float]) -> None:
        """Take the numbers as they are now, by name; those that are not finite, or left out, are not sent.

        Raises:
            ValueError: a name is longer than PX4 keeps.
        """
        for name in values:
            if len(name) > NAME_LENGTH:
                raise ValueError(f"{name!r} is longer than {NAME_LENGTH} characters, which is what PX4 keeps")
        self._values = {name: value for name, value in values.items() if math.isfinite(value)}

    def poll(self, t: float, time_boot_ms: int) -> tuple[bytes, ...]:
        """Give the datagram due at `t` [s] for each encoder, in their order; empty where none is due.

        Args:
            t: now [s].
            time_boot_ms: the autopilot's time now, for the stamps of numbers.
        """
        chunk = self._next_chunk(t)
        if chunk is not None:
            return tuple(
                encoder.status_text(chunk.severity, chunk.data, chunk.number, chunk.index) for encoder in self._encoders
            )
        name = self._next_value(t)
        if name is None:
            return ()
        return tuple(encoder.named_value(name, self._values[name], time_boot_ms) for encoder in self._encoders)

    def _next_chunk(self, t: float) -> _Chunk | None:
        """Give the next chunk: of the text under way, else of the most important one that waits."""
        self._fill(t)
        if not self._under_way and self._waiting and self._tokens >= 1.0:
            self._tokens -= 1.0
            text = min(self._waiting, key=lambda waiting: waiting.severity)
            self._waiting.remove(text)
            self._begin(text)
        elif not self._under_way and not self._waiting and self._left_out and self._tokens >= 1.0:
            self._tokens -= 1.0
            self._begin(PilotText(severity=Severity.NOTICE, text=f"{self._left_out} messages left out"))
            self._left_out = 0
        return self._under_way.pop(0) if self._under_way else None

    def _begin(self, text: PilotText) -> None:
        parts = chunks_of(text.text)
        number = 0
        if len(parts) > 1:
            self._number = number = self._number % 0xFFFF + 1
        self._under_way = [
            _Chunk(severity=text.severity, data=part, number=number, index=index) for index, part in enumerate(parts)
        ]

    def _fill(self, t: float) -> None:
        if self._t_tokens is not None:
            self._tokens = min(float(self._p.text_burst), self._tokens + (t - self._t_tokens) * self._p.text_rate)
        self._t_tokens = t

    def _next_value(self, t: float) -> str | None:
        if self._p.value_rate == 0.0:
            return None
        for name in self._values:
            if t >= self._due.get(name, -math.inf) - _TICK:
                self._due[name] = t + 1.0 / self._p.value_rate
                return name
        return None
