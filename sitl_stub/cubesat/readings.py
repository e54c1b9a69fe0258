"""What the sensors give, each with the time at which it was taken; it is delivered later by the sensor's latency."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import TypeAlias

from sitl_stub.cubesat.nozzles import SAME_TIME
from sitl_stub.truth import Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroReading:
    """One reading of the rate gyroscope."""

    t: float
    """[s] when it was taken"""
    rate: Vector
    """Of d against c [rad/s], in d."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeReading:
    """One range between the chaser's radio and an anchor."""

    t: float
    anchor: int
    """Its number in the world file, from 0."""
    range: float
    """[m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkerReading:
    """Markers of the target that the camera has found in one picture."""

    t: float
    markers: tuple[int, ...]
    """Their numbers in the world file, from 0, rising."""
    positions: tuple[Vector, ...]
    """Of those markers [m], in cam."""


Reading: TypeAlias = GyroReading | RangeReading | MarkerReading


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeOutlier:
    """A range that a reflection made too long: known to the truth alone."""

    t: float
    """[s] when it was taken: with the anchor, this names the reading."""
    anchor: int
    excess: float
    """By how much it was too long [m]."""


class Mailbox:
    """Readings under way; those due at the same time come in the order of their sensors."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, int, Reading]] = []
        self._count = 0

    def post(self, due: float, sensor: int, reading: Reading) -> None:
        """Send a reading that arrives at `due` [s]."""
        self._count += 1
        heapq.heappush(self._waiting, (round(due / SAME_TIME), sensor, self._count, reading))

    def collect(self, t: float) -> tuple[Reading, ...]:
        """Take what has arrived until `t` [s]."""
        limit = round(t / SAME_TIME)
        arrived = []
        while self._waiting and self._waiting[0][0] <= limit:
            arrived.append(heapq.heappop(self._waiting)[3])
        return tuple(arrived)
