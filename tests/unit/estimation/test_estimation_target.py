"""The target's filter: Jacobians, consistency, invariances, late measurements, gate and restart."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from estimation_flights import error, fly, history_of, resting_history, still
from estimation_world import Settings, build, corrupted

from companion.estimation.consistency import average_bounds, fraction_inside, normalised_squared
from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator
from companion.estimation.target_model import (
    TargetEstimatorParameters,
    acceleration_densities,
    add_process_noise,
    expected_measurement,
    measurement_jacobian,
    transition,
    wander_densities,
)
from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import rotation_about_z, rotation_from_euler, rotation_from_vector, yaw_of
from companion.messages.ownship import OwnshipState
from companion.messages.target import MeasurementVerdict, TargetMeasurement

HEIGHT_OFF = np.array([0.0, 0.0, 0.002])  # [m]


@pytest.mark.parametrize("seed", range(5))
def test_measurement_jacobian_is_the_derivative(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean = rng.normal(size=12)
    mean[8:] *= 0.02
    origin = rng.normal(size=3) * 3.0
    axes = rotation_from_euler(0.2, -0.1, rng.uniform(-3.0, 3.0))[:, :2]
    jacobian = measurement_jacobian(mean, origin, axes)
    for i in range(12):
        bump = np.zeros(12)
        bump[i] = 1e-6
        change = expected_measurement(mean + bump, origin, axes) - expected_measurement(mean - bump, origin, axes)
        slope = change / 2e-6
        np.testing.assert_allclose(jacobian[:, i], slope, atol=1e-8)


def test_prediction_in_two_steps_equals_one() -> None:
    parameters = TargetEstimatorParameters()
    acceleration, wander = acceleration_densities(parameters), wander_densities(parameters)
    covariance = np.diag(np.arange(1.0, 13.0)) * 0.01

    def moved(p: np.ndarray, dt: float) -> np.ndarray:
        f = transition(dt, parameters)
        out = f @ p @ f.T
        add_process_noise(out, dt, acceleration, wander, parameters)
        return out

    np.testing.assert_allclose(moved(moved(covariance, 0.3), 0.5), moved(covariance, 0.8), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("motion", ["static", "straight"])
def test_consistent_over_fifty_runs(motion: str) -> None:
    rows = []
    for seed in range(50):
        run = build(seed, Settings(motion=motion, duration=10.0))
        tracks = fly(run, TargetEstimator(TargetEstimatorParameters(mount_sigma=0.0)), rate_divisor=5)
        rows.append([normalised_squared(error(run, k), k.covariance[:4, :4]) for k in tracks if k.t > 2.0])
    epochs = min(map(len, rows))
    assert fraction_inside(np.array([row[:epochs] for row in rows]), 4) >= 0.9


def test_mount_error_stays_in_the_covariance_however_long_the_pad_is_seen() -> None:
    sigma = 0.05
    level = Settings(motion="static", duration=5.0, tilt_bias=(0.0, 0.0), tilt_wander=(0.0, 0.0))
    parameters = TargetEstimatorParameters(
        mount_sigma=sigma, tilt_bias_roll=0.0, tilt_bias_pitch=0.0, tilt_wander_roll=0.0, tilt_wander_pitch=0.0
    )
    nees, blind = [], []
    for seed in range(40):
        run = build(seed, level)
        offset = np.random.default_rng(1000 + seed).normal(size=3) * sigma
        measurements = [(t, replace(m, position_level=m.position_level + offset)) for t, m in run.measurements]
        askew = replace(run, measurements=measurements)
        for values, used in ((nees, parameters), (blind, replace(parameters, mount_sigma=0.0))):
            last = fly(askew, TargetEstimator(used))[-1]
            values.append(normalised_squared(error(run, last)[:3], last.covariance[:3, :3]))
    low, high = average_bounds(3, 40, 0.999)
    assert low < np.mean(nees) < high
    assert np.mean(blind) > 2.0 * high


def test_a_height_or_heading_a_little_wrong_does_not_shift_the_target() -> None:
    sharp = Settings(motion="static", duration=6.0, noise_lateral=0.0004, noise_range=0.0001, noise_heading=0.0001)
    run = build(11, sharp)
    off = [
        (t, replace(m, position_level=m.position_level + sign * HEIGHT_OFF, heading=m.heading + sign * 0.001))
        for number, (t, m) in enumerate(run.measurements)
        for sign in ((-1.0, 1.0)[number % 2],)
    ]
    pairs = zip(fly(run, TargetEstimator()), fly(replace(run, measurements=off), TargetEstimator()), strict=True)
    shifts = [float(np.hypot(*(a.state[:2] - b.state[:2]))) for a, b in pairs if a.t > 2.0]
    assert len(shifts) > 100
    assert max(shifts) < 0.005


@pytest.mark.parametrize("model", ["augmented", "sliding_window"])
@pytest.mark.parametrize("motion", ["static", "straight", "random", "stop_and_go"])
def test_tracks_every_motion(model: str, motion: str) -> None:
    run = build(7, Settings(motion=motion, tilt_bias=(0.0, 0.0), tilt_wander=(0.0, 0.0)))
    tracks = [k for k in fly(run, TargetEstimator(TargetEstimatorParameters(velocity_model=model))) if k.t > 2.0]
    errors = np.array([error(run, k) for k in tracks])
    assert np.sqrt(np.mean(np.sum(errors[:, :3] ** 2, axis=1))) < 0.04
    assert np.sqrt(np.mean(errors[:, 3] ** 2)) < (0.06 if motion == "random" else 0.012)
    for track in tracks[:: len(tracks) // 10]:
        assert np.linalg.eigvalsh(track.covariance).min() > 0.0


@pytest.mark.parametrize("model", ["augmented", "sliding_window"])
def test_order_of_arrival_does_not_matter(model: str) -> None:
    run = build(3, Settings(motion="random", duration=6.0, outliers=0.05))
    history = history_of(run)
    in_order = sorted((m for _, m in run.measurements), key=lambda m: m.t)
    shuffled = [m for _, m in sorted(run.measurements, key=lambda item: item[0] + 0.2 * (int(item[0] * 1e4) % 97) / 97)]
    assert [m.t for m in shuffled] != [m.t for m in in_order]
    tracks = []
    for sequence in (in_order, shuffled):
        estimator = TargetEstimator(TargetEstimatorParameters(velocity_model=model))
        for measurement in sequence:
            estimator.update(measurement, history)
        tracks.append(estimator.track(6.0, history))
    assert tracks[0] is not None
    assert tracks[1] is not None
    np.testing.assert_array_equal(tracks[0].state, tracks[1].state)
    np.testing.assert_array_equal(tracks[0].covariance, tracks[1].covariance)
    assert tracks[0].fused == tracks[1].fused


def test_late_measurements_cost_no_accuracy_but_age() -> None:
    late = build(5, Settings(motion="straight", latency=0.05, jitter=0.15))
    tracks = [k for k in fly(late, TargetEstimator()) if k.t > 2.0]
    nees = [normalised_squared(error(late, k), k.covariance[:4, :4]) for k in tracks]
    assert max(nees) < 40.0
    assert max(k.age for k in tracks) > 0.1


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.8])
def test_frame_of_the_odometry_does_not_matter(yaw: float) -> None:
    settings = Settings(motion="straight", duration=5.0)
    plain = fly(build(11, settings), TargetEstimator())
    moved = fly(build(11, replace(settings, frame_yaw=yaw, frame_shift=(30.0, -80.0, 4.0))), TargetEstimator())
    assert len(plain) == len(moved) > 100
    for a, b in zip(plain, moved, strict=True):
        np.testing.assert_allclose(a.state, b.state, atol=1e-8)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)


@pytest.mark.parametrize(("model", "random"), [("augmented", 0.0), ("sliding_window", 0.0), ("augmented", 0.5)])
def test_reset_of_the_autopilot_does_not_move_the_target(model: str, random: float) -> None:
    run = corrupted(build(2, Settings(motion="straight", duration=6.0, jitter=0.15)), random, 1)
    parameters = TargetEstimatorParameters(velocity_model=model)
    plain = fly(run, TargetEstimator(parameters))
    turn, shift = rotation_about_z(0.4), np.array([14.8, -76.7, 3.0])
    estimator, history, k, tracks = TargetEstimator(parameters), OwnshipHistory(), 0, []
    for state in run.ownships:
        if state.t >= 3.0:
            state = replace(
                state,
                position_ned=turn @ state.position_ned + shift,
                velocity_ned=turn @ state.velocity_ned,
                ned_from_frd=turn @ state.ned_from_frd,
                reset_counter=13,
            )
        reset = history.add(state)
        if reset is not None:
            assert wrap_angle(reset.yaw - 0.4) == pytest.approx(0.0, abs=0.01)
            estimator.rebase(reset)
        while k < len(run.measurements) and run.measurements[k][0] <= state.t + 0.005:
            estimator.update(run.measurements[k][1], history)
            k += 1
        track = estimator.track(state.t + 0.005, history)
        if track is not None:
            tracks.append(track)
    assert tracks[-1].reset_counter == 13
    for a, b in zip(plain, tracks, strict=True):
        assert np.linalg.norm(a.state[:3] - b.state[:3]) < 0.03
        assert abs(wrap_angle(a.state[3] - b.state[3])) < 0.01
        assert a.fused == b.fused
        c, s = math.cos(b.yaw_ned - b.state[3]), math.sin(b.yaw_ned - b.state[3])
        place = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ b.state[:3]
        own = history.pose_at(b.t)
        if own is not None and b.t >= 3.0:
            np.testing.assert_allclose(b.position_ned, place + np.array(own[:3]), atol=5e-3)


def test_one_outlier_is_rejected_and_a_moved_pad_restarts_the_track() -> None:
    history, estimator = resting_history(), TargetEstimator()
    verdicts = []
    for k in range(30):
        verdicts.append(estimator.update(still(2.5 + k / 30, (0.0, 0.0, 3.0)), history))
    assert verdicts[0] is MeasurementVerdict.INITIALISED
    assert set(verdicts[1:]) == {MeasurementVerdict.FUSED}
    assert estimator.update(still(3.51, (1.0, 0.0, 3.0)), history) is MeasurementVerdict.REJECTED_GATE
    assert estimator.update(still(3.54, (0.0, 0.0, 3.0)), history) is MeasurementVerdict.FUSED
    moved = [estimator.update(still(3.6 + k / 30, (2.0, 1.0, 3.0)), history) for k in range(8)]
    assert moved[:3] == [MeasurementVerdict.REJECTED_GATE] * 3
    assert MeasurementVerdict.INITIALISED in moved
    track = estimator.track(3.9, history)
    assert track is not None
    np.testing.assert_allclose(track.state[:3], (2.0, 1.0, 3.0), atol=0.1)


def test_scattered_outliers_never_restart_the_track() -> None:
    history, estimator = resting_history(), TargetEstimator()
    for k in range(30):
        estimator.update(still(2.5 + k / 30, (0.0, 0.0, 3.0)), history)
    rng = np.random.default_rng(0)
    for k in range(20):
        x, y = rng.uniform(-2.0, 2.0, 2) + np.array([3.0, 3.0])
        verdict = estimator.update(still(3.55 + k / 50, (x, y, 3.0)), history)
        assert verdict is MeasurementVerdict.REJECTED_GATE


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({"t": math.nan}, MeasurementVerdict.REJECTED_INVALID),
        ({"heading": math.inf}, MeasurementVerdict.REJECTED_INVALID),
        ({"position_level": np.array([0.0, math.nan, 1.0])}, MeasurementVerdict.REJECTED_INVALID),
        ({"covariance": -np.eye(4)}, MeasurementVerdict.REJECTED_INVALID),
        ({"covariance": np.full((4, 4), math.nan)}, MeasurementVerdict.REJECTED_INVALID),
        ({"t": 3.0}, MeasurementVerdict.REJECTED_INVALID),  # a duplicate
        ({"t": 1.0}, MeasurementVerdict.REJECTED_TOO_OLD),
        ({"t": 9.0}, MeasurementVerdict.REJECTED_INVALID),  # from the future
    ],
)
def test_bad_measurements_change_nothing(change: dict[str, object], verdict: MeasurementVerdict) -> None:
    history, estimator = resting_history(), TargetEstimator()
    good = still(3.0, (0.0, 0.0, 3.0))
    estimator.update(good, history)
    before = estimator.track(3.5, history)
    assert estimator.update(replace(good, **change), history) is verdict  # type: ignore[arg-type]
    after = estimator.track(3.5, history)
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(before.state, after.state)


def test_track_ends_after_coasting_and_after_reset() -> None:
    history = resting_history()
    estimator = TargetEstimator(TargetEstimatorParameters(coast_limit=1.0))
    assert estimator.track(3.0, history) is None
    estimator.update(still(3.0, (0.0, 0.0, 3.0)), history)
    assert estimator.track(3.9, history) is not None
    assert estimator.track(4.1, history) is None
    estimator.reset()
    assert estimator.track(3.5, history) is None


def test_memory_is_bounded() -> None:
    run = build(4, Settings(duration=10.0))
    estimator = TargetEstimator()
    fly(run, estimator)
    assert len(estimator._records) <= 32


def leaning(t: float, attitude: np.ndarray) -> OwnshipState:
    return OwnshipState(
        t=t,
        position_ned=np.zeros(3),
        velocity_ned=np.zeros(3),
        acceleration_ned=np.zeros(3),
        ned_from_frd=attitude,
        angular_velocity_frd=np.zeros(3),
        reset_counter=0,
    )


def test_a_lasting_tilt_error_is_told_of_in_height_and_heading() -> None:
    """The vehicle hovers where its own estimate says that it is above the pad, and leans elsewhere after the sighting.

    A vector seen with a wrong tilt has the right length: the height is short by half the tilt squared. The heading
    turns by what the tilt error, about leaning axes, has about the vertical.
    """
    rng = np.random.default_rng(2)
    parameters = TargetEstimatorParameters(tilt_time_roll=1e6, tilt_time_pitch=1e6, mount_sigma=0.0)
    deviations = [math.hypot(0.0175, 0.014), math.hypot(0.0105, 0.0105)]
    seen, height, turn = np.array([0.0, 0.0, 4.0]), 0.0005, 0.0003
    normalised = np.zeros((600, 2))
    for draw in normalised:
        wrong = rotation_from_vector(np.array([*(deviations * rng.normal(size=2)), 0.0]))
        then, now = rotation_from_euler(0.2, -0.15, 0.7), rotation_from_euler(-0.1, 0.1, 0.7)
        history = OwnshipHistory()
        history.add(leaning(0.0, then @ wrong))
        history.add(leaning(0.02, now @ wrong))
        estimated_from_true = then @ wrong @ then.T
        pad = estimated_from_true @ rotation_about_z(1.9)
        noise = rng.normal(size=2) * (height, turn)
        yaw = yaw_of(then @ wrong)
        measurement = TargetMeasurement(
            t=0.0,
            position_level=seen + np.array([0.0, 0.0, noise[0]]),
            heading=yaw_of(pad) - yaw + noise[1],
            covariance=np.diag([1e-6, 1e-6, height**2, turn**2]),
        )
        estimator = TargetEstimator(parameters)
        estimator.update(measurement, history)
        track = estimator.track(0.02, history)
        assert track is not None
        true_height = (estimated_from_true.T @ seen)[2]
        true_heading = 1.9 - 0.7
        spread = track.covariance - np.diag([0.0, 0.0, (0.02 * 0.3) ** 2, (0.02 * 0.4) ** 2, 0.0, 0.0, 0.0, 0.0])
        draw[0] = (track.state[2] - true_height) ** 2 / spread[2, 2]
        draw[1] = wrap_angle(track.state[3] - true_heading) ** 2 / spread[3, 3]
    assert normalised.mean(axis=0) == pytest.approx([1.0, 1.0], abs=0.25)
