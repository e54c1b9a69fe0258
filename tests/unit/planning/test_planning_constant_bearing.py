"""The course to a goal that moves: no faster than allowed, met where it is soonest, at the goal's own velocity."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.constant_bearing import CourseLimits, around, closing_speed, steered

LIMITS = CourseLimits(speed=0.1, closing_speed=0.15, acceleration=0.15)
NUMBER = st.integers(-3_000_000, 3_000_000).map(lambda micrometres: 1e-6 * micrometres)
DT = 0.02


def fly(place, goal_velocity, seconds, limits=LIMITS):
    """Fly from rest at the origin; give distances to the goal and the last velocity."""
    here, velocity, distances = [0.0, 0.0], (0.0, 0.0), []
    for k in range(round(seconds / DT)):
        away = tuple(place[i] + k * DT * goal_velocity[i] - here[i] for i in (0, 1))
        velocity = steered(velocity, away, goal_velocity, limits, DT)
        here = [here[i] + DT * velocity[i] for i in (0, 1)]
        distances.append(math.hypot(*away))
    return distances, velocity


@given(away=st.tuples(NUMBER, NUMBER), goal=st.tuples(NUMBER, NUMBER), before=st.tuples(NUMBER, NUMBER))
def test_it_asks_for_no_more_than_the_limits(away, goal, before) -> None:
    share = 0.1 / max(0.1, math.hypot(*before))
    before = (share * before[0], share * before[1])
    after = steered(before, away, goal, LIMITS, DT)
    assert math.hypot(*after) <= LIMITS.speed * (1.0 + 1e-9)
    assert math.dist(before, after) <= LIMITS.acceleration * DT * (1.0 + 1e-9)
    assert 0.0 <= closing_speed(away, goal, LIMITS) <= LIMITS.closing_speed


@settings(max_examples=25)
@given(ahead=st.floats(0.8, 1.6), aside=st.floats(0.6, 1.6))
def test_a_goal_as_fast_as_itself_is_met_where_its_way_pierces_the_cone(ahead, aside) -> None:
    """It comes along, `ahead` of the vehicle's level on its way: |p + v t| = speed t at t = |p|^2 / (2 ahead speed)."""
    soonest = (ahead**2 + aside**2) / (2.0 * ahead * LIMITS.speed)
    distances, velocity = fly((aside, -ahead), (0.0, LIMITS.speed), soonest + 8.0)
    assert distances[round(soonest / DT) - 50] > 0.05
    assert distances[-1] < 0.01
    assert velocity == pytest.approx((0.0, LIMITS.speed), abs=0.01)


def test_at_the_limits_the_bearing_stays() -> None:
    limits = CourseLimits(speed=0.1, closing_speed=1.0, acceleration=10.0)
    here, velocity, bearings = (0.0, 0.0), (0.0, 0.0), []
    for k in range(300):
        away = (1.2 - here[0], -1.0 + k * DT * 0.08 - here[1])
        velocity = steered(velocity, away, (0.0, 0.08), limits, DT)
        here = (here[0] + DT * velocity[0], here[1] + DT * velocity[1])
        bearings.append(math.atan2(away[1], away[0]))
    assert max(bearings) - min(bearings) < 0.005
    assert math.hypot(*velocity) == pytest.approx(0.1)


def test_a_goal_that_runs_away_as_fast_is_followed_and_not_neared() -> None:
    assert closing_speed((1.0, 0.0), (0.1, 0.0), LIMITS) == pytest.approx(0.0)
    distances, velocity = fly((1.0, 0.0), (0.1, 0.0), 10.0)
    assert velocity == pytest.approx((0.1, 0.0))
    assert 1.0 < distances[-1] < 1.1


def test_a_goal_faster_than_itself_is_followed_at_top_speed() -> None:
    _, velocity = fly((1.0, 0.0), (0.3, 0.4), 5.0)
    assert velocity == pytest.approx((0.06, 0.08))


def test_a_goal_at_rest_is_come_to_without_passing_it() -> None:
    distances, velocity = fly((0.6, 0.8), (0.0, 0.0), 20.0)
    assert distances[-1] < 0.01
    assert math.hypot(*velocity) < 0.01
    assert all(later <= earlier + 1e-3 for earlier, later in pairwise(distances))


@pytest.mark.parametrize("start", [(1.5, 0.1), (1.5, -0.4), (0.8, 0.9), (0.75, 0.02), (-1.0, 0.3)])
def test_the_way_around_an_obstacle_keeps_clear_and_arrives(start) -> None:
    """The goal is the origin, the obstacle's middle 0.65 m beside it; begun inside, it goes out first."""
    here, nearest, clear = list(start), math.inf, 0.53
    for _ in range(600):
        away, obstacle = (-here[0], -here[1]), (0.65 - here[0], -here[1])
        if math.hypot(*away) < 0.02:
            break
        way = around(away, obstacle, clear)
        assert math.hypot(*way) == pytest.approx(math.hypot(*away))
        here = [here[i] + 0.01 * way[i] / math.hypot(*way) for i in (0, 1)]
        nearest = min(nearest, math.hypot(*obstacle))
    assert math.hypot(*here) < 0.03
    begun = math.dist(start, (0.65, 0.0))
    assert nearest > min(clear, begun) - 0.02


@given(away=st.tuples(NUMBER, NUMBER), obstacle=st.tuples(NUMBER, NUMBER))
def test_an_obstacle_behind_or_beyond_the_goal_changes_nothing(away, obstacle) -> None:
    if away[0] * obstacle[0] + away[1] * obstacle[1] <= 0.0 or math.hypot(*obstacle) > math.hypot(*away) + 0.5:
        assert around(away, obstacle, 0.5) == away
