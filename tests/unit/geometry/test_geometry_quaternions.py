"""Quaternions as plain numbers: they say the same as the matrices."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.geometry.quaternions import (
    between,
    product,
    rotation_of,
    slerp,
    turned,
    turned_slightly,
    yaw_of_quaternion,
)
from companion.geometry.rotations import quaternion_from_rotation, rotation_from_vector, yaw_of
from companion.geometry.rotations import slerp as slerp_of_matrices

NONE = (1.0, 0.0, 0.0, 0.0)
angles = st.floats(-1.7, 1.7)
vectors = st.tuples(angles, angles, angles)
unit = vectors.map(lambda vector: turned(NONE, vector))


@given(unit, unit)
def test_neighbours_cancel_as_with_matrices(a_from_b, b_from_c) -> None:
    a_from_c = product(a_from_b, b_from_c)
    assert rotation_of(a_from_c) == pytest.approx(rotation_of(a_from_b) @ rotation_of(b_from_c), abs=1e-12)
    assert between(a_from_b, a_from_c) == pytest.approx(b_from_c, abs=1e-12)


@given(unit, vectors)
def test_a_turn_is_given_in_the_frame_that_turns(quaternion, vector) -> None:
    after = rotation_of(quaternion) @ rotation_from_vector(np.array(vector))
    assert rotation_of(turned(quaternion, vector)) == pytest.approx(after, abs=1e-9)
    assert math.hypot(*turned(quaternion, vector)) == pytest.approx(1.0, abs=1e-12)


@given(unit, vectors)
def test_a_slight_turn_is_the_turn_to_second_order(quaternion, vector) -> None:
    slight = tuple(0.01 * part for part in vector)
    assert turned_slightly(quaternion, slight) == pytest.approx(
        turned(quaternion, slight), abs=math.hypot(*slight) ** 3 + 1e-15
    )
    assert math.hypot(*turned_slightly(quaternion, slight)) == pytest.approx(1.0, abs=1e-12)


@given(unit, unit, st.floats(0.0, 1.0), st.booleans())
def test_between_two_attitudes_it_goes_the_short_way_at_a_constant_rate(a, b, fraction, other_sign) -> None:
    far = math.hypot(*between(a, b)[1:])
    if far > 0.99:  # half a turn: two ways are as short
        return
    wanted = slerp_of_matrices(rotation_of(a), rotation_of(b), fraction)
    b = tuple(-part for part in b) if other_sign else b
    assert rotation_of(slerp(a, b, fraction)) == pytest.approx(wanted, abs=1e-5)


@given(unit)
def test_the_heading_is_the_matrixs(quaternion) -> None:
    rotation = rotation_of(quaternion)
    if math.hypot(rotation[0, 0], rotation[1, 0]) > 1e-3:
        assert math.remainder(yaw_of_quaternion(quaternion) - yaw_of(rotation), math.tau) == pytest.approx(
            0.0, abs=1e-9
        )


@given(unit)
def test_back_from_the_matrix_it_is_the_same_or_its_negative(quaternion) -> None:
    back = quaternion_from_rotation(rotation_of(quaternion))
    assert abs(float(back @ quaternion)) == pytest.approx(1.0, abs=1e-9)
