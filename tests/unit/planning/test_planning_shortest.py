"""Shortest paths of a car: they lead to the goal, and no other drive that was tried is shorter."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geometry.angles import wrap_angle
from companion.planning.shortest.car import Car, travel_time
from companion.planning.shortest.dubins import dubins_path
from companion.planning.shortest.path import Path, Segment, moved
from companion.planning.shortest.reeds_shepp import reeds_shepp_path

RADIUS = 0.85
CAR = Car(turning_radius=RADIUS, speed_forward=1.0, speed_reverse=1.0)
MICRO = 1e-6

places = st.integers(-6_000_000, 6_000_000).map(lambda n: n * MICRO)
headings = st.integers(-3_141_592, 3_141_592).map(lambda n: n * MICRO)
goals = st.tuples(places, places, headings)
finders = pytest.mark.parametrize("find", [dubins_path, reeds_shepp_path])


def then(a, b):
    """The pose that is `b` as seen from `a`."""
    cosine, sine = math.cos(a[2]), math.sin(a[2])
    return a[0] + cosine * b[0] - sine * b[1], a[1] + sine * b[0] + cosine * b[1], a[2] + b[2]


def random_drive(rng, *, backwards, parts):
    lengths = rng.uniform(-2.5 if backwards else 0.0, 2.5, parts)
    turns = rng.integers(-1, 2, parts)
    return Path(
        turning_radius=RADIUS,
        segments=tuple(Segment(turn=int(t), length=float(x)) for t, x in zip(turns, lengths, strict=True)),
    )


@finders
@settings(deadline=None, max_examples=150)
@given(goal=goals)
def test_it_ends_at_the_goal_and_is_no_shorter_than_the_straight_line(find, goal):
    path = find(CAR, goal)
    x, y, heading = path.end
    assert math.hypot(x - goal[0], y - goal[1]) < 1e-6
    assert abs(wrap_angle(heading - goal[2])) < 1e-6
    assert path.length >= math.hypot(goal[0], goal[1]) - 1e-9
    assert path.length >= RADIUS * abs(wrap_angle(goal[2])) - 1e-6


@finders
def test_the_sampled_poses_are_those_of_a_car(find):
    rng = np.random.default_rng(1)
    for _ in range(20):
        path = find(CAR, tuple(rng.uniform((-4, -4, -3), (4, 4, 3)).tolist()))
        poses = list(path.poses(0.002))
        assert poses[0] == (0.0, 0.0, 0.0)
        assert poses[-1] == pytest.approx(path.end)
        for (x, y, heading), (x2, y2, heading2) in itertools.pairwise(poses):
            step, turned = math.hypot(x2 - x, y2 - y), wrap_angle(heading2 - heading)
            assert step <= 0.002 + 1e-9
            assert abs(turned) <= 0.002 / RADIUS + 1e-9
            course = heading + 0.5 * turned
            assert abs(math.cos(course) * (y2 - y) - math.sin(course) * (x2 - x)) < 1e-5


@settings(deadline=None, max_examples=150)
@given(goal=goals)
def test_both_directions_are_never_longer_than_forward_alone_and_dubins_never_drives_back(goal):
    forward = dubins_path(CAR, goal)
    assert reeds_shepp_path(CAR, goal).length <= forward.length + 1e-9
    assert all(segment.length >= 0.0 for segment in forward.segments)


@finders
@settings(deadline=None, max_examples=100)
@given(goal=goals)
def test_mirror_images_and_the_way_back_are_as_long(find, goal):
    x, y, heading = goal
    length = find(CAR, goal).length
    assert find(CAR, (x, -y, -heading)).length == pytest.approx(length, abs=1e-5)
    # the same drive from its end to its beginning, with the car the other way round
    back = (x * math.cos(heading) + y * math.sin(heading), y * math.cos(heading) - x * math.sin(heading), -heading)
    assert find(CAR, back).length == pytest.approx(length, abs=1e-5)


@settings(deadline=None, max_examples=100)
@given(goal=goals)
def test_forward_for_back_is_as_long_where_both_are_as_fast(goal):
    x, y, heading = goal
    length = reeds_shepp_path(CAR, goal).length
    assert reeds_shepp_path(CAR, (-x, y, -heading)).length == pytest.approx(length, abs=1e-5)


@pytest.mark.parametrize(("find", "backwards"), [(dubins_path, False), (reeds_shepp_path, True)])
def test_no_random_drive_is_shorter(find, backwards):
    rng = np.random.default_rng(2)
    for count in range(1500):
        drive = random_drive(rng, backwards=backwards, parts=2 + count % 5)
        assert find(CAR, drive.end).length <= drive.length + 1e-6


@pytest.mark.parametrize(("find", "signs"), [(dubins_path, (1,)), (reeds_shepp_path, (1, -1))])
def test_no_word_of_a_dense_grid_is_shorter(find, signs):
    """All drives in three parts, in steps of 0.55 m: among them those that are the shortest to where they lead."""
    lengths = [sign * 0.55 * n for n in (1, 3) for sign in signs]
    shortest = 0
    for turns in itertools.product((-1, 0, 1), repeat=3):
        for parts in itertools.product(lengths, repeat=3):
            segments = tuple(Segment(turn=t, length=x) for t, x in zip(turns, parts, strict=True))
            drive = Path(turning_radius=RADIUS, segments=segments)
            found = find(CAR, drive.end).length
            assert found <= drive.length + 1e-6
            shortest += found > drive.length - 1e-6
    assert shortest > 20


@pytest.mark.parametrize(
    ("turns", "signs", "quarters"),
    [
        ((1, 0, 1), (1, 1, 1), ()),
        ((1, 0, -1), (1, 1, 1), ()),
        ((1, -1, 1), (1, -1, 1), ()),
        ((1, -1, 1), (1, 1, -1), ()),
        ((1, -1, 1, -1), (1, 1, -1, -1), ()),
        ((1, -1, 1, -1), (1, -1, -1, 1), ()),
        ((1, -1, 0, -1), (1, -1, -1, -1), (1,)),
        ((1, -1, 0, 1), (1, -1, -1, -1), (1,)),
        ((1, 0, -1, 1), (1, 1, 1, -1), (2,)),
        ((1, 0, 1, -1), (1, 1, 1, -1), (2,)),
        ((1, -1, 0, 1, -1), (1, -1, -1, -1, 1), (1, 3)),
    ],
)
def test_each_word_of_reeds_and_shepp_is_the_shortest_somewhere(turns, signs, quarters):
    """Words by their turns and directions; those of four arcs have two of the same length in the middle."""
    shortest = 0
    for sizes in itertools.product((0.15, 0.45, 0.9, 1.3), repeat=len(turns)):
        if any(sizes[at] != 0.15 for at in quarters):  # fixed below: once is enough
            continue
        if len(turns) == 4 and not quarters and sizes[1] != sizes[2]:
            continue
        parts = [
            sign * RADIUS * (math.pi / 2.0 if at in quarters else size)
            for at, (size, sign) in enumerate(zip(sizes, signs, strict=True))
        ]
        segments = tuple(Segment(turn=t, length=x) for t, x in zip(turns, parts, strict=True))
        drive = Path(turning_radius=RADIUS, segments=segments)
        found = reeds_shepp_path(CAR, drive.end).length
        assert found <= drive.length + 1e-6
        shortest += found > drive.length - 1e-6
    assert shortest > 0


@finders
def test_the_length_is_a_distance(find):
    """No detour by a third pose is shorter: a word left out would show. It also bounds every jump."""
    rng = np.random.default_rng(3)
    for _ in range(600):
        first = tuple(rng.uniform((-2, -2, -3), (2, 2, 3)).tolist())
        second = tuple(rng.uniform((-2, -2, -3), (2, 2, 3)).tolist())
        detour = find(CAR, first).length + find(CAR, second).length
        assert find(CAR, then(first, second)).length <= detour + 1e-6


def test_with_both_directions_a_small_step_of_the_goal_is_a_small_step_of_the_length():
    rng = np.random.default_rng(4)
    for _ in range(300):
        goal = tuple(rng.uniform((-4, -4, -3), (4, 4, 3)).tolist())
        aside = tuple((1e-5 * rng.standard_normal(3)).tolist())
        change = abs(reeds_shepp_path(CAR, then(goal, aside)).length - reeds_shepp_path(CAR, goal).length)
        assert change < 0.05


@pytest.mark.parametrize(
    ("find", "goal", "length"),
    [
        (dubins_path, (3.0, 0.0, 0.0), 3.0),
        (dubins_path, (RADIUS, RADIUS, math.pi / 2), RADIUS * math.pi / 2),
        (dubins_path, (RADIUS, -RADIUS, -math.pi / 2), RADIUS * math.pi / 2),
        (dubins_path, (0.0, 2.0 * RADIUS, math.pi), RADIUS * math.pi),
        (dubins_path, (0.0, 0.0, math.pi), RADIUS * math.pi * 7.0 / 3.0),
        (reeds_shepp_path, (-3.0, 0.0, 0.0), 3.0),
        (reeds_shepp_path, (0.0, 0.0, math.pi), RADIUS * math.pi),
        (reeds_shepp_path, (0.0, 0.0, 0.0), 0.0),
    ],
)
def test_known_lengths(find, goal, length):
    assert find(CAR, goal).length == pytest.approx(length, abs=1e-6)


def test_a_turn_to_the_right_is_clockwise():
    assert moved((0.0, 0.0, 0.0), 1, RADIUS * math.pi / 2, RADIUS) == pytest.approx((RADIUS, RADIUS, math.pi / 2))
    assert dubins_path(CAR, (0.0, 3.0, math.pi)).segments[0].turn == 1


def test_a_car_without_reverse_never_drives_back():
    car = Car(turning_radius=RADIUS, speed_reverse=0.0)
    path = reeds_shepp_path(car, (-1.0, 0.0, 0.0))
    assert all(segment.length >= 0.0 for segment in path.segments)
    back = Path(turning_radius=RADIUS, segments=(Segment(turn=0, length=-1.0),))
    assert travel_time(car, back) == math.inf


def test_the_slower_it_is_backwards_the_less_it_drives_so():
    goal = (-4.0, 0.5, 0.0)
    driven = []
    for speed in (1.0, 0.3, 0.05):
        path = reeds_shepp_path(Car(turning_radius=RADIUS, speed_reverse=speed), goal)
        driven.append(sum(-segment.length for segment in path.segments if segment.length < 0.0))
    assert driven[0] > 3.9
    assert driven[0] >= driven[1] >= driven[2]
    assert driven[2] < 1.0


@pytest.mark.parametrize(("speed", "speed_end"), [(0.0, 0.0), (0.6, 0.0), (0.0, 0.4), (0.9, 0.9), (-0.3, 0.2)])
@pytest.mark.parametrize("way", [0.5, 3.0])
def test_the_time_along_a_line_is_that_of_a_drive_in_small_steps(speed, speed_end, way):
    car = Car(turning_radius=RADIUS, speed_forward=1.0, acceleration=1.5)
    line = Path(turning_radius=RADIUS, segments=(Segment(turn=0, length=way),))
    place, velocity, time, step = 0.0, speed, 0.0, 1e-4
    while place < way:
        braking = math.sqrt(speed_end**2 + 2.0 * car.acceleration * (way - place))
        velocity = min(velocity + car.acceleration * step, car.speed_forward, braking)
        place += velocity * step
        time += step
    assert travel_time(car, line, speed=speed, speed_end=speed_end) == pytest.approx(time, abs=0.01)


def test_arcs_are_no_faster_than_the_yaw_rate_allows_and_a_change_of_direction_takes_its_time():
    slow = Car(turning_radius=RADIUS, speed_forward=2.0, yaw_rate=1.0)
    arc = Path(turning_radius=RADIUS, segments=(Segment(turn=1, length=RADIUS * 1.5),))
    assert travel_time(slow, arc) == pytest.approx(1.5)
    car = Car(turning_radius=RADIUS, speed_forward=1.0, speed_reverse=0.5, acceleration=2.0, gear_time=0.7)
    segments = (Segment(turn=0, length=1.0), Segment(turn=0, length=-1.0))
    there_and_back = Path(turning_radius=RADIUS, segments=segments)
    assert travel_time(car, there_and_back) == pytest.approx(1.0 + 1.0 / 2.0 + 0.7 + 2.0 + 0.5 / 2.0)
