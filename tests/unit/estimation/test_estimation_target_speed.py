"""How fast a slow target drives, though the place it is seen at wanders with the autopilot's."""

import math

import numpy as np
import pytest

from companion.estimation.target_speed import TargetSpeed, TargetSpeedParameters, crossing_speed

STEP = 0.05
P = TargetSpeedParameters()


def watched(speed, seconds, *, winding=0.0, wanders=0.0, start=0.0, watch=None):
    """Let a target drive along a winding way, seen in a frame that wanders by so many metres."""
    watch = watch or TargetSpeed(P)
    north = east = 0.0
    for k in range(round(seconds / STEP)):
        t = k * STEP
        heading = winding * math.sin(0.3 * t)
        north += speed * STEP * math.cos(heading)
        east += speed * STEP * math.sin(heading)
        off = wanders * math.sin(1.1 * t)
        watch.update(start + t, north=north + off, east=east - off, course=(math.cos(heading), math.sin(heading)))
    return watch


@pytest.mark.parametrize("winding", [0.0, 0.6])
def test_a_frame_that_wanders_hardly_matters(winding) -> None:
    """The place is off by up to 0.2 m each way, its speed by 0.3 m/s."""
    assert watched(0.25, 30.0, winding=winding, wanders=0.2).speed == pytest.approx(0.25, abs=0.05)


def test_it_is_known_only_after_a_while() -> None:
    assert watched(0.25, 0.8 * P.known_s).speed is None
    assert watched(0.25, 1.2 * P.known_s).speed == pytest.approx(0.25)


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.8, 1.5])
def test_of_one_that_stands_or_is_fast_nothing_is_said(speed) -> None:
    assert watched(speed, 30.0).speed is None


def test_the_way_in_a_pause_does_not_count_and_what_is_forgotten_is_gone() -> None:
    watch = watched(0.25, 20.0)
    watch.update(25.0, north=50.0, east=0.0, course=(1.0, 0.0))
    assert watch.speed == pytest.approx(0.25)
    watch.forget()
    assert watch.speed is None


@pytest.mark.parametrize("heading", [0.3, -2.0])
@pytest.mark.parametrize("turned", [math.pi / 2.0, -2.2, 0.8])
@pytest.mark.parametrize("aside", [0.0, 0.12])
def test_what_crosses_is_known_however_wrong_the_own_speed_is(heading, turned, aside) -> None:
    """The vehicle goes 0.7 m/s and `aside` to its right, the target 0.25 m/s; along, 0.2 m/s are told too much."""
    forward, course = np.array([math.cos(heading), math.sin(heading)]), heading + turned
    right, along = np.array([-forward[1], forward[0]]), np.array([math.cos(course), math.sin(course)])
    relative = np.array([*(0.9 * forward + aside * right - 0.25 * along), 0.0])

    def asked(least):
        return crossing_speed(relative, course=tuple(forward), target_course=tuple(along), aside=aside, least=least)

    assert asked(0.6) == pytest.approx(0.25)
    assert asked(1.0) is None or abs(turned) == math.pi / 2.0


def test_a_target_ahead_at_the_same_heading_does_not_cross() -> None:
    assert crossing_speed(np.zeros(3), course=(1.0, 0.0), target_course=(1.0, 0.0), aside=0.0, least=0.6) is None


def test_a_speed_seen_crossing_goes_before_the_way_in_the_frame() -> None:
    watch = TargetSpeed(P)
    for k in range(200):
        watch.update(k * STEP, north=0.0, east=0.1 * k * STEP, course=(0.0, 1.0), crossing=0.25)
    assert watch.speed == pytest.approx(0.25)
