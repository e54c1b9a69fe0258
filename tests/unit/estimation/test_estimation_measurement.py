"""The levelled measurement: Jacobian, covariance, the flip, refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.estimation.measurement import MeasurementParameters, measure_target, pose_jacobian
from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import (
    rotation_about_z,
    rotation_from_euler,
    rotation_from_vector,
)
from companion.geometry.transform import RigidTransform
from companion.messages.ownship import OwnshipState
from companion.messages.perception import PadObservation, PoseHypothesis
from companion.messages.target import MeasurementVerdict, TargetMeasurement, TargetTrack

DOWNWARD = RigidTransform(
    rotation=np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), translation=np.array([0.06, 0.0, 0.04])
)
EXACT = MeasurementParameters(attitude_jitter=0.0, capture_jitter=0.0, heading_floor=0.0)


def ownship(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, **changes: object) -> OwnshipState:
    arguments: dict[str, object] = {
        "t": 5.0,
        "position_ned": np.zeros(3),
        "velocity_ned": np.zeros(3),
        "acceleration_ned": np.zeros(3),
        "ned_from_frd": rotation_from_euler(roll, pitch, yaw),
        "angular_velocity_frd": np.zeros(3),
        "reset_counter": 0,
    }
    return OwnshipState(**(arguments | changes))  # type: ignore[arg-type]


def hypothesis(
    own: OwnshipState,
    position_level: tuple[float, float, float],
    heading: float,
    lean: tuple[float, float] = (0.0, 0.0),
    sigma: float = 0.01,
    rms: float = 0.1,
) -> PoseHypothesis:
    level_from_frd = rotation_about_z(-own.yaw) @ own.ned_from_frd
    level_from_pad = rotation_from_vector(np.array([*lean, 0.0])) @ rotation_about_z(heading)
    cam_from_level = DOWNWARD.rotation.T @ level_from_frd.T
    return PoseHypothesis(
        rotation=cam_from_level @ level_from_pad,
        translation=DOWNWARD.inverse().apply(level_from_frd.T @ np.array(position_level)),
        covariance=np.eye(6) * sigma**2,
        reprojection_rms=rms,
    )


def measure(
    own: OwnshipState,
    *hypotheses: PoseHypothesis,
    prior: TargetTrack | None = None,
    parameters: MeasurementParameters = EXACT,
) -> TargetMeasurement | MeasurementVerdict:
    observation = PadObservation(t=5.0, sequence=1, detections=(), hypotheses=hypotheses, search="frame")
    return measure_target(
        observation=observation, ownship=own, frd_from_cam=DOWNWARD, prior=prior, parameters=parameters
    )


@pytest.mark.parametrize(("roll", "pitch", "yaw"), [(0.0, 0.0, 0.0), (0.2, -0.1, 2.0), (-0.3, 0.25, -3.0)])
def test_attitude_is_taken_out(roll: float, pitch: float, yaw: float) -> None:
    own = ownship(roll, pitch, yaw)
    got = measure(own, hypothesis(own, (0.7, -0.4, 3.0), 1.2))
    assert isinstance(got, TargetMeasurement)
    np.testing.assert_allclose(got.position_level, (0.7, -0.4, 3.0), atol=1e-12)
    assert got.heading == pytest.approx(1.2)
    assert got.t == 5.0


@pytest.mark.parametrize("seed", range(4))
def test_jacobian_is_the_derivative(seed: int) -> None:
    rng = np.random.default_rng(seed)
    level_from_cam = rotation_from_vector(0.3 * rng.standard_normal(3))
    cam_from_pad = rotation_from_vector(0.3 * rng.standard_normal(3)) @ rotation_about_z(rng.uniform(-3.0, 3.0))
    jacobian = pose_jacobian(level_from_cam, level_from_cam @ cam_from_pad)

    def value(change: np.ndarray) -> np.ndarray:
        turned = level_from_cam @ rotation_from_vector(change[3:]) @ cam_from_pad
        return np.append(level_from_cam @ change[:3], math.atan2(turned[1, 0], turned[0, 0]))

    for i in range(6):
        bump = np.zeros(6)
        bump[i] = 1e-6
        difference = value(bump) - value(-bump)
        difference[3] = wrap_angle(difference[3])
        np.testing.assert_allclose(jacobian[:, i], difference / 2e-6, atol=1e-7)


def test_covariance_matches_a_sample_of_attitude_and_timing_errors() -> None:
    rate, velocity = np.array([0.8, -0.5, 0.0]), np.array([2.0, -1.0, 0.5])
    parameters = MeasurementParameters(attitude_jitter=0.004, capture_jitter=0.005, heading_floor=0.002)
    own = ownship(angular_velocity_frd=rate, velocity_ned=velocity)
    clean = hypothesis(own, (0.5, 0.3, 4.0), 0.7, sigma=1e-9)
    got = measure(own, clean, parameters=parameters)
    assert isinstance(got, TargetMeasurement)
    rng = np.random.default_rng(0)
    samples = []
    for _ in range(4000):
        late = 0.005 * rng.standard_normal()
        tilt = np.append(0.004 * rng.standard_normal(2), 0.0)
        turned = rotation_from_vector(tilt + rate * late)
        # The picture shows where the pad was; the vehicle is placed where it is `late` afterwards.
        samples.append(turned @ np.array([0.5, 0.3, 4.0]) + velocity * late)
    np.testing.assert_allclose(got.covariance[:3, :3], np.cov(np.array(samples).T), atol=4e-5)
    assert got.covariance[3, 3] == pytest.approx(0.002**2, rel=1e-6)


def test_gravity_resolves_the_flip() -> None:
    own = ownship(0.1, 0.05, 1.0)
    upright = hypothesis(own, (1.5, 0.0, 3.0), 0.4, rms=0.12)
    flipped = hypothesis(own, (1.45, 0.1, 3.05), 0.5, lean=(0.0, 0.45), rms=0.1)
    for order in ((upright, flipped), (flipped, upright)):
        got = measure(own, *order)
        assert isinstance(got, TargetMeasurement)
        assert got.heading == pytest.approx(0.4)


def test_track_resolves_the_flip_of_a_leaning_pad() -> None:
    own = ownship()
    right = hypothesis(own, (1.5, 0.0, 3.0), 0.4, lean=(0.1, 0.0))
    wrong = hypothesis(own, (1.5, 0.3, 3.0), 0.6, lean=(-0.1, 0.0))
    assert measure(own, right, wrong) is MeasurementVerdict.REJECTED_AMBIGUOUS
    prior = TargetTrack(
        t=5.0,
        t_measured=4.9,
        state=np.array([1.5, 0.0, 3.0, 0.4, 0.0, 0.0, 0.0, 0.0]),
        covariance=np.eye(8) * 1e-3,
        position_ned=np.zeros(3),
        velocity_ned=np.zeros(3),
        yaw_ned=0.4,
        reset_counter=0,
        nis=4.0,
        nis_mean=1.0,
        fused=10,
        t_began=0.0,
    )
    got = measure(own, wrong, right, prior=prior)
    assert isinstance(got, TargetMeasurement)
    assert got.heading == pytest.approx(0.4, abs=0.02)


def test_poses_that_say_the_same_are_not_ambiguous() -> None:
    own = ownship()
    a = hypothesis(own, (0.0, 0.0, 3.0), 0.4, lean=(0.05, 0.0))
    b = hypothesis(own, (0.005, 0.0, 3.0), 0.4, lean=(-0.05, 0.0))
    assert isinstance(measure(own, a, b), TargetMeasurement)


def test_refusals() -> None:
    own = ownship()
    good = hypothesis(own, (0.0, 0.0, 3.0), 0.4)
    assert measure(own) is MeasurementVerdict.REJECTED_INVALID
    for bad in (
        hypothesis(own, (0.0, 0.0, 3.0), 0.4, lean=(0.7, 0.0)),
        hypothesis(own, (0.0, 0.0, 900.0), 0.4),
        replace(good, translation=np.array([math.nan, 0.0, 1.0])),
        replace(good, covariance=np.full((6, 6), math.nan)),
        replace(good, covariance=-np.eye(6)),
    ):
        assert measure(own, bad) is MeasurementVerdict.REJECTED_INVALID
        assert isinstance(measure(own, bad, good), TargetMeasurement)
