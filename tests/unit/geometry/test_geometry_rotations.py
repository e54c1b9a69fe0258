"""Rotations: conversions agree, neighbours cancel, near-identity is exact."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.geometry.angles import angle_difference, unwrap_near, wrap_angle
from companion.geometry.rotations import (
    euler_from_rotation,
    quaternion_from_rotation,
    rotation_from_euler,
    rotation_from_quaternion,
    rotation_from_vector,
    skew,
    slerp,
    vector_from_rotation,
    yaw_of,
)
from companion.geometry.transform import RigidTransform

small_and_large = st.one_of(st.floats(-3.1, 3.1), st.floats(-1e-7, 1e-7))
vectors = st.tuples(small_and_large, small_and_large, small_and_large).map(np.array)


@given(vectors)
def test_exponential_and_logarithm_are_inverse(vector: np.ndarray) -> None:
    angle = np.linalg.norm(vector)
    if angle > 3.1:
        vector = vector * (3.1 / angle)
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(vector_from_rotation(rotation), vector, atol=2e-7)


@given(vectors)
def test_quaternions_and_matrices_agree(vector: np.ndarray) -> None:
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation_from_quaternion(quaternion_from_rotation(rotation)), rotation, atol=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    rotation = rotation_from_euler(roll, pitch, yaw)
    assert euler_from_rotation(rotation) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    assert yaw_of(rotation) == pytest.approx(yaw, abs=1e-6)


def test_a_positive_yaw_turns_north_towards_east() -> None:
    np.testing.assert_allclose(rotation_from_euler(0, 0, math.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_a_positive_pitch_lifts_the_nose() -> None:
    assert (rotation_from_euler(0, 0.3, 0) @ [1, 0, 0])[2] < 0


@given(vectors, vectors)
def test_skew_is_the_cross_product(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-12)


@given(vectors, vectors, vectors)
def test_transforms_chain_and_invert(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> None:
    first = RigidTransform(rotation=rotation_from_vector(a), translation=b)
    second = RigidTransform(rotation=rotation_from_vector(b), translation=a)
    np.testing.assert_allclose((first @ second).apply(point), first.apply(second.apply(point)), atol=1e-9)
    np.testing.assert_allclose(first.inverse().apply(first.apply(point)), point, atol=1e-9)


def test_slerp_meets_its_ends() -> None:
    a, b = rotation_from_euler(0.1, 0.2, 0.3), rotation_from_euler(-0.4, 0.1, 2.0)
    np.testing.assert_allclose(slerp(a, b, 0.0), a, atol=1e-12)
    np.testing.assert_allclose(slerp(a, b, 1.0), b, atol=1e-12)


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_angles_wrap(a: float, b: float) -> None:
    assert -math.pi <= wrap_angle(a) < math.pi
    assert math.cos(angle_difference(a, b)) == pytest.approx(math.cos(a - b), abs=1e-9)
    assert abs(unwrap_near(a, b) - b) <= math.pi + 1e-9
    assert math.cos(unwrap_near(a, b)) == pytest.approx(math.cos(a), abs=1e-9)
