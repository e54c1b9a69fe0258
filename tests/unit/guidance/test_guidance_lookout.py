"""Looking about for a lost target: every direction once, from the likeliest on."""

import math

import pytest

from companion.geometry.angles import wrap_angle
from companion.guidance.lookout import Lookout, LookoutParameters

P = LookoutParameters()


def headings(seconds, *, expected=None, turning=1.0, yaw=0.0):
    """Give the headings that a vehicle is told, which turns to them at `turning` [rad/s]."""
    lookout, told, t = Lookout(P), [], 0.0
    lookout.begin(t, yaw)
    while t < seconds:
        wanted = lookout.heading(t, yaw=yaw, expected=expected)
        told.append(wanted)
        yaw += max(-0.1 * turning, min(0.1 * turning, wrap_angle(wanted - yaw)))
        t += 0.1
    return told


def test_it_looks_first_where_the_target_is_expected() -> None:
    assert headings(0.3, expected=2.0)[0] == pytest.approx(2.0)
    assert headings(0.3, yaw=0.5)[0] == pytest.approx(0.5)


def test_in_the_end_it_has_looked_all_round() -> None:
    seen = {round(h, 2) for h in headings(60.0, expected=1.0)}
    half_picture = 0.45  # [rad] of the simulated camera
    for degrees in range(0, 360, 5):
        gap = min(abs(wrap_angle(math.radians(degrees) - h)) for h in seen)
        assert gap < half_picture


def test_it_looks_a_step_farther_to_either_side_by_turns() -> None:
    seen = list(dict.fromkeys(round(h, 6) for h in headings(12.0, expected=0.0)))
    assert seen[:4] == pytest.approx([0.0, P.step_rad, -P.step_rad, 2 * P.step_rad])


def test_a_heading_that_cannot_be_reached_is_left_out() -> None:
    told = headings(P.patience_s + 1.0, expected=2.0, turning=0.0)
    assert told[0] == pytest.approx(2.0)
    assert told[-1] == pytest.approx(2.0 + P.step_rad)


def test_it_follows_the_forecast_until_it_has_looked_there() -> None:
    lookout = Lookout(P)
    lookout.begin(0.0, 0.0)
    assert lookout.heading(0.0, yaw=0.0, expected=1.0) == pytest.approx(1.0)
    assert lookout.heading(0.1, yaw=0.0, expected=1.2) == pytest.approx(1.2)


def test_a_reset_of_the_heading_turns_what_it_looks_to() -> None:
    lookout = Lookout(P)
    lookout.begin(0.0, 0.3)
    lookout.turn(0.4)
    assert lookout.heading(0.0, yaw=0.7, expected=None) == pytest.approx(0.7)
