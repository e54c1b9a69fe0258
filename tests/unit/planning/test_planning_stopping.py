"""The fastest approach: from it a vehicle stops in time behind a target that brakes, and hardly slower than need be."""

import math
from dataclasses import replace

import pytest

from companion.planning.stopping import StoppingParameters, fastest

P = StoppingParameters()
STEP = 0.001
PLACE = {"standoff": 1.25, "ahead": 1.0}


def nearest(speed, target_speed, gap, *, braking, parameters=P):
    """Let the target brake as hard as it can, and the vehicle a moment later: the range [m] when both have stopped."""
    t = 0.0
    while speed > 0.0 or target_speed > 0.0:
        gap += (target_speed - speed) * STEP
        target_speed = max(0.0, target_speed - parameters.target_braking_mps2 * STEP)
        t += STEP
        if t > parameters.delay_s:
            speed = max(0.0, speed - braking * STEP)
    return gap


@pytest.mark.parametrize("braking", [0.5, 1.0, 2.9])
@pytest.mark.parametrize("target_speed", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("gap", [1.1, 1.25, 1.6, 3.0])
def test_it_stops_where_it_may_come_to_and_not_before(gap, target_speed, braking) -> None:
    speed = fastest(gap=gap, away=target_speed, braking=braking, parameters=P, **PLACE)
    assert nearest(speed, target_speed, gap, braking=braking) == pytest.approx(P.nearest_m, abs=0.005)


@pytest.mark.parametrize("target_speed", [0.25, 0.5, 1.0])
def test_it_keeps_its_place_behind_a_target_that_drives(target_speed) -> None:
    assert fastest(gap=1.25, away=target_speed, braking=2.0, parameters=P, **PLACE) > target_speed


def test_nearer_than_allowed_it_does_not_drive_on() -> None:
    assert fastest(gap=P.nearest_m - 0.05, away=0.0, braking=2.0, parameters=P, **PLACE) == 0.0


def test_a_place_that_is_nearer_can_be_reached() -> None:
    assert fastest(gap=0.8, standoff=0.8, ahead=1.0, away=0.0, braking=2.0, parameters=P) > 0.3


def test_a_target_to_the_side_or_behind_does_not_hold_it() -> None:
    for bearing in (1.5, 3.0):
        assert fastest(gap=0.9, standoff=1.25, ahead=math.cos(bearing), away=0.0, braking=2.0, parameters=P) == math.inf


def test_who_brakes_later_or_less_must_be_slower() -> None:
    def speed(braking=2.0, parameters=P):
        return fastest(gap=1.3, away=0.3, braking=braking, parameters=parameters, **PLACE)

    assert speed(braking=1.0) < speed()
    assert speed(parameters=replace(P, delay_s=0.6)) < speed()
    assert speed(parameters=replace(P, target_braking_mps2=3.0)) < speed()


def test_one_that_comes_nearer_counts_as_one_that_stands() -> None:
    speeds = [fastest(gap=1.6, away=away, braking=2.0, parameters=P, **PLACE) for away in (-1.0, 0.0)]
    assert speeds[0] == speeds[1]
