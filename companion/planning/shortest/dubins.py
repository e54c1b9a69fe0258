"""Shortest paths of a car that drives forward only: Dubins, "On Curves of Minimal Length", 1957.

A shortest path is one of six words of three segments: LSL, RSR, LSR, RSL, LRL, RLR. Lengths are in turning radii.
"""

from __future__ import annotations

import math

from companion.planning.shortest.car import Car
from companion.planning.shortest.path import Path, Pose, Segment

_TURN = 2.0 * math.pi
_FULL = 1e-7  # [rad] so little is missing to a full circle: rounding, and none is driven
_TOUCH = 1e-9  # circles that overlap by so little touch


def dubins_path(car: Car, goal: Pose) -> Path:
    """Find the path forward to a pose that takes least at full speed; with one speed, the shortest.

    Args:
        car: limits.
        goal: (x, y, heading) in the frame of the car.
    """
    straight, arc = 1.0 / car.speed_forward, 1.0 / car.speed(1, 1.0)
    least, best = math.inf, ((1, 0.0), (0, 0.0), (1, 0.0))
    for word in _words(goal[0] / car.turning_radius, goal[1] / car.turning_radius, goal[2]):
        (_, first), (turn, middle), (_, last) = word
        cost = arc * (first + last) + (straight if turn == 0 else arc) * middle
        if cost < least:
            least, best = cost, word
    radius = car.turning_radius
    return Path(
        turning_radius=radius,
        segments=tuple(Segment(turn=turn, length=radius * angle) for turn, angle in best if angle != 0.0),
    )


_Word = tuple[tuple[int, float], tuple[int, float], tuple[int, float]]


def _words(x: float, y: float, heading: float) -> list[_Word]:
    """Give every word that leads there: turns with their angles, straight lines with their lengths in radii.

    The centres of the first circles are (0, s), those of the last ones (x - s sin, y + s cos) with s = 1 for a turn to
    the right. The straight line between circles of like turns is as long as their centres are apart; between unlike
    ones it is a tangent inside.
    """
    sine, cosine = math.sin(heading), math.cos(heading)
    words: list[_Word] = []
    for s in (1, -1):
        # seen by a mirror for a turn to the left, so that the formulas are those of one to the right
        turned, aside = s * heading, s * y
        along, across = x - s * sine, aside - 1.0 + cosine
        apart, course = math.hypot(along, across), math.atan2(across, along)
        words.append(((s, _angle(course)), (0, apart), (s, _angle(turned - course))))
        if apart <= 4.0:
            middle = _TURN - 2.0 * math.asin(0.25 * apart)
            first = _angle(course + 0.5 * middle)
            words.append(((s, first), (-s, middle), (s, _angle(turned - first + middle))))
        along, across = x + s * sine, aside - 1.0 - cosine
        squared = along * along + across * across - 4.0
        if squared >= -_TOUCH:
            length = math.sqrt(max(squared, 0.0))
            first = _angle(math.atan2(across, along) + math.atan2(2.0, length))
            words.append(((s, first), (0, length), (-s, _angle(first - turned))))
    return words


def _angle(angle: float) -> float:
    """Bring an angle [rad] into [0, 2 pi); what lacks nothing but rounding is zero."""
    angle %= _TURN
    return 0.0 if angle > _TURN - _FULL else angle
