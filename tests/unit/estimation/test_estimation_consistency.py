"""Consistency measures against known figures and simulated chi-squares."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.estimation.consistency import (
    autocorrelation,
    average_bounds,
    chi_square_quantile,
    fraction_inside,
    normalised_squared,
    whiteness_bound,
)


def test_known_quantiles() -> None:
    assert chi_square_quantile(0.99, 1) == pytest.approx(6.635, abs=1e-3)
    assert chi_square_quantile(0.95, 4) == pytest.approx(9.488, abs=1e-3)
    assert average_bounds(4, 100) == pytest.approx((3.465, 4.573), abs=2e-3)
    assert average_bounds(2, 50) == pytest.approx((1.484, 2.591), abs=2e-3)


def test_normalised_squared() -> None:
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]])
    error = np.array([0.3, -0.7])
    assert normalised_squared(error, covariance) == pytest.approx(float(error @ np.linalg.inv(covariance) @ error))


def test_fraction_inside_tells_honest_from_overconfident() -> None:
    rng = np.random.default_rng(0)
    nees = rng.chisquare(4, size=(50, 400))
    assert fraction_inside(nees, 4) == pytest.approx(0.95, abs=0.04)
    assert fraction_inside(1.5 * nees, 4) < 0.1
    assert fraction_inside(0.6 * nees, 4) < 0.1
    nees[10:, :200] = math.nan
    assert fraction_inside(nees, 4) == pytest.approx(0.95, abs=0.04)
    assert math.isnan(fraction_inside(np.full((3, 2), math.nan), 4))


def test_whiteness() -> None:
    rng = np.random.default_rng(1)
    white = rng.standard_normal((2000, 2))
    assert abs(autocorrelation(white)) < 1.5 * whiteness_bound(2000, 2)
    assert autocorrelation(np.cumsum(white, axis=0)) > 0.9
    assert autocorrelation(np.zeros(10)) == 0.0
