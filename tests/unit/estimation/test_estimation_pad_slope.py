"""How the pad lies by the autopilot's attitude: filter, and what a sighting says of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.estimation.measurement import MeasurementParameters, measure_target
from companion.estimation.pad_slope import PadSlope, PadSlopeParameters
from companion.geometry.rotations import rotation_from_euler
from companion.geometry.transform import RigidTransform
from companion.messages.ownship import OwnshipState
from companion.messages.perception import PadObservation, PoseHypothesis, TagDetection
from companion.messages.target import TargetMeasurement

DOWNWARD = RigidTransform(
    rotation=np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), translation=np.zeros(3)
)


def sighting(true: np.ndarray, believed: np.ndarray, pad: np.ndarray) -> TargetMeasurement:
    """Measure a pad 0.5 m below a vehicle of true and believed attitude; all are rotations to north, east, down."""
    cam_from_ned = DOWNWARD.rotation.T @ true.T
    covariance = np.diag([1e-6] * 3 + [4e-6] * 3)
    observation = PadObservation(
        t=1.0,
        sequence=1,
        detections=(TagDetection(id=0, corners=np.zeros((4, 2)), corner_sigma=0.1, method="test"),),
        hypotheses=(
            PoseHypothesis(
                rotation=cam_from_ned @ pad,
                translation=cam_from_ned @ np.array([0.0, 0.0, 0.5]),
                covariance=covariance,
                reprojection_rms=0.05,
            ),
        ),
        search="frame",
    )
    ownship = OwnshipState(
        t=1.0,
        position_ned=np.zeros(3),
        velocity_ned=np.zeros(3),
        acceleration_ned=np.zeros(3),
        ned_from_frd=believed,
        angular_velocity_frd=np.zeros(3),
        reset_counter=0,
    )
    measured = measure_target(
        observation=observation,
        ownship=ownship,
        frd_from_cam=DOWNWARD,
        prior=None,
        parameters=MeasurementParameters(),
    )
    assert isinstance(measured, TargetMeasurement)
    return measured


@pytest.mark.parametrize("yaw", [0.0, 1.1, -2.5])
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.03, -0.02)])
def test_lean_less_slope_is_the_angle_between_vehicle_and_pad(yaw: float, slope: tuple[float, float]) -> None:
    true, pad = rotation_from_euler(0.05, -0.03, yaw), rotation_from_euler(*slope, 0.4)
    believed = rotation_from_euler(0.05 + 0.02, -0.03 - 0.015, yaw)  # the autopilot's error
    seen = PadSlope()
    measured = sighting(true, believed, pad)
    for number in range(200):
        seen.update(number * 0.03, measured.slope_level, measured.slope_std)
    against_pad = believed[:2, 2] - seen.ned(yaw)
    expected = pad[:2, :2] @ (pad.T @ true[:, 2])[:2]
    np.testing.assert_allclose(against_pad, expected, atol=2e-3)
    assert math.hypot(*(believed[:2, 2] - expected)) > 0.01  # what the attitude alone would be wrong by


def test_a_sighting_knows_the_normal_as_well_as_its_pose() -> None:
    level = rotation_from_euler(0.0, 0.0, 0.3)
    assert sighting(level, level, np.eye(3)).slope_std == pytest.approx(0.002)


def test_filter_is_consistent_with_a_walk() -> None:
    p, normalised = PadSlopeParameters(), []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        truth, slope = rng.normal(size=2) * 0.015, PadSlope(p)
        for number in range(100):
            truth = truth + rng.normal(size=2) * p.wander * math.sqrt(0.03)
            slope.update(number * 0.03, truth + rng.normal(size=2) * math.hypot(0.004, p.floor), 0.004)
        normalised.append(float(np.sum((slope.ned(0.0) - truth) ** 2)) / slope.std**2)
    assert 1.6 < np.mean(normalised) < 2.4


def test_useless_sightings_change_nothing() -> None:
    slope = PadSlope()
    slope.update(1.0, np.array([0.02, 0.01]), 0.003)
    before = slope.ned(0.0)
    for t, seen, std in ((0.9, (0.5, 0.5), 0.001), (1.1, (math.nan, 0.0), 0.001), (1.2, (0.5, 0.5), math.inf)):
        slope.update(t, np.array(seen), std)
    np.testing.assert_array_equal(slope.ned(0.0), before)
    slope.reset()
    np.testing.assert_array_equal(slope.ned(0.0), np.zeros(2))
