"""The stop that is always at hand.

First the acceleration is taken away along its own direction, as fast as the jerk allows: the velocity moves on a
straight line from v to v1 = v + a tau / 2, tau = max|a_i| / J. Then the vehicle brakes straight along -v1 with a
jerk-limited ramp, a flat part and a ramp back. The sets of allowed velocities and accelerations and the fence are
convex, so the whole stop stays inside them when a few of its points do: v, v1 and a, and the Bezier points of the
curve and the place where it ends. That makes "is there still a safe stop from here?" a closed formula.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from companion.guardian.motion import Motion, Vector, add, largest, scale
from companion.messages.motion import MotionLimits


class Stop(NamedTuple):
    """A stop from a commanded state."""

    start: Motion
    release: float  # [s] tau
    released_position: Vector  # [m]
    released_velocity: Vector  # [m/s] v1
    speed: float  # [m/s] |v1|
    deceleration: float  # [m/s^2] its peak
    ramp: float  # [s] duration of each ramp
    flat: float  # [s] duration between the ramps
    end: Vector  # [m] where it comes to rest


def plan_stop(start: Motion, limits: MotionLimits) -> Stop:
    """Plan the stop from `start`."""
    position, velocity, acceleration = start
    tau = largest(acceleration) / limits.jerk
    released_velocity = add(velocity, acceleration, 0.5 * tau)
    released_position = add(add(position, velocity, tau), acceleration, tau * tau / 3.0)
    speed = math.sqrt(released_velocity[0] ** 2 + released_velocity[1] ** 2 + released_velocity[2] ** 2)
    if speed < 1e-9:
        return Stop(start, tau, released_position, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, released_position)
    direction = scale(released_velocity, 1.0 / speed)
    horizontal, vertical = math.hypot(direction[0], direction[1]), abs(direction[2])
    strongest = min(
        limits.acceleration_horizontal / horizontal if horizontal > 1e-9 else math.inf,
        limits.acceleration_vertical / vertical if vertical > 1e-9 else math.inf,
    )
    jerk = limits.jerk / largest(direction)
    deceleration = min(strongest, math.sqrt(speed * jerk))
    ramp = deceleration / jerk
    flat = max(speed / deceleration - ramp, 0.0)
    end = add(released_position, released_velocity, 0.5 * (2.0 * ramp + flat))
    return Stop(start, tau, released_position, released_velocity, speed, deceleration, ramp, flat, end)


def hull(stop: Stop) -> tuple[Vector, Vector, Vector, Vector]:
    """Give the points [m] whose convex hull, with the start, holds the whole path of the stop."""
    third = stop.release / 3.0
    return (
        add(stop.start.position, stop.start.velocity, third),
        add(stop.released_position, stop.released_velocity, -third),
        stop.released_position,
        stop.end,
    )


def stop_at(stop: Stop, elapsed: float) -> Motion:
    """Give the commanded state `elapsed` [s] after the start of the stop."""
    if elapsed < stop.release:
        position, velocity, acceleration = stop.start
        share = elapsed / stop.release
        return Motion(
            add(add(position, velocity, elapsed), acceleration, elapsed * elapsed * (0.5 - share / 6.0)),
            add(velocity, acceleration, elapsed * (1.0 - 0.5 * share)),
            scale(acceleration, 1.0 - share),
        )
    left = 2.0 * stop.ramp + stop.flat - (elapsed - stop.release)
    if left <= 0.0 or stop.speed == 0.0:
        return Motion(stop.end, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    # Counted back from the end, where speed and deceleration are zero.
    jerk, decel, ramp = stop.deceleration / stop.ramp, stop.deceleration, stop.ramp
    first = min(left, ramp)
    way, speed, slowing = jerk * first**3 / 6.0, 0.5 * jerk * first * first, jerk * first
    if left > ramp:
        flat = min(left - ramp, stop.flat)
        way, speed, slowing = way + speed * flat + 0.5 * decel * flat * flat, speed + decel * flat, decel
        last = left - ramp - flat
        if last > 0.0:
            way += speed * last + 0.5 * decel * last * last - jerk * last**3 / 6.0
            speed += decel * last - 0.5 * jerk * last * last
            slowing = decel - jerk * last
    direction = scale(stop.released_velocity, 1.0 / stop.speed)
    return Motion(add(stop.end, direction, -way), scale(direction, speed), scale(direction, -slowing))
