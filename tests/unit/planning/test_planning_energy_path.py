"""The way that takes the least energy: the power's physics, and that nothing nearby is cheaper."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from companion.planning.energy_path import (
    GRAVITY,
    AirframeEnergy,
    PathLimits,
    electric_power,
    minimum_energy_path,
    path_energy,
)

X500 = AirframeEnergy()
LIMITS = PathLimits(speed=2.5, acceleration=0.6, sink_rate=0.8, final_sink_rate=0.5, height_end=1.2)


def power(speed: float = 0.0, climb: float = 0.0, acceleration: float = 0.0) -> float:
    return float(electric_power(np.array([speed]), np.array([climb]), np.array([acceleration]), X500)[0])


def test_hovering_takes_what_momentum_theory_says() -> None:
    weight = X500.mass * GRAVITY
    ideal = weight * math.sqrt(weight / (2.0 * 1.225 * X500.disc_area))
    assert power() == pytest.approx((1.15 * ideal + X500.profile_power) / X500.efficiency, rel=1e-9)


def test_forward_flight_is_cheaper_first_and_dearer_later_and_climbing_costs_its_height() -> None:
    powers = [power(speed) for speed in (0.0, 2.0, 4.0, 12.0, 15.0)]
    assert powers[0] > powers[1] > powers[2] < powers[3] < powers[4]
    rising, sinking = power(10.0, 0.2), power(10.0, -0.2)  # fast, the induced velocity hardly changes
    assert (rising - sinking) / 0.4 == pytest.approx(X500.mass * GRAVITY / X500.efficiency, rel=0.15)
    assert power(2.0, 0.0, 2.0) > power(2.0)


def test_no_neighbour_is_cheaper_and_the_limits_are_kept() -> None:
    found = minimum_energy_path(18.7, 6.0, LIMITS, X500)
    assert found.speed <= LIMITS.speed + 1e-9
    assert LIMITS.height_end - 1e-9 <= found.height_end <= 6.0
    steepest = max(abs(found.height(left)[1]) for left in np.linspace(0.0, 18.7, 400))
    assert steepest * found.speed <= LIMITS.sink_rate * 1.001
    for speed, share, height in itertools.product((1.0, 1.8, 2.5), (0.4, 0.7, 1.0), (1.2, 2.5, 4.0, 6.0)):
        descent = share * 18.7
        if 1.5 * (6.0 - height) / descent * speed <= LIMITS.sink_rate:
            other, _ = path_energy(18.7, (speed, descent, height), 6.0, LIMITS, X500)
            assert found.energy <= other * 1.002


def test_first_across_and_then_straight_down_is_dearer() -> None:
    """Both are flown at the same speed: what is saved is the time of the vertical part."""
    found = minimum_energy_path(18.7, 6.0, LIMITS, X500)
    across, _ = path_energy(18.7, (found.speed, 18.7, 6.0), 6.0, LIMITS, X500)
    assert found.energy < 0.75 * across


def test_the_height_falls_steadily_and_its_slope_is_its_derivative() -> None:
    found = minimum_energy_path(12.0, 6.0, LIMITS, X500)
    left = np.linspace(0.01, 11.9, 200)
    heights = np.array([found.height(x)[0] for x in left])
    assert (np.diff(heights) >= 0.0).all()
    slopes = [(found.height(x + 1e-5)[0] - found.height(x - 1e-5)[0]) / 2e-5 for x in left]
    assert [found.height(x)[1] for x in left] == pytest.approx(slopes, abs=1e-4)
    assert found.height(0.0)[0] == found.height_end
    assert found.height(100.0)[0] == found.height_start


@pytest.mark.parametrize(("length", "height"), [(0.0, 6.0), (0.5, 6.0), (3.0, 1.0), (500.0, 60.0)])
def test_odd_ways_give_a_path_too(length: float, height: float) -> None:
    found = minimum_energy_path(length, height, LIMITS, X500)
    assert math.isfinite(found.energy)
    assert 0.0 < found.speed <= LIMITS.speed + 1e-9
    assert found.height_end <= found.height_start == height
