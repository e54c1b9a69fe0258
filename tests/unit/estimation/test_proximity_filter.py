"""Proximity filter: models against finite differences, order of arrival, gates, reopening, both structures alike."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from proximity_world import DOCKING, SETUP, START_COVARIANCE, Arrival, World, build, feed, give

from companion.estimation.proximity.covariance import split, swing_of
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.fusion import Fusion, Verdict
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.snapshot import Mover
from companion.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion, rotation_from_vector
from companion.messages.proximity import FeatureReading, GyroReading, NozzlePulses, ProximityState, RangeReading

STRUCTURES = ("tandem", "compounded")
SHORT = World(duration=2.5, begin=(0.9, 1.6, 0.9), turn_from=0.5, vision_from=1.2)
TURNED = rotation_from_vector(np.array([0.3, -0.8, 0.4]))


def standing(position=(1.0, 1.6, 1.0), rotation=DOCKING, covariance=START_COVARIANCE, t=0.0) -> ProximityState:
    return ProximityState(
        t=t,
        position=np.array(position),
        velocity=np.zeros(3),
        quaternion=quaternion_from_rotation(rotation),
        rate=np.zeros(3),
        covariance=covariance,
        mahalanobis=0.0,
        t_vision=-math.inf,
        t_range=-math.inf,
    )


def markers_seen(position, rotation) -> np.ndarray:
    return SETUP.d_from_cam.inverse().apply((SETUP.markers_in_c - np.array(position)) @ rotation)


def picture(t, position=(1.0, 1.6, 1.0), rotation=DOCKING) -> FeatureReading:
    return FeatureReading(t=t, markers=tuple(range(6)), positions=markers_seen(position, rotation))


def distance(anchor, position=(1.0, 1.6, 1.0), rotation=DOCKING) -> float:
    return float(np.linalg.norm(np.array(position) + rotation @ SETUP.lever_arm - SETUP.anchors[anchor]))


def command(t, force) -> NozzlePulses:
    return NozzlePulses(t=t, on_times=(), force=np.array(force), torque=np.zeros(3))


@pytest.mark.parametrize(
    ("structure", "axis"), [("tandem", k) for k in range(6)] + [("compounded", k) for k in range(9)]
)
def test_a_range_moves_the_estimate_along_its_gradient(structure, axis):
    """The filter's correction is P H' / S times the innovation; H by differences of the range."""
    step = np.zeros(9)
    step[axis] = 1e-6
    moved = distance(1, np.array([0.2, 1.1, 0.3]) + step[:3], TURNED @ rotation_from_vector(step[6:]))
    gradient = (moved - distance(1, (0.2, 1.1, 0.3), TURNED)) / 1e-6
    variances = np.full(9, 1e-12)
    variances[axis] = 1e-4
    estimator = ProximityFilter(
        SETUP, ProximityParameters(structure=structure), standing((0.2, 1.1, 0.3), TURNED, np.diag(variances))
    )
    verdict = estimator.range(RangeReading(t=0.0, anchor=1, range=distance(1, (0.2, 1.1, 0.3), TURNED) + 0.01))
    after = estimator.state(0.0)
    expected = 0.01 * 1e-4 * gradient / (1e-4 * gradient**2 + 0.02**2)
    turned = rotation_from_quaternion(after.quaternion)
    found = np.concatenate([after.position - [0.2, 1.1, 0.3], after.velocity, _small(TURNED.T @ turned)])
    assert verdict.accepted
    assert found[axis] == pytest.approx(expected, rel=1e-3, abs=1e-12)


def _small(rotation):
    return 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )


@pytest.mark.parametrize("structure", STRUCTURES)
def test_exact_pictures_lead_to_the_exact_pose(structure):
    wrong = standing((1.02, 1.57, 1.03), DOCKING @ rotation_from_vector(np.array([0.03, -0.02, 0.025])))
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), wrong)
    for k in range(60):
        estimator.gyro(GyroReading(t=0.05 * k, rate=np.zeros(3)))
        assert all(verdict.accepted for verdict in estimator.features(picture(0.05 * k)))
    after = estimator.state(2.95)
    assert np.allclose(after.position, [1.0, 1.6, 1.0], atol=4e-4)
    assert np.linalg.norm(_small(DOCKING.T @ rotation_from_quaternion(after.quaternion))) < 6e-4
    assert after.t_vision == pytest.approx(2.95)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_command_pushes_for_one_period_in_the_body_s_direction(structure):
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), standing(rotation=TURNED))
    estimator.command(command(0.0, (0.02, 0.0, 0.0)))
    velocity = estimator.state(0.5).velocity
    assert np.allclose(velocity, TURNED[:, 0] * 0.01 * 0.1, atol=1e-12)
    assert np.allclose(estimator.state(0.05).velocity, 0.5 * velocity, atol=1e-12)
    assert np.allclose(estimator.state(0.5).position - [1.0, 1.6, 1.0], velocity * 0.45, atol=1e-12)


def test_the_gyro_is_integrated_trapezoidally():
    """A rate that grows evenly is integrated exactly; held readings would lag by half an interval."""
    estimator = ProximityFilter(SETUP, ProximityParameters(), standing(rotation=np.eye(3)))
    for k in range(101):
        estimator.gyro(GyroReading(t=0.01 * k, rate=np.array([0.0, 0.0, 0.1 * 0.01 * k])))
    turned = rotation_from_quaternion(estimator.state(1.0).quaternion)
    assert math.atan2(turned[1, 0], turned[0, 0]) == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("structure", STRUCTURES)
@given(order=st.randoms(use_true_random=False))
@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_the_result_does_not_depend_on_the_order_of_arrival(structure, order):
    initial, _, arrivals = build(3, SHORT)
    arrivals = [arrival for arrival in arrivals if arrival.t < 1.6]
    parameters = ProximityParameters(structure=structure, history=3.0)
    in_time, shuffled = (ProximityFilter(SETUP, parameters, initial) for _ in range(2))
    for arrival in sorted(arrivals, key=lambda a: a.reading.t):
        give(in_time, arrival.reading)
    for arrival in sorted(arrivals, key=lambda a: a.reading.t + 0.3 * order.random()):
        give(shuffled, arrival.reading)
    a, b = in_time.state(1.6), shuffled.state(1.6)
    assert np.array_equal(a.covariance, b.covariance)
    assert np.array_equal(a.position, b.position)
    assert np.array_equal(a.quaternion, b.quaternion)
    assert a.mahalanobis == b.mahalanobis


def test_a_reading_may_be_late_but_not_older_than_the_history_and_never_twice():
    estimator = ProximityFilter(SETUP, ProximityParameters(), standing())
    for k in range(300):
        estimator.gyro(GyroReading(t=0.01 * k, rate=np.zeros(3)))
    late = RangeReading(t=2.7, anchor=0, range=distance(0))
    assert estimator.range(late).accepted
    assert estimator.range(late).reason == "duplicate"
    assert estimator.range(replace(late, anchor=1, range=distance(1))).accepted
    assert estimator.range(replace(late, t=1.7)).reason == "late"
    assert not estimator.gyro(GyroReading(t=1.0, rate=np.zeros(3)))
    assert not estimator.gyro(GyroReading(t=2.5, rate=np.zeros(3)))
    assert not estimator.command(command(0.5, (0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="history begins"):
        estimator.state(0.5)


def test_what_makes_no_sense_is_refused_and_changes_nothing():
    estimator = ProximityFilter(SETUP, ProximityParameters(), standing())
    before = estimator.state(1.0)
    assert estimator.range(RangeReading(t=0.1, anchor=4, range=1.0)).reason == "unknown"
    assert estimator.range(RangeReading(t=0.1, anchor=0, range=math.nan)).reason == "not finite"
    assert not estimator.gyro(GyroReading(t=0.1, rate=np.array([0.0, math.inf, 0.0])))
    assert not estimator.command(command(0.1, (math.nan, 0.0, 0.0)))
    twice = FeatureReading(t=0.1, markers=(1, 1), positions=np.zeros((2, 3)))
    assert [verdict.reason for verdict in estimator.features(twice)] == ["unknown", "unknown"]
    assert estimator.features(FeatureReading(t=0.1, markers=(), positions=np.zeros((0, 3)))) == ()
    assert np.array_equal(before.covariance, estimator.state(1.0).covariance)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_one_wrong_marker_is_left_out_alone(structure):
    covariance = START_COVARIANCE * 0.01
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), standing(covariance=covariance))
    good = picture(0.0)
    moved = np.array(good.positions)
    moved[2] += [0.05, 0.0, 0.0]
    verdicts = estimator.features(FeatureReading(t=0.0, markers=good.markers, positions=moved))
    assert [verdict.accepted for verdict in verdicts] == [True, True, False, True, True, True]
    assert {verdict.degrees for verdict in verdicts} == {3}
    assert np.allclose(estimator.state(0.0).position, [1.0, 1.6, 1.0], atol=1e-9)


def test_the_gate_is_the_chi_square_quantile_of_the_distance_without_underweighting():
    parameters = ProximityParameters(underweighting_ratio=1e-3)
    covariance = 1e-14 * np.eye(9)
    for sigmas, accepted in ((3.88, True), (3.90, False)):
        estimator = ProximityFilter(SETUP, parameters, standing(covariance=covariance))
        verdict = estimator.range(RangeReading(t=0.0, anchor=0, range=distance(0) + sigmas * 0.02))
        assert verdict.accepted is accepted
        assert verdict.squared_distance == pytest.approx(sigmas**2, rel=1e-6)


def test_underweighting_keeps_more_of_the_covariance():
    def after(share: float) -> float:
        estimator = ProximityFilter(SETUP, ProximityParameters(underweighting=share), standing())
        estimator.features(picture(0.0))
        return float(np.trace(estimator.state(0.0).covariance[:3, :3]))

    assert after(0.2) > 1.5 * after(0.0)


def test_pictures_are_primary_until_they_cease():
    estimator = ProximityFilter(SETUP, ProximityParameters(), standing())
    estimator.features(picture(0.1))
    assert estimator.range(RangeReading(t=0.5, anchor=0, range=distance(0))).reason == "vision is primary"
    assert estimator.range(RangeReading(t=0.7, anchor=0, range=distance(0))).accepted
    both = ProximityFilter(SETUP, ProximityParameters(ranges_with_vision=True), standing())
    both.features(picture(0.1))
    assert both.range(RangeReading(t=0.5, anchor=0, range=distance(0))).accepted


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_filter_that_is_wrong_and_sure_opens_its_gate_again(structure):
    """Half a metre wrong, one millimetre sure: everything is rejected, then it is admitted and mended."""
    initial = standing((1.0, 1.1, 1.0), covariance=1e-6 * np.eye(9))
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), initial)
    verdicts: list[Verdict] = []
    for k in range(300):
        verdicts.append(estimator.range(RangeReading(t=0.02 * k, anchor=k % 4, range=distance(k % 4))))
        if k == 20:
            assert estimator.state(0.02 * k).mahalanobis > 3.9
    assert not any(verdict.accepted for verdict in verdicts[:25])
    assert estimator.reopenings >= 1
    assert np.allclose(estimator.state(6.0).position, [1.0, 1.6, 1.0], atol=0.02)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_an_outlier_that_is_believed_at_the_start_is_mended_soon(structure):
    """0.19 m pass the gate of an uncertain start and displace the estimate; suiting outliers do not save it."""
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), standing())
    assert estimator.range(RangeReading(t=0.0, anchor=0, range=distance(0) + 0.19)).accepted
    assert np.linalg.norm(estimator.state(0.0).position - [1.0, 1.6, 1.0]) > 0.1
    for k in range(1, 100):
        outlier = 0.15 if k % 20 == 4 else 0.0
        estimator.range(RangeReading(t=0.02 * k, anchor=k % 4, range=distance(k % 4) + outlier))
    assert estimator.reopenings == 1
    assert np.allclose(estimator.state(2.0).position, [1.0, 1.6, 1.0], atol=0.02)


def test_rare_rejections_open_nothing():
    estimator = ProximityFilter(SETUP, ProximityParameters(), standing(covariance=1e-6 * np.eye(9)))
    for k in range(5):
        assert not estimator.range(RangeReading(t=3.0 * k, anchor=0, range=5.0)).accepted
    assert estimator.reopenings == 0


def test_outliers_do_not_raise_the_distance_but_a_wrong_filter_does():
    quiet = feed(build(5, replace(SHORT, vision_from=math.inf, outliers=0.05)), ProximityParameters(), 0.5)[1][-1]
    assert 0.5 < quiet.mahalanobis < 1.5


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_bias_of_the_gyro_is_found_if_it_is_asked_for(structure):
    bias = np.array([2e-4, -1e-4, 1.5e-4])
    initial, _, arrivals = build(4, World(duration=12.0, moving=False, vision_from=0.0, outliers=0.0))
    parameters = ProximityParameters(structure=structure, gyro_bias=True, gyro_bias_std=2e-4)
    estimator = ProximityFilter(SETUP, parameters, initial)
    blind = ProximityFilter(SETUP, replace(parameters, gyro_bias=False), initial)
    for arrival in arrivals:
        reading = arrival.reading
        if isinstance(reading, GyroReading):
            reading = GyroReading(t=reading.t, rate=reading.rate + bias)
        for one in (estimator, blind):
            give(one, reading)
    assert np.linalg.norm(estimator.gyro_bias - bias) < 0.6 * np.linalg.norm(bias)
    assert np.array_equal(blind.gyro_bias, np.zeros(3))
    assert estimator.state(12.0).covariance.shape == (9, 9)


def test_parting_and_joining_at_any_point_gives_the_covariance_back():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((6, 6))
    turned = rng.standard_normal((3, 3))
    blocks = np.zeros((9, 9))
    blocks[:6, :6], blocks[6:, 6:] = root @ root.T, turned @ turned.T
    lever = np.array([0.4, -0.2, 0.7])
    rate = (0.1, -0.2, 0.05)
    tandem = split(blocks, TURNED, np.zeros(3), rate)._replace(lever=lever, swing=swing_of(rate, lever))
    again = split(tandem.joint(TURNED), TURNED, lever, rate)
    assert np.allclose(again.translation, tandem.translation, atol=1e-12)
    assert np.allclose(again.rotation, tandem.rotation, atol=1e-12)
    assert np.linalg.eigvalsh(tandem.joint(TURNED)).min() > 0.0


@pytest.mark.parametrize("structure", STRUCTURES)
def test_the_covariance_stays_positive_definite(structure):
    """Many excellent measurements, hardly any process noise; `bench/proximity.py --updates 100000` does 1e5."""
    rng = np.random.default_rng(2)
    parameters = ProximityParameters(
        structure=structure, acceleration_noise=1e-7, gyro_noise=1e-8, range_std=1e-5, gate_probability=1.0 - 1e-16
    )
    fusion, mover = Fusion(SETUP, parameters), Mover(SETUP, parameters)
    s = mover.first(standing(covariance=1e4 * START_COVARIANCE), SETUP, parameters)
    for k in range(12_000):
        s = mover.moved(s, s.t + 1e-3)
        place = s.position + rotation_from_quaternion(np.array(s.quaternion)) @ SETUP.lever_arm
        anchor = int(rng.integers(4))
        s, _ = fusion.range(s, anchor, float(np.linalg.norm(place - SETUP.anchors[anchor])))
        if k % 1000 == 0:
            joint = s.covariance.joint(rotation_from_quaternion(np.array(s.quaternion)))
            assert np.array_equal(joint, joint.T) or np.allclose(joint, joint.T, rtol=1e-12)
            assert np.linalg.eigvalsh(joint).min() > 0.0


def test_impossible_setups_say_what_would_be_right():
    for change, message in (
        ({"anchors": np.zeros((0, 3))}, "1 to 8"),
        ({"anchors": np.zeros((9, 3))}, "1 to 8"),
        ({"anchors": np.array([[0.0, math.nan, 0.0]])}, "finite"),
        ({"markers": np.zeros(3)}, r"\(M, 3\)"),
        ({"mass": 0.0}, "positive"),
    ):
        fields = {
            name: getattr(SETUP, name)
            for name in ("anchors", "lever_arm", "markers", "c_from_t", "d_from_cam", "mass", "control_period")
        }
        with pytest.raises(ValueError, match=message):
            ProximitySetup(**(fields | change))


def test_verdicts_of_arrivals_tell_outliers_apart():
    seen: list[tuple[Arrival, Verdict]] = []
    world = World(duration=8.0, begin=(0.5, 1.4, 0.5))
    feed(
        build(6, world),
        ProximityParameters(),
        0.5,
        lambda a, v: seen.append((a, v)) if isinstance(v, Verdict) else None,
    )
    later = [(arrival, verdict) for arrival, verdict in seen if arrival.t > 3.0]
    assert sum(arrival.outlier for arrival, _ in later) > 5
    assert all(verdict.accepted is not arrival.outlier for arrival, verdict in later)


def test_both_structures_agree_where_they_must():
    """A standing vehicle and ranges alone: the radio's place is known equally well, whatever keeps the covariance."""
    run = build(7, World(duration=4.0, moving=False, vision_from=math.inf, outliers=0.0))
    a, b = (feed(run, ProximityParameters(structure=structure), 4.0)[1][-1] for structure in STRUCTURES)
    assert np.allclose(a.position, b.position, atol=2e-5)
    assert np.allclose(a.covariance[:6, :6], b.covariance[:6, :6], rtol=0.02, atol=1e-7)
    assert np.allclose(np.diag(a.covariance), np.diag(b.covariance), rtol=0.02)
