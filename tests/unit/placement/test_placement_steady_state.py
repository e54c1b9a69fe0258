"""The map of the study against the filter itself, and against the law that the search relies on."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from proximity_world import SETUP

from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.parameters import ProximityParameters
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_from_quaternion
from companion.messages.proximity import FeatureReading, GyroReading, ProximityState, RangeReading
from companion.placement.geometry import eigenvalues, information
from companion.placement.scene import Scene, whole_std, worst_std

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
DOCKING = np.array([0.5, 0.5, -0.5, 0.5])


def after_a_minute(position: Array, quaternion: Array, *, with_vision: bool) -> Array:
    """Let the filter stand for 60 s on readings without errors; its covariance (3, 3) of the position."""
    initial = ProximityState(
        t=0.0,
        position=position,
        velocity=np.zeros(3),
        quaternion=quaternion,
        rate=np.zeros(3),
        covariance=np.diag(np.repeat([0.05, 0.002, 0.0175], 3) ** 2),
        mahalanobis=0.0,
        t_vision=-math.inf,
        t_range=-math.inf,
    )
    estimator = ProximityFilter(SETUP, ProximityParameters(), initial)
    c_from_d = rotation_from_quaternion(quaternion)
    ranges = np.linalg.norm(position + c_from_d @ SETUP.lever_arm - SETUP.anchors, axis=1)
    seen = SETUP.d_from_cam.inverse().apply((SETUP.markers_in_c - position) @ c_from_d)
    for k in range(1, 60 * 50 + 1):
        t = k / 50
        if k % 25 == 0:
            estimator.gyro(GyroReading(t=t, rate=np.zeros(3)))
        estimator.range(RangeReading(t=t, anchor=k % 4, range=float(ranges[k % 4])))
        if with_vision and k % 5 in (2, 4):
            estimator.features(FeatureReading(t=t, markers=tuple(range(6)), positions=seen))
    return estimator.state(60.0).covariance[:3, :3]


@pytest.mark.parametrize(
    ("position", "quaternion", "with_vision"),
    [((0.0, 1.0, 0.0), LEVEL, False), ((1.2, 0.4, -0.8), DOCKING, False), ((1.0, 1.5, 1.0), DOCKING, True)],
)
def test_the_filter_is_after_a_minute_where_the_map_says(
    position: tuple[float, float, float], quaternion: Array, with_vision: bool
) -> None:
    place = np.array(position)
    scene = Scene(setup=SETUP, start_quaternion=quaternion)
    mapped = scene.covariance(place, quaternion, with_vision=with_vision)
    reached = after_a_minute(place, quaternion, with_vision=with_vision)
    assert mapped is not None
    assert np.sqrt(np.diag(mapped)) == pytest.approx(np.sqrt(np.diag(reached)), rel=0.15)
    assert worst_std(mapped) == pytest.approx(worst_std(reached), rel=0.15)


def test_the_variances_go_with_the_eigenvalues_to_the_power_of_minus_three_quarters() -> None:
    """Without lever arm; what the search relies on."""
    setup = dataclasses.replace(SETUP, lever_arm=np.zeros(3))
    scene = Scene(setup=setup, start_quaternion=LEVEL)
    places = np.array([[0.0, 1.0, 0.0], [1.0, 1.9, 1.0], [-1.4, 0.1, 0.9], [0.3, -2.0, 0.2]])
    told = eigenvalues(information(setup.anchors, places).sum(axis=0) / 4.0)
    known = np.array([np.linalg.eigvalsh(covariance_at(scene, place)) for place in places])
    factors = known[:, ::-1] * told.T**0.75
    assert factors == pytest.approx(np.full((4, 3), factors[0, 0]), rel=0.02)


def covariance_at(scene: Scene, place: Array) -> Array:
    covariance = scene.by_ranges(place)
    assert covariance is not None
    return covariance


def test_a_place_in_the_plane_of_the_anchors_is_undetermined() -> None:
    scene = Scene(setup=dataclasses.replace(SETUP, lever_arm=np.zeros(3)), start_quaternion=LEVEL)
    assert scene.by_ranges(np.array([1.7, -0.2, 0.5])) is None
    assert worst_std(None) == whole_std(None) == math.inf
