"""The point that the chaser is to follow: position and velocity never jump, the acceleration is bounded."""

from __future__ import annotations

import math

from companion.guidance.docking.parameters import DockingMotionParameters

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


def minus(a: Triple, b: Triple) -> Triple:
    """Give a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(start: Triple, direction: Triple, length: float) -> Triple:
    """Give start + length * direction."""
    return (
        start[0] + length * direction[0],
        start[1] + length * direction[1],
        start[2] + length * direction[2],
    )


def scaled(a: Triple, factor: float) -> Triple:
    """Give factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


def dot(a: Triple, b: Triple) -> float:
    """Give the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Triple) -> float:
    """Give the length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def across(direction: Triple) -> Triple:
    """Give some unit vector across a unit vector: from the axis that is least along it."""
    least = min(range(3), key=lambda axis: abs(direction[axis]))
    axis = (float(least == 0), float(least == 1), float(least == 2))
    side = along(axis, direction, -direction[least])
    return scaled(side, 1.0 / norm(side))


class GoalPoint:
    """Integrates the goal: a velocity is wanted, and the goal's own velocity follows it with bounded acceleration.

    Between two steps the goal is a parabola. So where the wanted velocity turns, at a change of mode or at a waypoint,
    the goal rounds the corner instead of jumping.
    """

    def __init__(self, position: Triple, parameters: DockingMotionParameters) -> None:
        """`position`: [m] in c, at rest."""
        self._p = parameters
        self.position = position  # [m]
        self.velocity = ZERO  # [m/s]
        self.acceleration = ZERO  # [m/s^2] until the next step

    def move_to(self, position: Triple) -> None:
        """Put the goal somewhere else, at rest: only before the motion begins."""
        self.position, self.velocity, self.acceleration = position, ZERO, ZERO

    def carry(self, position: Triple, share: float) -> None:
        """Come nearer to a position [m] by a share of the distance, whatever the velocity is."""
        self.position = along(self.position, minus(position, self.position), share)

    def advance(self, dt: float) -> None:
        """Go on for `dt` [s] with the acceleration of the last step.

        After one period the acceleration ends; after `longest_step` the goal has waited.
        """
        pushed = min(dt, self._p.period)
        coasted = min(dt, self._p.longest_step) - pushed
        moved = along(along(self.position, self.velocity, pushed), self.acceleration, 0.5 * pushed * pushed)
        self.velocity = along(self.velocity, self.acceleration, pushed)
        self.position = along(moved, self.velocity, coasted)

    def steer(self, wanted: Triple) -> None:
        """Choose the acceleration of the coming period.

        Args:
            wanted: velocity [m/s] to be had at the end of it, or later if that needs more than the acceleration.
        """
        change = scaled(minus(wanted, self.velocity), 1.0 / self._p.period)
        size = norm(change)
        most = self._p.acceleration
        self.acceleration = change if size <= most else scaled(change, most / size)


def closing_velocity(position: Triple, target: Triple, speed: float, parameters: DockingMotionParameters) -> Triple:
    """Give the velocity [m/s] towards a point at which to stop: v = min(speed, sqrt(2 b d), d / tau).

    Args:
        position: where the goal is [m].
        target: where it is to stop [m].
        speed: at most [m/s].
        parameters: b is the planned braking, tau the stopping time.
    """
    way = minus(target, position)
    distance = norm(way)
    if distance < 1e-9:
        return ZERO
    braking = parameters.braking * parameters.acceleration
    size = min(speed, math.sqrt(2.0 * braking * distance), distance / parameters.stopping_time)
    return scaled(way, size / distance)
