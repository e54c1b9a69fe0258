"""Which measurements are real: half of them random, at any rate."""

from __future__ import annotations

import math

import numpy as np
import pytest
from estimation_flights import Watching, error, fly
from estimation_world import Run, Settings, build, corrupted

from companion.estimation.target_ekf import TargetEstimator
from companion.estimation.target_filter import predict
from companion.estimation.target_model import TargetEstimatorParameters
from companion.messages.target import MeasurementVerdict

FUSED, REJECTED = MeasurementVerdict.FUSED, MeasurementVerdict.REJECTED_GATE
PLACE = (0.0, 0.0, 3.0)  # [m]


def rms(run: Run, settled: float) -> float:
    tracks = fly(run, TargetEstimator(), rate_divisor=5)
    return math.sqrt(np.mean([float(np.sum(np.square(error(run, k)[:3]))) for k in tracks if k.t > settled]))


@pytest.mark.parametrize("motion", ["static", "straight", "random"])
def test_half_of_the_measurements_may_be_random(motion: str) -> None:
    """At 30 Hz they cost next to nothing."""
    for seed in range(2):
        run = build(70 + seed, Settings(motion=motion, duration=10.0, dropout=0.0))
        assert rms(corrupted(run, 0.5, seed), 3.0) <= 1.2 * rms(run, 3.0)


@pytest.mark.parametrize("motion", ["static", "circle", "stop_and_go"])
@pytest.mark.parametrize("rate", [5.0, 2.0, 1.0])
def test_at_any_rate_as_good_as_a_filter_told_which_are_random(motion: str, rate: float) -> None:
    """Most of the time: now and then a random one fits. Then it is found out within a few measurements."""
    ratios = []
    for seed in range(4):
        run = build(80 + seed, Settings(motion=motion, duration=24.0, dropout=0.0, rate=rate, wander=0.3))
        settled = 5.0 + 8.0 / rate
        told = rms(corrupted(run, 0.5, seed, told=True), settled)
        ratios.append(rms(corrupted(run, 0.5, seed), settled) / told)
    assert np.median(ratios) <= 1.1
    assert max(ratios) <= 4.0


def test_a_track_that_began_with_a_random_measurement_is_given_up() -> None:
    vehicle, rng = Watching(), np.random.default_rng(1)
    vehicle.see(2.4, (1.0, -0.5, 5.0))
    verdicts = []
    for k in range(40):
        north, east, down = rng.uniform((-2.0, -2.0, 0.5), (2.0, 2.0, 6.0)).tolist()
        verdicts.append(vehicle.see(2.5 + k / 30, PLACE if k % 2 == 0 else (north, east, down)))
    assert MeasurementVerdict.INITIALISED in verdicts[:4]
    np.testing.assert_allclose(vehicle.track(3.9).state[:3], PLACE, atol=0.05)


def test_a_track_not_seen_for_long_takes_two_that_agree_not_just_any() -> None:
    """However wide its own gate has become; and what is real again shows at once."""
    vehicle = Watching()
    for k in range(30):
        vehicle.see(1.0 + k / 30, PLACE)
    assert vehicle.see(11.0, (1.0, 0.5, 3.2), heading=0.4) is REJECTED  # it could have come there
    assert vehicle.see(11.1, (-1.5, 1.0, 2.0), heading=-2.0) is REJECTED
    vehicle.see(11.2, PLACE)
    assert vehicle.see(11.3, PLACE) is FUSED
    track = vehicle.track(11.4)
    np.testing.assert_allclose(track.state[:3], PLACE, atol=0.05)
    assert math.sqrt(track.covariance[0, 0]) < 0.2


def test_while_in_doubt_the_covariance_holds_both_places() -> None:
    vehicle = Watching()
    vehicle.see(2.5, (1.0, 0.0, 3.0))
    alone = vehicle.track(2.6).covariance
    vehicle.see(2.6, (-1.5, 0.0, 3.0))
    torn = vehicle.track(2.6)
    assert torn.state[0] == pytest.approx(1.0, abs=0.1)
    assert torn.covariance[0, 0] > 0.2 * 2.5**2
    assert torn.covariance[1, 1] == pytest.approx(alone[1, 1], rel=0.2)


@pytest.mark.parametrize(("rate", "speed"), [(30.0, 1.5), (5.0, 1.0)])
def test_a_target_that_sets_off_suddenly_is_not_lost(rate: float, speed: float) -> None:
    vehicle, verdicts, gone, t = Watching(), [], 0.0, 0.0
    for k in range(int(6.0 * rate)):
        t = 1.0 + k / rate
        gone = speed * max(0.0, t - 3.0)
        verdicts.append(vehicle.see(t, (gone, 0.0, 3.0)))
    assert verdicts.count(MeasurementVerdict.INITIALISED) == 1
    assert verdicts.count(REJECTED) <= 1
    track = vehicle.track(t)
    assert track.state[0] == pytest.approx(gone, abs=0.05)
    assert track.state[4] == pytest.approx(speed, abs=0.1)


def test_a_sudden_change_takes_a_target_no_farther_than_it_may() -> None:
    """However much its usual random walk is: 0.4 m beside a slow one is no manoeuvre of half a second."""
    slow = TargetEstimatorParameters(
        wander_horizontal=0.009, acceleration_horizontal=0.008, manoeuvre_horizontal=0.1, mount_sigma=0.0
    )
    vehicle = Watching(slow)
    for k in range(20):
        vehicle.see(1.0 + 0.5 * k, (0.02 * k, 0.0, 3.0))
    estimator = vehicle.estimator
    state = estimator._records[-1].after.believed
    variances = [predict(state, 11.0, estimator._tuning, manoeuvre=sudden)[1][0, 0] for sudden in (False, True)]
    assert variances[1] - variances[0] == pytest.approx(0.1**2 * 0.5, rel=0.1)
    assert vehicle.see(11.0, (0.78, 0.0, 3.0)) is REJECTED


def test_what_is_remembered_is_bounded() -> None:
    parameters = TargetEstimatorParameters(hypotheses=5)
    estimator = TargetEstimator(parameters)
    fly(corrupted(build(4, Settings(duration=8.0, rate=5.0)), 0.9, 2), estimator)
    assert max(len(record.after.ranked) for record in estimator._records) == 5


def test_a_track_says_when_another_is_believed_however_long_that_has_been_growing() -> None:
    """The forecast must know that what it keeps belongs to the old one: many measurements make no track old."""
    vehicle = Watching()
    began = []
    for k in range(60):
        # the track begins on one thing, from a third of a second on most measurements show another one
        there = k < 10 or k % 4 == 0
        vehicle.see(2.0 + k / 30, (1.5, 0.5, 3.0) if there else PLACE)
        began.append(vehicle.track(2.0 + k / 30).t_began)
    assert began[:10] == [2.0] * 10
    assert began[-1] == pytest.approx(2.0 + 10 / 30)
    assert len(set(began)) == 2
    np.testing.assert_allclose(vehicle.track(4.0).state[:3], PLACE, atol=0.05)
