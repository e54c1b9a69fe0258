from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from anchor_flights import ANCHORS, RANGE_STD, anchor_flight, squares

from companion.estimation.anchor_calibration import AnchorCalibration, calibrate_anchors
from companion.estimation.anchor_problem import (
    AnchorCalibrationParameters,
    FlownPath,
    FlownRanges,
    anchor_problem,
)
from companion.estimation.anchor_start import fit_anchor
from companion.geometry.rotations import rotation_from_euler

PARAMETERS = AnchorCalibrationParameters()
FEW = replace(PARAMETERS, readings_most=150)


def errors_of(result: AnchorCalibration) -> np.ndarray:
    return np.array([np.linalg.norm(found.position - ANCHORS[found.anchor]) for found in result.anchors])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_anchors_are_found_within_3_cm_through_noise_outliers_and_drift(seed: int) -> None:
    flight = anchor_flight(seed)
    result = calibrate_anchors(flight.path, flight.ranges, PARAMETERS)
    assert result.refusal is None
    assert [found.anchor for found in result.anchors] == [0, 1, 2, 3]
    assert errors_of(result).max() < 0.03
    for found in result.anchors:
        error = np.append(found.position - ANCHORS[found.anchor], found.delay - flight.delays[found.anchor])
        assert abs(error[3]) < 0.03
        assert error @ np.linalg.solve(found.covariance, error) < 18.5  # chi-square of 4: 99.9 %
        assert found.residual_rms == pytest.approx(RANGE_STD, rel=0.15)
    assert sum(found.outliers for found in result.anchors) == pytest.approx(flight.outliers, rel=0.1)
    assert np.linalg.norm(flight.drift[-1]) > 1.0
    for index in (500, 3000, 5990):
        assert np.linalg.norm(result.drift_at(float(flight.path.t[index])) + flight.drift[index]) < 0.05


def test_the_covariance_does_not_promise_too_much() -> None:
    """Of many short flights without drift: squared errors in standard deviations are those of chi-square."""
    t = np.arange(6000) * 0.02
    distances = []
    for seed in range(101, 105):
        flight = anchor_flight(seed, squares(t), drift=0.0)
        few = replace(FEW, drift_share=1e-4, drift_rate=1e-5)
        result = calibrate_anchors(flight.path, flight.ranges, few)
        for found in result.anchors:
            error = np.append(found.position - ANCHORS[found.anchor], found.delay - flight.delays[found.anchor])
            distances.append(error @ np.linalg.solve(found.covariance, error))
    assert 2.0 < np.mean(distances) < 6.5  # expected 4, of 16 samples


def test_the_frame_does_not_matter() -> None:
    flight = anchor_flight(2)
    turn, shift = rotation_from_euler(0.3, -0.5, 2.0), np.array([100.0, -50.0, 20.0])
    moved = FlownPath(
        t=flight.path.t, position=flight.path.position @ turn.T + shift, covariance=flight.path.covariance
    )
    here = calibrate_anchors(flight.path, flight.ranges, FEW)
    there = calibrate_anchors(moved, flight.ranges, FEW)
    for one, other in zip(here.anchors, there.anchors, strict=True):
        assert other.position == pytest.approx(turn @ one.position + shift, abs=1e-3)


def test_equal_inputs_give_equal_bits() -> None:
    results = [calibrate_anchors(flight.path, flight.ranges, FEW) for flight in (anchor_flight(3), anchor_flight(3))]
    assert np.array_equal(results[0].anchors[2].position, results[1].anchors[2].position)


def line(t: np.ndarray) -> np.ndarray:
    return np.column_stack([10.0 * np.sin(0.1 * t), np.full(t.size, 0.5), np.full(t.size, -2.0)])


@pytest.mark.parametrize(
    ("positions", "word"),
    [
        (line, "straight line"),
        (lambda t: np.zeros((t.size, 3)), "straight line or a point"),
        (lambda t: squares(t, heights=(2.0, 2.0)), "one plane"),
        (lambda t: squares(t, heights=(2.0, 2.3)), "one plane"),
    ],
)
def test_a_flight_that_cannot_tell_is_refused_with_what_to_fly(positions, word: str) -> None:
    flight = anchor_flight(1, positions(np.arange(6000) * 0.02), drift=0.0)
    result = calibrate_anchors(flight.path, flight.ranges, PARAMETERS)
    assert word in str(result.refusal)
    assert "square" in str(result.refusal)
    assert "two heights" in str(result.refusal)


def only(flight, chosen: np.ndarray) -> FlownRanges:
    ranges = flight.ranges
    return FlownRanges(t=ranges.t[chosen], anchor=ranges.anchor[chosen], range=ranges.range[chosen])


def test_too_few_ranges_or_none_are_refused() -> None:
    flight = anchor_flight(1)
    few = only(flight, (flight.ranges.anchor != 2) | (flight.ranges.t < 1.0))
    assert "anchor 2 has 12 ranges only" in str(calibrate_anchors(flight.path, few, PARAMETERS).refusal)
    none = only(flight, flight.ranges.t < -1.0)
    assert "no ranges" in str(calibrate_anchors(flight.path, none, PARAMETERS).refusal)
    late = FlownRanges(t=flight.ranges.t + 1000.0, anchor=flight.ranges.anchor, range=flight.ranges.range)
    result = calibrate_anchors(flight.path, late, PARAMETERS)
    assert "no ranges" in str(result.refusal)
    assert result.unused == late.t.size


def test_two_anchors_with_one_id_are_refused() -> None:
    flight = anchor_flight(1)
    mixed = FlownRanges(
        t=flight.ranges.t,
        anchor=np.where(flight.ranges.anchor == 3, 2, flight.ranges.anchor),
        range=flight.ranges.range,
    )
    refusal = str(calibrate_anchors(flight.path, mixed, FEW).refusal)
    assert "two anchors with one id" in refusal


def test_an_anchor_that_was_moved_in_flight_is_refused() -> None:
    flight = anchor_flight(1)
    moved = (flight.ranges.anchor == 1) & (flight.ranges.t > 60.0)
    ranges = FlownRanges(t=flight.ranges.t, anchor=flight.ranges.anchor, range=flight.ranges.range + 1.5 * moved)
    assert "fit no place" in str(calibrate_anchors(flight.path, ranges, FEW).refusal)


def test_an_anchor_far_from_a_small_flight_is_refused() -> None:
    t = np.arange(6000) * 0.02
    flight = anchor_flight(
        1, squares(t, side=1.2, speed=0.3, heights=(1.0, 1.6)) + np.array([40.0, 0.0, 0.0]), drift=0.0
    )
    result = calibrate_anchors(flight.path, flight.ranges, PARAMETERS)
    assert result.refusal is not None
    assert "known to" in result.refusal


def test_ranges_in_gaps_of_the_odometry_are_not_used() -> None:
    flight = anchor_flight(1)
    kept = (flight.path.t < 40.0) | (flight.path.t > 45.0)
    path = FlownPath(t=flight.path.t[kept], position=flight.path.position[kept], covariance=flight.path.covariance)
    result = calibrate_anchors(path, flight.ranges, FEW)
    assert result.refusal is None
    assert result.unused == pytest.approx(250, abs=2)


def test_the_jacobian_is_the_derivative() -> None:
    flight = anchor_flight(1)
    problem, _ = anchor_problem(flight.path, flight.ranges, replace(PARAMETERS, readings_most=50, knot_interval=30.0))
    rng = np.random.default_rng(1)
    unknowns = np.concatenate([np.column_stack([ANCHORS, flight.delays]).ravel(), rng.normal(0.0, 0.1, 12)])
    unknowns += rng.normal(0.0, 0.1, unknowns.size)
    step = 1e-6
    numeric = np.column_stack(
        [
            (problem.residuals(unknowns + step * row) - problem.residuals(unknowns - step * row)) / (2.0 * step)
            for row in np.eye(unknowns.size)
        ]
    )
    assert problem.jacobian(unknowns) == pytest.approx(numeric, abs=1e-4)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_start_finds_the_right_side_of_a_flat_flight(side: float) -> None:
    t = np.arange(0.0, 120.0, 0.2)
    path = squares(t, side=4.0, heights=(1.0, 1.6))
    anchor = np.array([2.0, 5.0, -1.3 + 2.5 * side])
    ranges = np.linalg.norm(path - anchor, axis=1) + np.random.default_rng(1).normal(0.0, 0.02, t.size)
    ranges[::10] += 0.8
    assert fit_anchor(path, ranges, 0.03, 0.3).position == pytest.approx(anchor, abs=0.15)
