import json

import cv2
import numpy as np
import pytest

from companion.errors import InputError
from companion.perception.calibration_file import load_calibration
from companion.perception.camera_model import Distortion

MATRIX = np.array([[460.0, 0, 319.5], [0, 461.0, 239.5], [0, 0, 1.0]])
LENS = np.array([[-0.12, 0.03, 0.0005, -0.0004, 0.0]])

ROS = """\
image_width: 640
image_height: 480
camera_name: down
camera_matrix:
  rows: 3
  cols: 3
  data: [460.0, 0, 319.5, 0, 461.0, 239.5, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.12, 0.03, 0.0005, -0.0004, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


@pytest.mark.parametrize("suffix", ["yaml", "yml", "json"])
def test_what_opencv_writes_loads(tmp_path, suffix):
    path = tmp_path / f"calibration.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Sat 22 Nov 2025 10:00:00")
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", LENS)
    storage.write("avg_reprojection_error", 0.21)
    storage.release()
    camera = load_calibration(path)
    np.testing.assert_allclose(camera.matrix, MATRIX)
    np.testing.assert_allclose(camera.distortion, LENS.ravel())
    assert (camera.width, camera.height) == (640, 480)


def test_ros_camera_info_loads(tmp_path):
    path = tmp_path / "ost.yaml"
    path.write_text(ROS)
    camera = load_calibration(path)
    np.testing.assert_allclose(camera.matrix, MATRIX)
    np.testing.assert_allclose(camera.distortion, LENS.ravel())


def test_ros_message_as_echoed_on_a_topic_loads(tmp_path):
    path = tmp_path / "info.yaml"
    path.write_text(
        "height: 480\nwidth: 640\ndistortion_model: equidistant\nD: [0.02, -0.004, 0.001, -0.0002]\n"
        "K: [460.0, 0.0, 319.5, 0.0, 461.0, 239.5, 0.0, 0.0, 1.0]\n"
    )
    camera = load_calibration(path)
    assert camera.model is Distortion.EQUIDISTANT
    np.testing.assert_allclose(camera.matrix, MATRIX)


def test_plain_json_with_nested_rows_loads(tmp_path):
    path = tmp_path / "camera.json"
    path.write_text(
        json.dumps(
            {
                "image_size": [640, 480],
                "camera_matrix": MATRIX.tolist(),
                "distortion_coefficients": [0.1] * 3 + [0.0] * 5,
            }
        )
    )
    assert load_calibration(path).model is Distortion.RATIONAL


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("image_width: 640\n", "", 1, "image_width"),
        ("image_width: 640", "image_width: 640.5", 1, "whole number"),
        ("image_width: 640", "image_width: -640", 1, "at least one pixel"),
        ("[460.0,", "[.nan,", 5, "focal length"),
        ("[460.0,", "[-460.0,", 5, "positive"),
        ("[460.0,", "[0.0,", 5, "focal length"),
        (", 239.5, 0, 0, 1]", ", 239.5, 0, 0]", 5, "9"),
        ("319.5", "31950", 5, "principal point"),
        ("cols: 5", "cols: 4", 10, "1x4"),
        ("[-0.12, 0.03", "[word, 0.03", 10, "not a list of numbers"),
        ("plumb_bob", "telepathy", 8, "telepathy"),
        ("plumb_bob", "equidistant", 10, "5 coefficients"),
        ("camera_matrix", "matrix_of_the_camera", 1, "no camera matrix"),
    ],
)
def test_a_wrong_file_names_line_and_remedy(tmp_path, old, new, line, words):
    path = tmp_path / "ost.yaml"
    assert old in ROS
    path.write_text(ROS.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_calibration(path)
    assert words in str(caught.value)
    assert any(problem.line in (line, line + 1) for problem in caught.value.problems)
    assert all(problem.right for problem in caught.value.problems)


@pytest.mark.parametrize("text", ["", "[1, 2, 3]", "just words", "a: [1\n", "a: &x [1]\nb: *y\n"])
def test_what_is_no_calibration_is_refused(tmp_path, text):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        load_calibration(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="absent"):
        load_calibration(tmp_path / "absent.yaml")
