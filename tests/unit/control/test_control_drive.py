"""The rover's inner loop: what PX4 makes of its sticks is what was wanted."""

import math
from dataclasses import replace

import pytest

from companion.control.drive import STOOD, DriveParameters, drive

P = DriveParameters()
ROLLING = STOOD._replace(standing=None)


def step(state=ROLLING, *, speed, measured, curvature=0.0, acceleration=0.0, dt=0.02, parameters=P):
    return drive(
        state,
        speed=speed,
        acceleration=acceleration,
        curvature=curvature,
        measured=measured,
        dt=dt,
        parameters=parameters,
    )


def wheel_angle(sticks, measured, curvature):
    """PX4's ACRO: front wheels [rad] of a throttle and a steering stick (AckermannRateControl, no integral)."""
    wanted = math.copysign(1.0, sticks.throttle) * sticks.steering * P.yaw_rate_full
    guessed = sticks.throttle * P.full_speed
    angle = math.atan(wanted * P.wheel_base / guessed)
    if guessed > 0.0:
        angle += P.yaw_rate_gain * (wanted - curvature * measured)
    return angle


def test_to_stand_is_to_shut_the_throttle() -> None:
    _, sticks = step(speed=0.0, measured=0.8)
    assert sticks == (0.0, 0.0)


@pytest.mark.parametrize("speed", [0.25, 0.6, 1.2, -0.3, -0.6])
@pytest.mark.parametrize("curvature", [-1.1, -0.3, 0.0, 0.2, 1.1])
def test_the_wheels_stand_as_the_arc_needs(speed: float, curvature: float) -> None:
    _, sticks = step(speed=speed, measured=speed, curvature=curvature)
    angle = wheel_angle(sticks, speed, curvature)
    assert math.tan(angle) / P.wheel_base == pytest.approx(curvature, rel=0.03, abs=1e-9)


@pytest.mark.parametrize("speed", [0.6, -0.35])
def test_a_car_that_turns_mirrored_backwards_is_steered_so(speed: float) -> None:
    mirrored = replace(P, turns_mirrored_backwards=True)
    _, usual = step(speed=speed, measured=speed, curvature=0.4)
    _, other = step(speed=speed, measured=speed, curvature=0.4, parameters=mirrored)
    assert usual.steering > 0.05
    assert other.throttle == usual.throttle
    assert other.steering == math.copysign(1.0, speed) * usual.steering


def test_a_speed_held_needs_what_friction_takes() -> None:
    _, sticks = step(speed=1.0, measured=1.0)
    assert sticks.throttle == pytest.approx(P.rolling + P.drag)


def test_backwards_is_forwards_mirrored() -> None:
    _, ahead = step(speed=0.5, measured=0.3, acceleration=0.4)
    _, back = step(speed=-0.5, measured=-0.3, acceleration=-0.4)
    assert back.throttle == pytest.approx(-ahead.throttle)


def test_from_rest_it_breaks_away_and_then_lets_go() -> None:
    state = STOOD
    for _ in range(3):
        state, sticks = step(state, speed=0.1, measured=0.0)
        assert sticks.throttle >= P.breakaway
    for measured in (0.05, 0.12, 0.12, 0.12):
        state, sticks = step(state, speed=0.1, measured=measured)
    assert sticks.throttle < P.breakaway


def test_a_change_of_gear_breaks_away_as_from_rest() -> None:
    """However long it has driven the other way, and though it still rolls."""
    state = STOOD
    for _ in range(200):
        state, _ = step(state, speed=0.5, measured=0.4)
    for measured in (0.2, 0.1, 0.0, 0.0, 0.0):
        state, sticks = step(state, speed=-0.1, measured=measured)
        assert sticks.throttle <= -P.breakaway
    for measured in (-0.12, -0.12, -0.12):
        state, sticks = step(state, speed=-0.1, measured=measured)
    assert sticks.throttle > -P.breakaway


def test_one_that_still_rolls_is_not_pushed_off_again() -> None:
    """Told to stand for a moment only: what started it would drive it into its leader."""
    state = STOOD
    for _ in range(200):
        state, _ = step(state, speed=0.4, measured=0.4)
    state, _ = step(state, speed=0.0, measured=0.4)
    for _ in range(60):
        state, sticks = step(state, speed=0.2, measured=0.35)
        assert sticks.throttle < P.breakaway


def test_one_that_is_much_too_fast_is_not_pushed_off() -> None:
    state = STOOD._replace(standing=0.6, measured=0.6)
    for _ in range(60):
        state, sticks = step(state, speed=0.15, measured=0.6)
        assert sticks.throttle < P.breakaway


def test_a_friction_that_is_not_known_is_found() -> None:
    """A cart with a fifth more friction reaches the speed; without the integral it falls short."""

    def settled(parameters: DriveParameters) -> float:
        state, speed = STOOD, 0.0
        for _ in range(1500):
            state, sticks = step(state, speed=0.8, measured=speed, parameters=parameters)
            friction = 0.25 if speed < 0.01 else 1.2 * P.rolling + P.drag * speed * speed
            speed = max(0.0, speed + 0.02 * (sticks.throttle - friction) / P.mass)
        return speed

    assert settled(P) == pytest.approx(0.8, abs=0.01)
    assert settled(replace(P, integral_gain=0.0)) < 0.76
