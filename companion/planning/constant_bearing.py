"""The course on which a goal that moves is met soonest at a bounded speed: its bearing stays, its distance falls.

With v_g the goal's velocity and u the direction in which it lies, the velocity asked for is

    v = v_g + c u,   |v| <= speed,   c <= sqrt(2 a d)

with the largest such c at the distance d. For a goal that goes straight on this leads to where its way pierces the cone
of r_eff(t) = speed t (Patel et al., "De-coupled Position and Orientation", figure 3); anew in each step, it does for
any other goal too. A minimum-snap plan of the same top speed covers little more than half of that way, and never meets
a goal that is as fast as the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseLimits:
    """What the course keeps to."""

    speed: float  # [m/s] over the floor
    closing_speed: float  # [m/s] relative to the goal
    acceleration: float  # [m/s^2] of the velocity asked for, and with which the distance is closed at the end


def closing_speed(away: Pair, goal_velocity: Pair, limits: CourseLimits) -> float:
    """Give the largest speed [m/s] at which the distance may fall; 0 where the goal cannot be neared.

    Args:
        away: from the vehicle to the goal [m].
        goal_velocity: [m/s].
        limits: of the course.
    """
    distance = math.hypot(*away)
    if distance == 0.0:
        return 0.0
    along = (away[0] * goal_velocity[0] + away[1] * goal_velocity[1]) / distance
    room = along * along + limits.speed**2 - goal_velocity[0] ** 2 - goal_velocity[1] ** 2
    if room <= 0.0:
        return 0.0
    gentle = math.sqrt(2.0 * limits.acceleration * distance)
    return max(0.0, min(math.sqrt(room) - along, gentle, limits.closing_speed))


def steered(velocity: Pair, away: Pair, goal_velocity: Pair, limits: CourseLimits, dt: float) -> Pair:
    """Give the velocity [m/s] asked for after `dt` [s], no faster than the top speed.

    Args:
        velocity: asked for before [m/s].
        away: from the vehicle to the goal [m].
        goal_velocity: [m/s].
        limits: of the course.
        dt: time since [s].
    """
    distance = math.hypot(*away)
    closing = closing_speed(away, goal_velocity, limits) / distance if distance > 0.0 else 0.0
    wanted = within((goal_velocity[0] + closing * away[0], goal_velocity[1] + closing * away[1]), limits.speed)
    change = within((wanted[0] - velocity[0], wanted[1] - velocity[1]), limits.acceleration * dt)
    return velocity[0] + change[0], velocity[1] + change[1]


def around(away: Pair, obstacle: Pair, clearance: float) -> Pair:
    """Give the way to a goal that keeps clear of an obstacle: straight, or along its edge, or out of it.

    Args:
        away: from the vehicle to the goal [m].
        obstacle: from the vehicle to the obstacle's middle [m].
        clearance: to be kept from that middle [m].

    Returns:
        As long as `away`; of another direction where the obstacle is in the way.
    """
    distance, length = math.hypot(*away), math.hypot(*obstacle)
    if length == 0.0 or distance == 0.0:
        return away
    side = math.copysign(1.0, obstacle[0] * away[1] - obstacle[1] * away[0])
    ahead = (obstacle[0] / length, obstacle[1] / length)
    if length <= clearance:
        turn = side * (0.5 * math.pi + math.acos(length / clearance))
        if away[0] * ahead[0] + away[1] * ahead[1] <= 0.0:
            return away
    else:
        turn = side * math.asin(clearance / length)
        along = (away[0] * ahead[0] + away[1] * ahead[1]) / distance
        beside = distance * distance <= length * length - clearance * clearance
        if beside or math.acos(max(-1.0, min(1.0, along))) >= abs(turn):
            return away
    cosine, sine = math.cos(turn), math.sin(turn)
    return distance * (cosine * ahead[0] - sine * ahead[1]), distance * (sine * ahead[0] + cosine * ahead[1])


def within(vector: Pair, most: float) -> Pair:
    """Give a vector of the same direction, no longer than `most`."""
    size = math.hypot(*vector)
    return vector if size <= most else (vector[0] * most / size, vector[1] * most / size)
