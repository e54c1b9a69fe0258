"""The wandering estimate against the figures of the PX4 recordings (README, section 'Noise')."""

import math

import numpy as np
import pytest
from stub_vehicle_support import vehicle

from sitl_stub.vehicle.estimator import Estimator
from sitl_stub.vehicle.rigid_body import RigidBody

DT = 0.004
HOVER = 90.0
POSITION_STD = (0.09, 0.19, 0.38)  # z: between the one flight (0.43) and the median of 17 (0.32)
VELOCITY_STD = (0.12, 0.28, 0.21)


def errors(seed: int, seconds: float = HOVER) -> np.ndarray:
    """Estimate minus truth at 50 Hz: position, velocity, roll, pitch, yaw, derivative of z."""
    config = vehicle()
    body = RigidBody(config.body, config.gear, heading=0.0)
    estimator = Estimator(config.estimator, body, np.random.default_rng(seed))
    origin = body.position
    rows = []
    for i in range(round(seconds / DT)):
        e = estimator.step(DT, body)
        if i % 5 == 0:
            position = np.subtract(e.position, np.subtract(body.position, origin))
            rows.append((*position, *e.velocity, e.roll, e.pitch, e.yaw, e.down_rate))
    return np.array(rows)


@pytest.fixture(scope="module")
def flights() -> list[np.ndarray]:
    return [errors(seed) for seed in range(6)]


def test_position_and_velocity_errors_are_as_large_as_recorded(flights):
    std = np.median([f.std(0) for f in flights], axis=0)
    for axis in range(3):
        assert POSITION_STD[axis] / 1.5 < std[axis] < POSITION_STD[axis] * 1.5
        assert VELOCITY_STD[axis] / 1.5 < std[axis + 3] < VELOCITY_STD[axis] * 1.5


def test_position_error_forgets_as_slowly_as_recorded(flights):
    def time_to(f: np.ndarray, axis: int) -> float:
        x = f[:, axis] - f[:, axis].mean()
        for lag in range(1, 1500):
            if np.mean(x[:-lag] * x[lag:]) < x.var() / math.e:
                return lag * 0.02
        return math.inf

    x, y, z = (np.median([time_to(f, axis) for f in flights]) for axis in range(3))
    assert 3.5 < x < 12.0
    assert 1.5 < y < 4.5
    assert 3.0 < z < 8.0


def test_velocity_and_position_errors_belong_together(flights):
    for axis in range(3):
        correlation = np.median([np.corrcoef(f[:, axis], f[:, axis + 3])[0, 1] for f in flights])
        assert 0.65 < correlation < 0.99
    # the height's derivative is its own, smaller error
    f = flights[0]
    derivative = np.gradient(f[:, 2], 0.02)
    assert np.abs(derivative[2:-2] - f[2:-2, 9]).max() < 0.02


def test_estimate_is_smooth_above_one_hertz(flights):
    window = np.ones(25) / 25
    for f in flights[:2]:
        for axis in range(3):
            position = (f[:, axis] - np.convolve(f[:, axis], window, "same"))[50:-50].std()
            velocity = (f[:, axis + 3] - np.convolve(f[:, axis + 3], window, "same"))[50:-50].std()
            assert position < 0.004
            assert 0.002 < velocity < 0.03


def test_yaw_is_wrong_by_a_degree_or_two_and_tilt_by_about_one():
    rms = np.sqrt(np.mean([np.mean(errors(seed, 20.0)[:, 6:9] ** 2, axis=0) for seed in range(20)], axis=0))
    roll, pitch, yaw = np.degrees(rms)
    assert 0.6 < roll < 2.2
    assert 0.4 < pitch < 1.6
    assert 1.0 < yaw < 3.0


def test_seeds_differ_and_repeat():
    assert np.array_equal(errors(3, 1.0), errors(3, 1.0))
    assert not np.array_equal(errors(3, 1.0), errors(4, 1.0))


def test_without_errors_the_estimate_is_the_truth():
    config = vehicle(wander=False)
    body = RigidBody(config.body, config.gear, heading=0.7)
    estimate = Estimator(config.estimator, body, np.random.default_rng(0)).step(DT, body)
    assert estimate.position == (0.0, 0.0, 0.0)
    assert estimate.yaw == pytest.approx(0.7)
    assert estimate.velocity == body.velocity
