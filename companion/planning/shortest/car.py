"""How long a car takes along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.planning.shortest.path import Path

_RUN = 1e-9  # [m] shorter parts of a path are not driven


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """What a car can do. Speeds are reached by a bounded acceleration; steering takes no time."""

    turning_radius: Annotated[float, Gt(0.0)] = 0.85  # [m] the smallest
    speed_forward: Annotated[float, Gt(0.0)] = 1.0  # [m/s] the highest
    speed_reverse: Annotated[float, Ge(0.0)] = 0.6  # [m/s]; 0: it never drives backwards
    yaw_rate: Annotated[float, Gt(0.0)] = math.inf  # [rad/s] the highest: arcs may be slower than straight lines
    acceleration: Annotated[float, Gt(0.0)] = math.inf  # [m/s^2] also of braking
    gear_time: Annotated[float, Ge(0.0)] = 0.0  # [s] it stands to change its direction, beside braking

    def speed(self, turn: int, length: float) -> float:
        """Give the highest speed [m/s] along a segment; `length` [m] tells the direction by its sign."""
        most = self.speed_forward if length >= 0.0 else self.speed_reverse
        return most if turn == 0 else min(most, self.yaw_rate * self.turning_radius)

    def change_time(self) -> float:
        """Give what a change of direction costs on a long path [s]."""
        fast, slow = self.speed(1, 1.0), self.speed(1, -1.0)
        return self.gear_time + (fast + slow) / (2.0 * self.acceleration)


def travel_time(car: Car, path: Path, *, speed: float = 0.0, speed_end: float = 0.0) -> float:
    """Give the time [s] that a path takes; infinite where it goes backwards and the car does not.

    Each run in one direction is driven as fast as it may be: up to its speed, at that, and down from it. A run of
    segments of unlike speeds is taken at their mean. Where it is too short to brake on, it is taken as if it were not:
    the way back that this costs is not counted.

    Args:
        car: limits.
        path: to be driven.
        speed: at its beginning [m/s], negative backwards.
        speed_end: at its end [m/s], negative backwards.
    """
    runs: list[tuple[float, float, float]] = []  # direction, length [m], time at full speed [s]
    for segment in path.segments:
        if abs(segment.length) < _RUN:
            continue
        most = car.speed(segment.turn, segment.length)
        if most <= 0.0:
            return math.inf
        way, direction = abs(segment.length), math.copysign(1.0, segment.length)
        if runs and runs[-1][0] == direction:
            runs[-1] = (direction, runs[-1][1] + way, runs[-1][2] + way / most)
        else:
            runs.append((direction, way, way / most))
    if not runs:
        return abs(speed_end - speed) / car.acceleration
    total = (len(runs) - 1) * car.gear_time
    for index, (direction, way, time) in enumerate(runs):
        first = direction * speed if index == 0 else 0.0
        last = direction * speed_end if index == len(runs) - 1 else 0.0
        total += _run_time(way, way / time, first, last, car.acceleration)
    return total


def _run_time(way: float, most: float, first: float, last: float, acceleration: float) -> float:
    """Give the time [s] of `way` [m] from speed `first` to `last`, at `most` in between [m/s]."""
    if math.isinf(acceleration):
        return way / most
    peak_squared = acceleration * way + 0.5 * (first * first + last * last)
    if max(first, last, 0.0) ** 2 <= peak_squared <= most * most:
        return (2.0 * math.sqrt(peak_squared) - first - last) / acceleration
    return way / most + ((most - first) ** 2 + (most - last) ** 2) / (2.0 * acceleration * most)
