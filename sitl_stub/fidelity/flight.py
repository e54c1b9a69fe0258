"""What a flight shows, whether PX4 flew it or the stub: motion, estimate and what the autopilot reported."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Value = tuple[int | str, ...]

ACK_ONBOARD, ACK_GROUND = "acks onboard", "acks ground"
MODE, ARMED, LANDED_STATE, HEARTBEAT, TEXT = "mode", "armed", "landed state", "heartbeat", "text severities"
STATE = "state"
"""What HEARTBEAT would say at each moment; only of the stub, which can be asked."""
LANDED = "Landing detected"
"""How the text begins by which the autopilot says that it has landed."""
STANDING = 0.05
"""A vehicle whose height changes by less [m] stands on the ground."""
CHANNELS = (ACK_ONBOARD, ACK_GROUND, MODE, ARMED, LANDED_STATE, HEARTBEAT, TEXT)
"""COMMAND_ACK (command, result) on each link; the mode inside; armed inside; EXTENDED_SYS_STATE.landed_state;
HEARTBEAT (main mode, sub mode, base mode, system status); STATUSTEXT severity."""
STATES = frozenset({MODE, ARMED, LANDED_STATE, HEARTBEAT, STATE})
"""Channels of which only changes count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A path through space, frame ned."""

    t: Array
    """Boot time [s], shape (n,)."""
    position: Array
    """[m], shape (n, 3)."""
    velocity: Array
    """[m/s], shape (n, 3)."""

    def between(self, begin: float, end: float) -> "Track":
        """Give the part with begin <= t < end."""
        part = (self.t >= begin) & (self.t < end)
        return Track(t=self.t[part], position=self.position[part], velocity=self.velocity[part])


@dataclass(frozen=True, slots=True, kw_only=True)
class Angles:
    """Estimated attitude over time."""

    t: Array
    """Boot time [s], shape (n,)."""
    roll_pitch_yaw: Array
    """[rad], shape (n, 3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """One thing that the autopilot reported."""

    t: float
    """Boot time [s]."""
    channel: str
    value: Value
    words: str = ""
    """The text of a STATUSTEXT."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """One flight as an observer saw it."""

    truth: Track
    """True motion, from the start point."""
    estimate: Track
    """The autopilot's estimate, from the estimator's origin."""
    attitude: Angles
    reports: tuple[Report, ...]
    """In the order of time."""

    def channel(self, name: str) -> list[Report]:
        """Give the reports of one channel; of a state only its changes."""
        found = [report for report in self.reports if report.channel == name]
        if name not in STATES:
            return found
        return [report for i, report in enumerate(found) if i == 0 or report.value != found[i - 1].value]

    @property
    def end(self) -> float:
        """Boot time [s] at which the flight was last looked at."""
        return float(self.truth.t[-1])

    def landings(self) -> list[float]:
        """Give the times [s] at which the autopilot said that it has landed, for good."""
        return [t for t in self._landings() if not any(begin <= t < end for begin, end in self.taken_back())]

    def _landings(self) -> list[float]:
        return [r.t for r in self.channel(TEXT) if r.words.startswith(LANDED)]

    def taken_back(self) -> list[tuple[float, float]]:
        """Give begin and end [s] of each time in which a landing was taken back and said again without a flight."""
        said = self._landings()
        return [(begin, end) for begin, end in pairwise(said) if self._stands(begin, end)]

    def _stands(self, begin: float, end: float) -> bool:
        height = self.truth.between(begin, end).position[:, 2]
        return bool(height.size) and bool(np.ptp(height) < STANDING)


def from_start(reports: Iterable[Report], start: float) -> Iterator[Report]:
    """What counts from `start` [s]: each state as it was then, everything else only if it came later."""
    early: list[Report] = []
    late: list[Report] = []
    for report in sorted(reports, key=lambda item: item.t):
        (early if report.t < start else late).append(report)
    states = {report.channel: report for report in early if report.channel in STATES}
    for state in states.values():
        yield Report(t=start, channel=state.channel, value=state.value)
    yield from late
