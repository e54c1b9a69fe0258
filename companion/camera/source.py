"""What a camera is to the rest of the program."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from companion.clock import Clock
from companion.messages.perception import CameraFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraStalled:
    """No new picture for too long."""

    t: float  # [s]
    silence: float  # [s] since the last picture
    reason: str  # plain: what is known of the cause


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFrozen:
    """Pictures come, but they are all the same: the camera's driver repeats an old one."""

    t: float  # [s]
    since: float  # [s] instant of the first of the equal pictures


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRecovered:
    """New pictures come again."""

    t: float  # [s]


CameraEvent = CameraStalled | CameraFrozen | CameraRecovered


class CameraSource(Protocol):
    """A running camera. The newest picture wins: an older one that nobody looked at in time is gone."""

    def newest(self) -> CameraFrame | None:
        """Give the newest picture, or None while there is none; its sequence tells whether it is a new one."""

    def events(self) -> list[CameraEvent]:
        """Give what has happened since the last call; each trouble once when it begins, and its end once."""

    def stop(self) -> None:
        """Let the camera go; a second call does nothing."""


class RecordedCamera:
    """Plays recorded or made-up pictures: each is there once the clock has reached its arrival.

    Args:
        frames: in order of arrival.
        clock: tells how far the playing is.
    """

    def __init__(self, frames: Iterable[CameraFrame], clock: Clock) -> None:
        self._frames = list(frames)
        if any(a.t_arrival > b.t_arrival for a, b in pairwise(self._frames)):
            raise ValueError("recorded pictures must be in order of arrival")
        self._clock = clock
        self._arrived = 0
        self._stopped = False

    def newest(self) -> CameraFrame | None:
        """Give the newest picture that has arrived, or None."""
        now = self._clock.now()
        while not self._stopped and self._arrived < len(self._frames):
            if self._frames[self._arrived].t_arrival > now:
                break
            self._arrived += 1
        return self._frames[self._arrived - 1] if self._arrived else None

    def events(self) -> list[CameraEvent]:
        """A recording has no trouble of its own."""
        return []

    def stop(self) -> None:
        """Play no further."""
        self._stopped = True
