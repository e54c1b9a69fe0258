"""Commanded motion in plain floats, and the limits as convex sets: this runs in every tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from companion.messages.motion import MotionLimits

Vector = tuple[float, float, float]  # north, east, down
TOLERANCE = 1.0 + 1e-9  # relative, for rounding


class Motion(NamedTuple):
    """A commanded state, ned."""

    position: Vector  # [m]
    velocity: Vector  # [m/s]
    acceleration: Vector  # [m/s^2]


class Heading(NamedTuple):
    """A commanded heading."""

    yaw: float  # [rad]
    rate: float  # [rad/s]


def add(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    """Give a + factor * b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def scale(a: Vector, factor: float) -> Vector:
    """Give factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


def largest(a: Vector) -> float:
    """Give the largest magnitude of the components."""
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


def speed_use(v: Vector, limits: MotionLimits) -> float:
    """Give how far a velocity [m/s] uses the speed limits: a convex gauge, above 1 where one is broken."""
    vertical = v[2] / limits.speed_down if v[2] > 0.0 else -v[2] / limits.speed_up
    return max(math.hypot(v[0], v[1]) / limits.speed_horizontal, vertical)


def acceleration_use(a: Vector, limits: MotionLimits) -> float:
    """Give how far an acceleration [m/s^2] uses the limits: a convex gauge, above 1 where one is broken."""
    return max(math.hypot(a[0], a[1]) / limits.acceleration_horizontal, abs(a[2]) / limits.acceleration_vertical)


def clamp_speed(v: Vector, limits: MotionLimits) -> Vector:
    """Bring a velocity [m/s] into the limits, horizontal and vertical each by itself."""
    horizontal = math.hypot(v[0], v[1])
    factor = limits.speed_horizontal / horizontal if horizontal > limits.speed_horizontal else 1.0
    return factor * v[0], factor * v[1], max(-limits.speed_up, min(limits.speed_down, v[2]))


def clamp_acceleration(a: Vector, limits: MotionLimits) -> Vector:
    """Bring an acceleration [m/s^2] into the limits, horizontal and vertical each by itself."""
    horizontal = math.hypot(a[0], a[1])
    factor = limits.acceleration_horizontal / horizontal if horizontal > limits.acceleration_horizontal else 1.0
    vertical = limits.acceleration_vertical
    return factor * a[0], factor * a[1], max(-vertical, min(vertical, a[2]))
