"""The predictor by evidence: the evidence itself, dropouts, bounds, coverage."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from prediction_tracks import assert_taken_along, track, with_and_without_reset

from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import rotation_about_z
from companion.prediction.evidence import EvidencePredictor
from companion.prediction.evidence_forecast import EvidencePrediction
from companion.prediction.parameters import EvidenceParameters, PredictorParameters
from companion.prediction.segments import SegmentModel
from companion.prediction.standing import StandingPredictor

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "estimation"))

from estimation_world import Settings, build

from companion.estimation.consistency import chi_square_quantile, normalised_squared
from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator

Motion = Callable[[float], tuple[np.ndarray, np.ndarray]]


def straight(t: float) -> tuple[np.ndarray, np.ndarray]:
    rate = np.array([0.4, -0.3, 0.0, 0.0])
    return np.array([50.0, 10.0, -0.2, 3.0]) + rate * t, rate


def circle(t: float) -> tuple[np.ndarray, np.ndarray]:
    """0.4 m/s with 0.2 rad/s, driving 0.5 rad beside its own heading."""
    course = 0.2 * t
    place = np.array([2.0 * math.sin(course), 2.0 * (1.0 - math.cos(course)), -0.15, course - 0.5])
    return place, np.array([0.4 * math.cos(course), 0.4 * math.sin(course), 0.0, 0.2])


def sine(t: float) -> tuple[np.ndarray, np.ndarray]:
    phase = 2.0 * math.pi * t / 8.0
    cross = 0.5 * 2.0 * math.pi / 8.0 * math.cos(phase)
    pose = np.array([0.5 * t, 0.5 * math.sin(phase), 0.0, math.atan2(cross, 0.5)])
    return pose, np.array([0.5, cross, 0.0, 0.0])


def fed(motion: Motion, until: float, seed: int = 0, sigma: float = 0.0) -> EvidencePredictor:
    predictor, rng = EvidencePredictor(PredictorParameters()), np.random.default_rng(seed)
    for k in range(round(until * 50) + 1):
        pose, rate = motion(k / 50)
        predictor.add(track(k / 50, pose + sigma * rng.standard_normal(4), rate + sigma * rng.standard_normal(4)))
        predictor.predict()
    return predictor


def coast(predictor: EvidencePredictor, motion: Motion, begin: float, length: float, drift: float) -> None:
    """Feed what a filter that sees nothing gives: its last velocity, off by `drift` [m/s]."""
    last, rate = motion(begin)
    rate = rate + np.array([drift, -drift, 0.0, 0.0])
    for k in range(1, round(length * 50) + 1):
        since = k / 50
        predictor.add(track(begin + since, last + since * rate, rate, age=since + 0.05))


def forecast(predictor: EvidencePredictor) -> EvidencePrediction:
    prediction = predictor.predict()
    assert prediction is not None
    return prediction


def log_density(values: np.ndarray, covariance: np.ndarray) -> float:
    _, log_det = np.linalg.slogdet(covariance)
    return float(
        -0.5 * (values @ np.linalg.solve(covariance, values) + log_det + len(values) * math.log(2.0 * math.pi))
    )


def fed_model(parameters: EvidenceParameters, times: np.ndarray, poses: np.ndarray) -> SegmentModel:
    """Feed poses that are in the order of their age."""
    model = SegmentModel(parameters)
    for t, pose in zip(times[::-1], poses[::-1], strict=True):
        model.add_place(float(t), pose)
        model.add_heading(float(t), pose)
    return model


def test_evidence_is_the_density_of_the_poses_and_coefficients_are_the_posterior_mean() -> None:
    parameters, rng = EvidenceParameters(), np.random.default_rng(2)
    times = np.array([0.0, -0.25, -0.5, -3.1, -3.35, -3.6, -9.0, -9.25])
    poses = np.column_stack([rng.standard_normal((8, 3)), 1.0 + 0.3 * rng.standard_normal(8)])
    poses[:, :3] -= poses[0, :3]
    model = fed_model(parameters, times, poses)
    fits = model.polynomials(model.linear_products([5, 8]), model.heading_products([5, 8]))
    for w, m in enumerate((5, 8)):
        lag = np.abs(times[:m, None] - times[:m])
        for k in range(3):
            for axis in (1, 3):
                if axis < 3:
                    sigma, tau = parameters.deviation[k], parameters.deviation_time[k]
                    shape = (1.0 + lag / tau) * np.exp(-lag / tau)
                    prior = [parameters.place, parameters.speed, parameters.acceleration / 2.0, parameters.jerk / 6.0]
                else:
                    sigma, tau = parameters.deviation_heading[k], parameters.deviation_time_heading[k]
                    shape = np.exp(-lag / tau)
                    prior = [parameters.place_heading, *(parameters.turn_rate * np.array([1.0, 0.5, 0.1]))]
                noise = sigma**2 * (shape + 1e-4 * np.eye(m))
                y = poses[:m, axis] - poses[0, axis]
                for order in range(4):
                    basis = np.vander(times[:m], order + 1, increasing=True)
                    spread = basis @ np.diag(np.square(prior[: order + 1])) @ basis.T + noise
                    assert fits.evidence[order, axis, w, k] == pytest.approx(log_density(y, spread), rel=1e-6)
                    mean = np.diag(np.square(prior[: order + 1])) @ basis.T @ np.linalg.solve(spread, y)
                    only = np.zeros((4, 4, 2, 3))
                    only[order, axis, w, k] = 1.0
                    np.testing.assert_allclose(fits.mean(only)[: order + 1, axis], mean, rtol=1e-5, atol=1e-7)
                    late = np.array([1.0, 0.5, -0.2, 0.1])
                    chosen = late[: order + 1]
                    information = basis.T @ np.linalg.solve(noise, basis) + np.diag(np.square(prior[: order + 1]) ** -1)
                    square = (chosen @ mean) ** 2 + chosen @ np.linalg.solve(information, chosen)
                    assert fits.square(only, late)[axis] == pytest.approx(square, rel=1e-5)


def test_evidence_of_driving_along_the_heading_is_the_density_of_north_and_east() -> None:
    parameters, rng = EvidenceParameters(), np.random.default_rng(3)
    times = np.array([0.0, -0.25, -0.5, -2.1, -2.35, -2.6])
    poses = rng.standard_normal((6, 4))
    poses[:, :3] -= poses[0, :3]
    model = fed_model(parameters, times, poses)
    body = model.body(model.linear_products([6]))
    design = np.zeros((12, 4))  # north rows, then east rows; place, velocity along and to the right
    way = np.zeros((2, 2))
    for i in range(6):
        if i:
            turns = [rotation_about_z(float(poses[j, 3]))[:2, :2] for j in (i - 1, i)]
            way = way + 0.5 * (times[i] - times[i - 1]) * (turns[0] + turns[1])
        design[i, 0] = design[6 + i, 1] = 1.0
        design[i, 2:], design[6 + i, 2:] = way[0], way[1]
    prior = np.diag(np.square([parameters.place, parameters.place, parameters.speed, parameters.speed]))
    y = np.concatenate([poses[:, 0], poses[:, 1]])
    lag = np.abs(times[:, None] - times)
    for k in range(3):
        scaled = lag / parameters.deviation_time[k]
        one = parameters.deviation[k] ** 2 * ((1.0 + scaled) * np.exp(-scaled) + 1e-4 * np.eye(6))
        spread = design @ prior @ design.T + np.kron(np.eye(2), one)
        assert body.evidence[0, k] == pytest.approx(log_density(y, spread), rel=1e-6)
        mean = prior @ design.T @ np.linalg.solve(spread, y)
        found = [body.place[0, k].real, body.place[0, k].imag, body.velocity[0, k].real, body.velocity[0, k].imag]
        np.testing.assert_allclose(found, mean, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize(("motion", "most"), [(straight, 0.05), (circle, 0.25)])
def test_steady_motion_goes_on_for_ten_seconds(motion: Motion, most: float) -> None:
    prediction = forecast(fed(motion, 12.0, sigma=0.002))
    for lead in (0.5, 2.0, 5.0, 10.0):
        pose, (want, rate) = prediction.at(12.0 + lead), motion(12.0 + lead)
        assert np.linalg.norm(pose.position_ned - want[:3]) < most
        assert np.linalg.norm(pose.velocity_ned - rate[:3]) < most
        assert wrap_angle(pose.yaw - want[3]) == pytest.approx(0.0, abs=most)


def test_forecast_does_not_feed_on_its_own_coasted_states() -> None:
    predictor = fed(straight, 8.0, sigma=0.002)
    before = forecast(predictor)
    coast(predictor, straight, 8.0, 10.0, drift=0.2)
    after = forecast(predictor)
    assert after.t == 18.0
    for t in (18.0, 20.0):
        np.testing.assert_allclose(after.at(t).position_ned, before.at(t).position_ned, atol=0.05)
    assert np.linalg.norm(after.at(18.0).position_ned - straight(18.0)[0][:3]) < 0.15


def test_history_survives_a_dropout() -> None:
    predictor = fed(straight, 8.0, sigma=0.002)
    coast(predictor, straight, 8.0, 10.0, drift=0.2)
    for k in range(50):
        t = 18.02 + k / 50
        predictor.add(track(t, *straight(t)))
    later = forecast(predictor)
    assert np.linalg.norm(later.at(30.0).position_ned - straight(30.0)[0][:3]) < 0.15


def test_covariance_grows_through_a_dropout_and_is_positive() -> None:
    predictor = fed(sine, 10.0, sigma=0.01)
    last = np.zeros(4)
    for length in (0.0, 1.0, 3.0, 6.0, 10.0):
        covariance = forecast(predictor).at(10.0 + length).covariance
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert (covariance.diagonal() >= last).all()
        last = covariance.diagonal()


@pytest.mark.parametrize("seed", range(5))
def test_forecast_stays_within_what_the_target_has_shown(seed: int) -> None:
    """A cubic through such a track leads hundreds of metres away in 10 s."""
    predictor = fed(sine, 3.0 + 1.7 * seed, seed, sigma=0.03)
    prediction = forecast(predictor)
    shown = predictor._shown
    assert shown.speed < 0.8
    start = prediction.at(prediction.t)
    for lead in np.arange(0.5, 15.0, 0.5):
        pose = prediction.at(prediction.t + float(lead))
        assert np.hypot(*pose.velocity_ned[:2]) < shown.speed + 0.3 * math.exp(-float(lead)) + 0.05
        assert np.hypot(*(pose.position_ned - start.position_ned)[:2]) < shown.speed * lead + 0.3


def test_rates_are_derivatives_of_the_motion() -> None:
    prediction = forecast(fed(circle, 6.0, sigma=0.01))
    for lead in (0.3, 1.5, 4.5, 9.0):
        t = 6.0 + lead
        a, b, pose = prediction.at(t - 1e-4), prediction.at(t + 1e-4), prediction.at(t)
        np.testing.assert_allclose(pose.velocity_ned, (b.position_ned - a.position_ned) / 2e-4, atol=1e-5)
        assert pose.yaw_rate == pytest.approx((b.yaw - a.yaw) / 2e-4, abs=1e-5)
    times = np.array([5.5, 6.0, 6.3, 7.5, 10.5, 19.0])
    want = np.array([prediction.at(float(t)).position_ned for t in times])
    np.testing.assert_allclose(prediction.positions_ned(times), want, atol=1e-9)


def test_reset_takes_the_forecast_along() -> None:
    before, after = with_and_without_reset(
        EvidencePredictor(PredictorParameters()), EvidencePredictor(PredictorParameters())
    )
    assert_taken_along(before, after, (4.0, 5.0, 9.0, 14.0), atol=1e-5, covariance=(1e-4, 1e-7))


def test_same_track_gives_the_same_bits() -> None:
    a, b = forecast(fed(sine, 5.0, 1, 0.02)), forecast(fed(sine, 5.0, 1, 0.02))
    for lead in (0.0, 1.0, 7.0):
        np.testing.assert_array_equal(a.at(5.0 + lead).position_ned, b.at(5.0 + lead).position_ned)
        np.testing.assert_array_equal(a.at(5.0 + lead).covariance, b.at(5.0 + lead).covariance)


def test_memory_is_bounded_and_old_tracks_are_ignored() -> None:
    predictor = fed(straight, 30.0)
    predictor.add(track(5.0, np.full(4, 99.0), np.zeros(4)))
    assert forecast(predictor).t == 30.0
    assert len(predictor._choice.times) <= predictor.parameters.evidence.samples


@pytest.mark.parametrize("motion", ["static", "straight", "stop_and_go", "random"])
def test_covariance_covers_what_comes_up_to_ten_seconds_ahead(motion: str) -> None:
    """In a world with wandering odometry and tilt errors: at least 85 % within the bounds of 95 %, at every lead."""
    bound, inside = chi_square_quantile(0.95, 3), {lead: [] for lead in (1.0, 3.0, 10.0)}
    for seed in range(3):
        run = build(50 + seed, Settings(motion=motion, duration=32.0))
        history, estimator, predictor = OwnshipHistory(), TargetEstimator(), EvidencePredictor(PredictorParameters())
        k = 0
        for number, state in enumerate(run.ownships):
            history.add(state)
            while k < len(run.measurements) and run.measurements[k][0] <= state.t:
                estimator.update(run.measurements[k][1], history)
                k += 1
            found = estimator.track(state.t, history) if number % 5 == 0 else None
            if found is None:
                continue
            predictor.add(found)
            prediction = forecast(predictor)
            if found.t < 6.0 or found.t > 21.0:
                continue
            for lead, hits in inside.items():
                pose = prediction.at(found.t + lead)
                miss = np.append(pose.position_ned, pose.yaw) - run.apparent(found.t + lead)
                miss[3] = wrap_angle(float(miss[3]))
                chosen = np.ix_([0, 1, 3], [0, 1, 3])
                hits.append(normalised_squared(miss[[0, 1, 3]], pose.covariance[chosen]) < bound)
    for lead, hits in inside.items():
        assert np.mean(hits) > 0.85, lead


def test_what_belongs_to_another_track_is_forgotten() -> None:
    """As where the filter changes its mind which measurements were real, and the other track is long begun too."""
    predictor, standing = fed(straight, 10.0), StandingPredictor(PredictorParameters())
    standing.add(track(10.0, *straight(10.0)))
    elsewhere = np.array([80.0, -40.0, 0.0, 1.0])
    for each in (predictor, standing):
        each.add(track(10.02, elsewhere, np.zeros(4), began=7.0, age=0.5))
        for k in range(2, 30):
            each.add(track(10.0 + 0.02 * k, elsewhere, np.zeros(4), began=7.0, age=0.02 * k))
        prediction = each.predict()
        assert prediction is not None
        for ahead in (0.0, 3.0):
            np.testing.assert_allclose(prediction.at(10.58 + ahead).position_ned, elsewhere[:3], atol=0.01)
