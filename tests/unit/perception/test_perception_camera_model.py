import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.errors import InputError
from companion.perception.camera_model import CameraModel, Distortion

LENSES = {
    "none": (Distortion.PLUMB_BOB, []),
    "four": (Distortion.PLUMB_BOB, [-0.12, 0.03, 0.0005, -0.0004]),
    "five": (Distortion.PLUMB_BOB, [-0.28, 0.09, 0.0005, -0.0004, -0.01]),
    "rational": (Distortion.RATIONAL, [0.4, 0.05, 0.0005, -0.0004, 0.002, 0.7, 0.12, 0.01]),
    "fisheye": (Distortion.EQUIDISTANT, [0.02, -0.004, 0.001, -0.0002]),
}


def camera(lens="five", **changes):
    model, coefficients = LENSES[lens]
    numbers = {"width": 640, "height": 480, "fx": 460.0, "fy": 455.0, "cx": 321.5, "cy": 236.5}
    return CameraModel(**{**numbers, "distortion": np.array(coefficients), "model": model, **changes})


@pytest.mark.parametrize("lens", LENSES)
def test_projection_agrees_with_opencv(lens):
    rng = np.random.default_rng(1)
    points = np.column_stack((rng.uniform(-1, 1, (40, 2)), rng.uniform(1.6, 4, 40)))
    subject = camera(lens)
    origin = np.zeros(3)
    if subject.model is Distortion.EQUIDISTANT:
        wanted = cv2.fisheye.projectPoints(points[:, None], origin, origin, subject.matrix, subject.distortion)[0]
    else:
        wanted = cv2.projectPoints(points, origin, origin, subject.matrix, subject.distortion)[0]
    np.testing.assert_allclose(subject.project(points), wanted.reshape(-1, 2), atol=1e-8)


@pytest.mark.parametrize("lens", LENSES)
@given(x=st.floats(0, 639), y=st.floats(0, 479))
@settings(max_examples=40, deadline=None)
def test_undistorting_and_distorting_again_changes_nothing(lens, x, y):
    subject = camera(lens)
    pixel = np.array([[x, y]])
    ray = subject.undistort(pixel)
    np.testing.assert_allclose(subject.distort(ray), pixel, atol=1e-5)


@pytest.mark.parametrize("lens", LENSES)
def test_jacobian_is_the_derivative_of_the_projection(lens):
    subject = camera(lens)
    rays = np.array([[0.0, 0.0], [0.3, -0.2], [-0.5, 0.4]])
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = 1e-5
        slope = (subject.distort(rays + step) - subject.distort(rays - step)) / 2e-5
        np.testing.assert_allclose(subject.jacobian(rays)[:, :, axis], slope, rtol=1e-5, atol=1e-3)


def test_points_without_a_picture_are_nan():
    points = np.array([[0.1, 0.1, -1.0], [0.0, 0.0, 0.0], [0.1, 0.1, 1.0]])
    assert np.isnan(camera().project(points)).any(axis=1).tolist() == [True, True, False]


def test_a_lens_that_folds_over_sees_nothing_beyond_the_fold():
    folding = camera(distortion=np.array([-0.4, 0.0, 0.0, 0.0]))
    fold = math.sqrt(1 / 1.2)  # where d/dr (r - 0.4 r^3) = 0
    assert folding.largest_radius == pytest.approx(fold, abs=0.01)
    points = np.array([[fold - 0.05, 0, 1.0], [fold + 0.05, 0, 1.0]])
    assert np.isnan(folding.project(points)).any(axis=1).tolist() == [False, True]


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"fx": 0.0}, "fx"),
        ({"fy": -460.0}, "fy"),
        ({"fx": math.nan}, "fx"),
        ({"fy": math.inf}, "fy"),
        ({"cx": math.nan}, "cx"),
        ({"cx": 5000.0}, "cx"),
        ({"cy": -20.0}, "cy"),
        ({"width": 0}, "width"),
        ({"height": -480}, "height"),
        ({"distortion": np.array([0.1, 0.2])}, "distortion"),
        ({"distortion": np.array([0.1, math.nan, 0.0, 0.0])}, "distortion"),
        ({"model": Distortion.RATIONAL}, "distortion"),
    ],
)
def test_impossible_numbers_are_refused_by_name(changes, key):
    with pytest.raises(InputError) as caught:
        camera(**changes)
    assert [problem.key for problem in caught.value.problems] == [key]
    assert caught.value.problems[0].right


def test_all_impossible_numbers_are_named_at_once():
    with pytest.raises(InputError) as caught:
        camera(fx=-1.0, cy=math.nan, width=0)
    assert {problem.key for problem in caught.value.problems} == {"fx", "cy", "width"}


def test_a_picture_of_another_size_is_refused():
    camera().check_image((480, 640), "frame 1")
    with pytest.raises(InputError, match="1280x720"):
        camera().check_image((720, 1280), "frame 1")
