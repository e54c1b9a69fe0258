"""A setpoint that moves under limits of speed, acceleration and jerk: take-off and flying by sticks."""

import math

from sitl_stub.truth import Vector
from sitl_stub.vehicle.estimator import Estimate

TRACK_TIME = 0.3
"""Time constant [s] with which the smoothed speed approaches the wanted one."""


class SmoothMotion:
    """A setpoint that moves under limits of speed, acceleration and jerk, as PX4's auto modes do."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self) -> None:
        self.position = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.acceleration = [0.0, 0.0, 0.0]

    def start(self, estimate: Estimate) -> None:
        """Begin at the vehicle's present motion."""
        self.position = list(estimate.position)
        self.velocity = list(estimate.velocity)
        self.acceleration = [0.0, 0.0, 0.0]

    def step(self, wanted: Vector, *, acceleration_max: float, jerk_max: float, dt: float) -> None:
        """Turn the velocity towards `wanted` [m/s] and move on by `dt` [s]."""
        for i in range(3):
            goal = (wanted[i] - self.velocity[i]) / TRACK_TIME
            goal = max(-acceleration_max, min(acceleration_max, goal))
            change = max(-jerk_max * dt, min(jerk_max * dt, goal - self.acceleration[i]))
            self.acceleration[i] += change
            self.velocity[i] += self.acceleration[i] * dt
            self.position[i] += self.velocity[i] * dt


def speed_towards(distance: float, *, acceleration: float, jerk: float, limit: float) -> float:
    """Speed [m/s] from which a stop within `distance` [m] is possible under acceleration and jerk limits."""
    b = 2.0 * acceleration * acceleration / jerk
    return min(limit, 0.5 * (-b + math.sqrt(b * b + 8.0 * acceleration * max(distance, 0.0))))
