"""The earliest meeting with a place that moves, by each reach."""

import math

import numpy as np
import pytest

from companion.planning.shortest.car import Car
from companion.planning.shortest.meeting import CircleReach, PaperReach, earliest_meeting, make_reach

CAR = Car(turning_radius=0.85, speed_forward=0.8, speed_reverse=0.4, acceleration=2.0, gear_time=0.5)
NAMES = ("circle", "paper", "dubins", "reeds_shepp")


def crossing(ahead, speed):
    """A place that crosses from right to left, at its heading."""
    return lambda elapsed: (ahead, 2.0 - speed * elapsed, -math.pi / 2.0)


def met(name, place, *, speed_end=0.25, horizon=20.0):
    reach = make_reach(name, CAR)
    return earliest_meeting(lambda t: reach.time_to(place(t), speed=0.0, speed_end=speed_end), horizon)


@pytest.mark.parametrize("name", NAMES)
def test_the_place_is_reached_just_in_time(name):
    meeting = met(name, crossing(4.0, 0.25))
    assert meeting.feasible
    assert 0.0 <= meeting.elapsed - meeting.needed < 0.1


@pytest.mark.parametrize("name", NAMES)
def test_one_that_drives_away_straight_ahead_is_met_after_its_lead_over_the_difference_of_speeds(name):
    car = Car(turning_radius=0.85, speed_forward=0.8, speed_reverse=0.8)
    reach = make_reach(name, car)
    meeting = earliest_meeting(lambda t: reach.time_to((3.0 + 0.3 * t, 0.0, 0.0), speed=0.8, speed_end=0.3), 20.0)
    assert meeting.elapsed == pytest.approx(3.0 / (0.8 - 0.3), abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_one_that_is_faster_is_not_met_and_the_horizon_is_the_answer(name):
    meeting = met(name, lambda t: (3.0 + 1.0 * t, 0.0, 0.0))
    assert not meeting.feasible
    assert meeting.elapsed == 20.0
    assert meeting.needed > 20.0


@pytest.mark.parametrize("name", NAMES)
def test_where_it_stands_it_is_met_at_once(name):
    meeting = met(name, lambda _t: (0.0, 0.0, 0.0), speed_end=0.0)
    assert meeting.feasible
    assert meeting.elapsed == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_no_instant_of_a_dense_scan_is_earlier_by_a_step(name):
    rng = np.random.default_rng(5)
    reach = make_reach(name, CAR)
    for _ in range(25):
        x, y, heading = rng.uniform((-4, -4, -3), (4, 4, 3)).tolist()
        speed = float(rng.uniform(0.1, 0.4))

        def needed(t, x=x, y=y, heading=heading, speed=speed):
            place = (x + speed * t * math.cos(heading), y + speed * t * math.sin(heading), heading)
            return reach.time_to(place, speed=0.0, speed_end=speed)

        dense = next((t for t in np.arange(0.0, 20.0, 0.02).tolist() if needed(t) <= t), 20.0)
        assert earliest_meeting(needed, 20.0).elapsed <= dense + 0.1


def test_the_radius_of_the_paper_is_as_printed():
    reach = PaperReach(car=CAR)
    for bearing in (0.0, 0.5, math.pi / 2.0, -2.0, 3.0):
        time = reach.time_to((3.0 * math.cos(bearing), 3.0 * math.sin(bearing), 1.0), speed=0.0, speed_end=0.0)
        assert CAR.speed_forward * time * math.cos(bearing / 2.0) == pytest.approx(3.0)
    circle = CircleReach(car=CAR)
    assert circle.time_to((3.0, 4.0, 1.0), speed=0.0, speed_end=0.0) == pytest.approx(5.0 / 0.8)


def test_paths_need_longer_than_the_circle_and_a_car_that_backs_no_longer_than_one_that_does_not():
    rng = np.random.default_rng(6)
    circle, forward, both = (make_reach(name, CAR) for name in ("circle", "dubins", "reeds_shepp"))
    for _ in range(300):
        goal = tuple(rng.uniform((-4, -4, -3), (4, 4, 3)).tolist())
        times = [reach.time_to(goal, speed=0.3, speed_end=0.2) for reach in (circle, both, forward)]
        assert times[1] <= times[2] + 1e-9
        assert times[0] <= times[1] + 0.2


def test_an_unknown_reach_is_refused_and_none_is_none():
    assert make_reach("none", CAR) is None
    with pytest.raises(ValueError, match="one of none, circle, paper, dubins, reeds_shepp"):
        make_reach("sphere", CAR)
