"""Pure pursuit: the bearing that leads back to a line and along it (PX4's lib/pure_pursuit)."""

import math

from sitl_stub.vehicle.rover.loops import EPSILON, wrap

Point = tuple[float, float]
"""North and east [m]."""


def target_bearing(goal: Point, start: Point, place: Point, lookahead: float) -> float:
    """Bearing [rad] from `place` to the point of the line start-goal that is `lookahead` [m] away.

    Near the goal, or without a line, the bearing of the goal; too far from the line, that of its nearest point; NaN
    when a point is not known (PurePursuit::calcTargetBearing).
    """
    if not all(map(math.isfinite, (*goal, *start, *place))):
        return math.nan
    to_goal = (goal[0] - place[0], goal[1] - place[1])
    line = (goal[0] - start[0], goal[1] - start[1])
    length = math.hypot(*line)
    if math.hypot(*to_goal) < lookahead or length < EPSILON:
        return _bearing(to_goal)
    along = (line[0] / length, line[1] / length)
    travelled = (place[0] - start[0], place[1] - start[1])
    progress = travelled[0] * along[0] + travelled[1] * along[1]
    to_line = (progress * along[0] - travelled[0], progress * along[1] - travelled[1])
    distance = math.hypot(*to_line)
    if distance > lookahead:
        if progress * length < EPSILON:
            return _bearing((-travelled[0], -travelled[1]))
        if (progress - length) * length > EPSILON:
            return _bearing(to_goal)
        return _bearing(to_line)
    ahead = math.sqrt(lookahead * lookahead - distance * distance)
    return _bearing((to_line[0] + ahead * along[0], to_line[1] + ahead * along[1]))


def _bearing(vector: Point) -> float:
    return wrap(math.atan2(vector[1], vector[0]))
