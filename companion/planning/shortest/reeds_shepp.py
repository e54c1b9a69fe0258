"""Shortest paths of a car that drives forward and back: Reeds and Shepp, "Optimal paths for a car that goes both
forwards and backwards", 1990, section 8.

A shortest path is one of 48 words of three to five segments. Eight formulas give them all: each is applied to the goal,
to its mirror images (left for right, forward for back, both), and three of them to the way back as well. Lengths are in
turning radii, negative backwards; angles count in [-pi, pi). The paper takes a word only where its segments have the
signs of its name. What the formulas give with other signs leads to the goal just as well: it competes, too, and no
word is missed by rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from companion.planning.shortest.car import Car, travel_time
from companion.planning.shortest.dubins import dubins_path
from companion.planning.shortest.path import Path, Pose, Segment

_HALF = 0.5 * math.pi
_TURN = 2.0 * math.pi

# A word before mirroring: turns (1 right, -1 left, 0 straight) and lengths of its segments.
_Word = tuple[tuple[int, ...], tuple[float, ...]]
_RSR, _RSL, _RLR, _RLRL = (1, 0, 1), (1, 0, -1), (1, -1, 1), (1, -1, 1, -1)
_RLSR, _RLSL, _RLSRL = (1, -1, 0, 1), (1, -1, 0, -1), (1, -1, 0, 1, -1)
_RSLR, _LSLR = (1, 0, -1, 1), (-1, 0, -1, 1)


def reeds_shepp_path(car: Car, goal: Pose, *, speed: float = 0.0, speed_end: float = 0.0) -> Path:
    """Find a path to a pose, forward and back: of all words the one that takes least; with one speed, the shortest.

    Words are weighed by their time at full speed, with what a change of direction costs, and the first and last run's
    beginning and end. The shortest path forward competes. A car that never drives backwards gets that.

    Args:
        car: limits.
        goal: (x, y, heading) in the frame of the car.
        speed: present speed [m/s], negative backwards.
        speed_end: at the goal [m/s], negative backwards.
    """
    forward = dubins_path(car, goal)
    if car.speed_reverse <= 0.0:
        return forward
    best = _best_word(car, goal, speed, speed_end)
    radius = car.turning_radius
    mixed = Path(
        turning_radius=radius,
        segments=tuple(Segment(turn=turn, length=radius * part) for turn, part in best if part != 0.0),
    )
    taken = travel_time(car, mixed, speed=speed, speed_end=speed_end)
    return mixed if taken < travel_time(car, forward, speed=speed, speed_end=speed_end) else forward


def _best_word(car: Car, goal: Pose, speed: float, speed_end: float) -> list[tuple[int, float]]:
    radius = car.turning_radius
    x, y, heading = goal[0] / radius, goal[1] / radius, goal[2]
    prices = _Prices(car, speed, speed_end)
    least, best = math.inf, ([], 1, 1)  # type: tuple[float, tuple[list[tuple[int, float]], int, int]]
    for flip in (1, -1):  # forward for back
        lean = flip * prices.lean
        for mirror in (1, -1):  # left for right
            for turns, lengths in _words(flip * x, mirror * y, flip * mirror * heading):
                # no cheaper than its ways forward and back, without changes of direction
                if prices.mean * sum(map(abs, lengths)) + lean * sum(lengths) + prices.ends >= least:
                    continue
                cost = prices.of(turns, lengths, flip)
                if cost < least:
                    least, best = cost, (list(zip(turns, lengths, strict=True)), flip, mirror)
    word, flip, mirror = best
    return [(mirror * turn, flip * length) for turn, length in word]


class _Prices:
    """What a word costs [s], by directions (forward, back); lengths are in turning radii."""

    def __init__(self, car: Car, speed: float, speed_end: float) -> None:
        radius, ways = car.turning_radius, (1.0, -1.0)
        self._straight, self._arc = ([radius / car.speed(turn, way) for way in ways] for turn in (0, 1))
        self._begin = [_change_time(car, way, speed) for way in ways]
        self._end = [_change_time(car, way, speed_end) for way in ways]
        self._change = car.change_time()
        forward, back = map(min, self._straight, self._arc)
        self.mean, self.lean = 0.5 * (forward + back), 0.5 * (forward - back)
        self.ends = min(self._begin) + min(self._end)

    def of(self, turns: tuple[int, ...], lengths: tuple[float, ...], flip: int) -> float:
        """Give the price of a word, `flip` -1: with forward and back exchanged."""
        cost, previous = 0.0, -1
        for turn, length in zip(turns, lengths, strict=True):
            if length == 0.0:
                continue
            back = int((length < 0.0) != (flip < 0))
            cost += abs(length) * (self._arc if turn else self._straight)[back]
            if previous < 0:
                cost += self._begin[back]
            elif back != previous:
                cost += self._change
            previous = back
        return cost + self._end[previous] if previous >= 0 else cost


def _change_time(car: Car, direction: float, speed: float) -> float:
    """Give the time [s] lost between a speed and the highest in a direction, beside the way at the latter."""
    most = car.speed(1, direction)
    return (most - direction * speed) ** 2 / (2.0 * car.acceleration * most)


def _words(x: float, y: float, heading: float) -> Iterator[_Word]:
    """Give the words whose first turn is to the right."""
    sine, cosine = math.sin(heading), math.cos(heading)
    # between centres of circles of like turns, and of unlike ones
    along, across = x - sine, y - 1.0 + cosine
    far, course = math.hypot(along, across), math.atan2(across, along)
    yield _RSR, (_angle(course), far, _angle(heading - course))
    if far <= 4.0:
        yield _RLR, _three_arcs(far, course, heading)
        # the way back: from the goal to the car, driven the other way
        back_along, back_across = x * cosine + y * sine - sine, x * sine - y * cosine - 1.0 + cosine
        back = _three_arcs(math.hypot(back_along, back_across), math.atan2(back_across, back_along), heading)
        yield _RLR, back[::-1]
    if far >= 2.0:
        yield _RLSR, _turn_and_like(far, course, heading)
    yield from _unlike_words(x + sine, y - 1.0 - cosine, heading)
    back_x, back_y = x * cosine + y * sine, x * sine - y * cosine
    along, across = back_x - sine, back_y - 1.0 + cosine
    far = math.hypot(along, across)
    if far >= 2.0:
        yield _RSLR, _turn_and_like(far, math.atan2(across, along), heading)[::-1]
    along, across = back_x + sine, back_y - 1.0 - cosine
    far = math.hypot(along, across)
    if far >= 2.0:
        yield _LSLR, _turn_and_unlike(far, math.atan2(-along, across) + math.pi, heading)[::-1]


def _unlike_words(along: float, across: float, heading: float) -> Iterator[_Word]:
    """Give the words that end with a turn to the left; (along, across) is from the first centre to the last."""
    squared = along * along + across * across
    far = math.sqrt(squared)
    if far >= 2.0:
        length, course = math.sqrt(squared - 4.0), math.atan2(across, along)
        first = _angle(course + math.atan2(2.0, length))
        yield _RSL, (first, length, _angle(first - heading))
        yield _RLSL, _turn_and_unlike(far, math.atan2(-along, across) + math.pi, heading)
        straight = 4.0 - length
        first = _angle(math.atan2((4.0 - straight) * along - 2.0 * across, -2.0 * along + (straight - 4.0) * across))
        yield _RLSRL, (first, -_HALF, straight, -_HALF, _angle(first - heading))
    share = 0.25 * (2.0 + far)
    if share <= 1.0:
        middle = math.acos(share)
        first, last = _outer(middle, -middle, along, across, heading)
        yield _RLRL, (first, middle, -middle, last)
    share = (20.0 - squared) / 16.0
    if 0.0 <= share <= 1.0:
        middle = -math.acos(share)
        first, last = _outer(middle, middle, along, across, heading)
        yield _RLRL, (first, middle, middle, last)


def _three_arcs(far: float, course: float, heading: float) -> tuple[float, float, float]:
    """Formula 8.3: an arc, one back on the other circle, an arc."""
    middle = -2.0 * math.asin(min(1.0, 0.25 * far))
    first = _angle(course + 0.5 * middle + math.pi)
    return first, middle, _angle(heading - first + middle)


def _turn_and_like(far: float, course: float, heading: float) -> tuple[float, float, float, float]:
    """Formula 8.9: an arc, a quarter back on the other circle, straight, an arc of the first kind."""
    root = math.sqrt(far * far - 4.0)
    first = _angle(course + math.atan2(root, -2.0))
    return first, -_HALF, 2.0 - root, _angle(heading - _HALF - first)


def _turn_and_unlike(far: float, course: float, heading: float) -> tuple[float, float, float, float]:
    """Formula 8.10: an arc, a quarter back on the other circle, straight, an arc of the second kind."""
    first = _angle(course)
    return first, -_HALF, 2.0 - far, _angle(first + _HALF - heading)


def _outer(second: float, third: float, along: float, across: float, heading: float) -> tuple[float, float]:
    """Give the first and the last of four arcs (formulas 8.7, 8.8) from the two in the middle [rad]."""
    apart = second - third
    a = math.sin(second) - math.sin(apart)
    b = math.cos(second) - math.cos(apart) - 1.0
    first = math.atan2(across * a - along * b, along * a + across * b)
    if 2.0 * (math.cos(apart) - math.cos(third) - math.cos(second)) + 3.0 < 0.0:
        first += math.pi
    first = _angle(first)
    return first, _angle(first - second + third - heading)


def _angle(angle: float) -> float:
    """Bring an angle [rad] into [-pi, pi)."""
    return (angle + math.pi) % _TURN - math.pi
