"""Where the goal is to move in each mode: the wanted velocity as a function of where the goal is.

None of them leads through the target. The line of sight and the ways to points straight in front of the docking face
lie inside a cone before it, which is convex and does not hold the target; from elsewhere the way leads round a sphere.
"""

from __future__ import annotations

import math

from companion.guidance.docking.goal_point import (
    Triple,
    across,
    along,
    closing_velocity,
    dot,
    minus,
    norm,
    scaled,
)
from companion.guidance.docking.parameters import ClearanceParameters, CorridorParameters, DockingMotionParameters
from companion.guidance.docking.port import Port

_STEEPEST = 1.0  # sideways per metre inwards, of a curved way in
_SHORTEST = 0.02  # [m] over which what is left of an offset fades out on the straight part


def least_range(port: Port, point: Triple, clearance: ClearanceParameters) -> float:
    """Give the range [m] at which the way along the line of sight ends: r1's floor, or the docking faces too close.

    The nearer the line of sight is to the face's plane, the farther out that is.
    """
    cosine = math.cos(min(port.angle(point), clearance.front_angle))
    return max(clearance.least_align_range, clearance.face_clearance / cosine)


def along_sight(
    port: Port, position: Triple, *, end_range: float, speed: float, motion: DockingMotionParameters
) -> Triple:
    """Give the velocity [m/s] along the line of sight to (or, when nearer, away to) the point at `end_range` [m]."""
    away = minus(position, port.position)
    distance = norm(away)
    direction = scaled(away, 1.0 / distance) if distance > 1e-6 else port.normal
    return closing_velocity(position, along(port.position, direction, end_range), speed, motion)


def towards(
    port: Port, position: Triple, aim: Triple, *, end_range: float, speed: float, motion: DockingMotionParameters
) -> Triple:
    """Give the velocity [m/s] straight to a point, or to where that way first comes as near as `end_range` [m].

    From nearer it leads away from the docked position, as `along_sight` does.
    """
    if port.range(position) <= end_range:
        return along_sight(port, position, end_range=end_range, speed=speed, motion=motion)
    return closing_velocity(position, first_within(port, position, aim, end_range), speed, motion)


def first_within(port: Port, start: Triple, end: Triple, end_range: float) -> Triple:
    """Give where the straight way from `start` to `end` [m] first comes as near as `end_range` [m]; else its end."""
    way, away = minus(end, start), minus(start, port.position)
    length = norm(way)
    if length < 1e-9:
        return end
    nearest = -dot(way, away) / length  # [m] along the way, to the point nearest to the docked position
    inside = nearest * nearest - dot(away, away) + end_range * end_range
    ends = nearest - math.sqrt(inside) if inside > 0.0 else length
    return along(start, way, ends / length) if 0.0 <= ends < length else end


def waypoint_of(port: Port, start: Triple, clearance: ClearanceParameters) -> Triple | None:
    """Give the waypoint [m] from which the line of sight is free, None where it is free from the start."""
    if port.angle(start) <= clearance.front_angle:
        return None
    distance = min(clearance.waypoint_range, max(port.range(start), clearance.keep_out))
    return port.slanted(start, clearance.waypoint_angle, distance)


def round_target(
    port: Port,
    position: Triple,
    waypoint: Triple,
    *,
    speed: float,
    clearance: ClearanceParameters,
    motion: DockingMotionParameters,
) -> Triple:
    """Give the velocity [m/s] to the waypoint: straight, or along the tangent of the sphere round the target.

    Within the sphere it leads out of it.
    """
    centre = port.before(-clearance.target_depth)
    away = minus(position, centre)
    distance = norm(away)
    outwards = scaled(away, 1.0 / distance) if distance > 1e-6 else port.normal
    way = minus(waypoint, position)
    length = norm(way)
    if distance < clearance.keep_out:
        return scaled(outwards, speed) if distance < 0.9 * clearance.keep_out else _sideways(outwards, way, speed)
    sine = clearance.keep_out / distance
    nearest = -dot(away, way) / max(length, 1e-9)  # [m] along the way, to the point nearest to the centre
    passes = math.sqrt(max(distance * distance - nearest * nearest, 0.0))
    if not 0.0 < nearest < length or passes >= clearance.keep_out:
        return closing_velocity(position, waypoint, speed, motion)
    tangent = _sideways(outwards, way, speed * sine)
    return along(tangent, outwards, -speed * math.sqrt(1.0 - sine * sine))


def _sideways(outwards: Triple, way: Triple, speed: float) -> Triple:
    """Give the part of a way across `outwards`, as a velocity [m/s]; any direction across it where there is none."""
    side = along(way, outwards, -dot(way, outwards))
    length = norm(side)
    return scaled(across(outwards), speed) if length < 1e-6 else scaled(side, speed / length)


def inwards(
    port: Port, position: Triple, *, speed: float, corridor: CorridorParameters, motion: DockingMotionParameters
) -> Triple:
    """Give the velocity [m/s] into the port: along a parabola that ends on the normal, then straight.

    On the parabola the offset falls with the square of the distance to the straight part; there the rest fades out.
    """
    out = port.out(position)
    aside = port.aside(position)
    offset = norm(aside)
    end = port.before(-corridor.past_contact)
    if offset < 1e-6:
        return closing_velocity(position, end, speed, motion)
    slope = min(2.0 * offset / max(out - corridor.straight, _SHORTEST), _STEEPEST)
    straight = closing_velocity(port.before(out), end, speed / math.hypot(1.0, slope), motion)
    return along(straight, aside, -slope * norm(straight) / offset)
