"""A path of arcs of the smallest circle and straight lines, driven forward or back.

Poses are (x, y, heading) [m, m, rad] in the frame of the car at the start: x forward, y to the right, heading
clockwise. The point that they are of is the middle of the rear axle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from companion.geometry.angles import wrap_angle

Pose = tuple[float, float, float]  # [m, m, rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """An arc or a straight line."""

    turn: int  # 1: clockwise seen along the heading, to the right; -1: to the left; 0: straight
    length: float  # [m] negative: driven backwards


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Segments from the pose (0, 0, 0) on."""

    turning_radius: float  # [m] of its arcs
    segments: tuple[Segment, ...]

    @property
    def length(self) -> float:
        """What is driven [m], forward and back."""
        return sum(abs(segment.length) for segment in self.segments)

    @property
    def end(self) -> Pose:
        """The pose that it leads to."""
        return self.at(math.inf)

    def at(self, driven: float) -> Pose:
        """Give the pose after so much of its length [m]; before its beginning and after its end those."""
        pose, left = (0.0, 0.0, 0.0), max(driven, 0.0)
        for segment in self.segments:
            part = min(abs(segment.length), left)
            pose = moved(pose, segment.turn, math.copysign(part, segment.length), self.turning_radius)
            left -= part
        return pose

    def poses(self, spacing: float) -> Iterator[Pose]:
        """Give poses at most `spacing` [m] apart, its beginning and its end among them."""
        count = max(1, math.ceil(self.length / spacing))
        for index in range(count + 1):
            yield self.at(self.length * index / count)


def moved(pose: Pose, turn: int, length: float, turning_radius: float) -> Pose:
    """Drive `length` [m] on from a pose, straight or along the smallest circle; backwards where negative."""
    x, y, heading = pose
    if turn == 0:
        return x + length * math.cos(heading), y + length * math.sin(heading), heading
    after = heading + turn * length / turning_radius
    radius = turn * turning_radius
    return (
        x + radius * (math.sin(after) - math.sin(heading)),
        y - radius * (math.cos(after) - math.cos(heading)),
        wrap_angle(after),
    )
