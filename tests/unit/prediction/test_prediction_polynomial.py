"""The predictor: the paper's regression, the regularised one, resets, calibration."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import prediction_tracks
import pytest
from prediction_tracks import assert_taken_along, cubic, with_and_without_reset

from companion.geometry.angles import wrap_angle
from companion.prediction.parameters import PredictorParameters
from companion.prediction.polynomial import PolynomialPredictor

METHODS = ["regularised", "paper"]


track = partial(prediction_tracks.track, east_variance=2e-3)
Motion = Callable[[float], tuple[np.ndarray, np.ndarray]]


def straight(t: float) -> tuple[np.ndarray, np.ndarray]:
    rate = np.array([0.4, -0.3, 0.0, 0.2])
    return np.array([5.0, 1.0, -0.2, 3.0]) + rate * t, rate


def fed(motion: Motion, until: float = 4.0, parameters: PredictorParameters | None = None) -> PolynomialPredictor:
    predictor = PolynomialPredictor(parameters)
    for k in range(int(until * 50) + 1):
        predictor.add(track(k / 50, *motion(k / 50)))
        predictor.predict()
    return predictor


def test_nothing_without_a_track() -> None:
    assert PolynomialPredictor().predict() is None


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("until", [0.0, 0.1, 0.5, 1.5, 4.0])
def test_straight_motion_goes_on(method: str, until: float) -> None:
    prediction = fed(straight, until, PredictorParameters(method=method)).predict()  # type: ignore[arg-type]
    assert prediction is not None
    for lead in (0.0, 0.5, 2.0, 5.0):
        pose = prediction.at(until + lead)
        want, rate = straight(until + lead)
        np.testing.assert_allclose(pose.position_ned, want[:3], atol=1e-5)
        np.testing.assert_allclose(pose.velocity_ned, rate[:3], atol=1e-5)
        assert wrap_angle(pose.yaw - want[3]) == pytest.approx(0.0, abs=1e-5)
        assert pose.yaw_rate == pytest.approx(0.2, abs=1e-5)


def test_paper_method_is_the_papers_regression() -> None:
    parameters = PredictorParameters(method="paper", samples=20, spacing=0.1)
    prediction = fed(cubic, 4.0, parameters).predict()
    assert prediction is not None
    times = np.arange(20) * 0.1  # eq. 1: t_i = i dt, the last one is now
    poses = np.array([cubic(4.0 - 1.9 + s)[0] for s in times])
    vandermonde = np.stack([times**3, times**2, times, np.ones(20)], axis=1)
    eta = np.linalg.solve(vandermonde.T @ vandermonde, vandermonde.T @ poses)  # eq. 2
    for lead in (0.3, 1.0, 3.0):
        s = 1.9 + lead
        want = np.array([s**3, s**2, s, 1.0]) @ eta  # eq. 3
        pose = prediction.at(4.0 + lead)
        np.testing.assert_allclose(np.append(pose.position_ned, pose.yaw)[:3], want[:3], atol=1e-6)
        assert wrap_angle(pose.yaw - want[3]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_rates_are_derivatives(method: str) -> None:
    prediction = fed(cubic, 4.0, PredictorParameters(method=method)).predict()  # type: ignore[arg-type]
    assert prediction is not None
    for t in (4.3, 5.5, 8.5):
        a, b, pose = prediction.at(t - 1e-4), prediction.at(t + 1e-4), prediction.at(t)
        np.testing.assert_allclose(pose.velocity_ned, (b.position_ned - a.position_ned) / 2e-4, atol=1e-5)
        np.testing.assert_allclose(pose.acceleration_ned, (b.velocity_ned - a.velocity_ned) / 2e-4, atol=1e-5)
        assert pose.yaw_rate == pytest.approx((b.yaw - a.yaw) / 2e-4, abs=1e-5)
    times = np.array([3.5, 4.0, 4.3, 5.5, 8.5, 12.0])
    want = np.array([prediction.at(float(t)).position_ned for t in times])
    np.testing.assert_allclose(prediction.positions_ned(times), want, atol=1e-9)


def test_velocity_is_held_beyond_the_cubic() -> None:
    prediction = fed(cubic).predict()
    assert prediction is not None
    end = prediction.at(4.0 + 2.0)
    later = prediction.at(4.0 + 5.0)
    np.testing.assert_allclose(later.velocity_ned, end.velocity_ned, atol=1e-12)
    np.testing.assert_allclose(later.position_ned, end.position_ned + 3.0 * end.velocity_ned, atol=1e-9)
    np.testing.assert_array_equal(later.acceleration_ned, np.zeros(3))


def noisy(seed: int, sigma: float) -> Motion:
    rng = np.random.default_rng(seed)

    def motion(t: float) -> tuple[np.ndarray, np.ndarray]:
        return sigma * rng.standard_normal(4), 3.0 * sigma * rng.standard_normal(4)

    return motion


def test_noise_does_not_explode_as_the_papers_does() -> None:
    far = {}
    for method in METHODS:
        misses = []
        for seed in range(10):
            prediction = fed(noisy(seed, 0.02), 3.0, PredictorParameters(method=method)).predict()  # type: ignore[arg-type]
            assert prediction is not None
            misses.append(np.linalg.norm(prediction.at(6.0).position_ned))
        far[method] = float(np.sqrt(np.mean(np.square(misses))))
    assert far["regularised"] < 0.25
    assert far["regularised"] < 0.5 * far["paper"]


@pytest.mark.parametrize("method", METHODS)
def test_covariance_grows_and_is_positive(method: str) -> None:
    prediction = fed(noisy(1, 0.01), 3.0, PredictorParameters(method=method)).predict()  # type: ignore[arg-type]
    assert prediction is not None
    last = np.zeros(4)
    for lead in (0.0, 0.5, 1.0, 2.0, 3.0, 5.0):
        covariance = prediction.at(3.0 + lead).covariance
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert (covariance.diagonal() > last).all()
        last = covariance.diagonal()


def test_calibration_widens_the_forecast_of_an_erratic_target_only() -> None:
    rng = np.random.default_rng(4)
    place = np.zeros(4)

    def erratic(t: float) -> tuple[np.ndarray, np.ndarray]:
        place[:3] += 0.05 * rng.standard_normal(3)
        return place.copy(), np.zeros(4)

    calm, wild = fed(straight, 6.0).predict(), fed(erratic, 6.0).predict()
    assert calm is not None
    assert wild is not None
    ratio = wild.at(7.0).covariance.diagonal() / calm.at(7.0).covariance.diagonal()
    assert ratio[:3].min() > 4.0
    assert ratio[3] == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_reset_takes_the_forecast_along(method: str) -> None:
    parameters = PredictorParameters(method=method)  # type: ignore[arg-type]
    before, after = with_and_without_reset(PolynomialPredictor(parameters), PolynomialPredictor(parameters))
    assert_taken_along(before, after, (4.0, 5.0, 7.0), atol=1e-6, covariance=(1e-6, 1e-9))


def test_history_is_dropped_at_an_unannounced_reset_a_gap_and_a_restart() -> None:
    elsewhere = np.array([80.0, -40.0, 0.0, 1.0])
    for changes, t in (({"counter": 4}, 4.02), ({}, 6.0), ({"began": 3.9}, 4.02)):
        predictor = fed(cubic)
        predictor.add(track(t, elsewhere, np.zeros(4), **changes))  # type: ignore[arg-type]
        prediction = predictor.predict()
        assert prediction is not None
        np.testing.assert_allclose(prediction.at(t + 3.0).position_ned, elsewhere[:3], atol=1e-6)


def test_old_tracks_are_ignored_and_memory_is_bounded() -> None:
    predictor = fed(straight, 10.0)
    predictor.add(track(5.0, np.full(4, 99.0), np.zeros(4)))
    prediction = predictor.predict()
    assert prediction is not None
    assert prediction.t == 10.0
    assert len(predictor._kept) <= 30
    assert len(predictor._calibration._pending) <= 20


def test_yaw_is_continuous_over_full_turns() -> None:
    def spinning(t: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([0.0, 0.0, 0.0, 2.5 * t]), np.array([0.0, 0.0, 0.0, 2.5])

    prediction = fed(spinning, 6.0).predict()
    assert prediction is not None
    assert prediction.at(7.0).yaw - prediction.at(6.0).yaw == pytest.approx(2.5, abs=1e-3)
    assert wrap_angle(prediction.at(7.0).yaw - 17.5) == pytest.approx(0.0, abs=1e-3)
    assert math.isfinite(prediction.at(60.0).yaw)
