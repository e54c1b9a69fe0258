import math
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_render import look_down, render

from companion.errors import InputError
from companion.geometry.transform import RigidTransform
from companion.messages.perception import CameraFrame, TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.detector import ArucoFinder
from companion.perception.pad_detector import PadDetector, PerceptionParameters, find_in_window
from companion.perception.pad_file import load_pad
from companion.perception.window import WindowParameters, predict_window

PAD = load_pad(Path(__file__).resolve().parents[3] / "config" / "pads" / "landing_pad_0p8.yaml")
LENS = np.array([-0.12, 0.03, 0.0005, -0.0004, 0.0])
CAMERA = CameraModel(width=640, height=480, fx=460.0, fy=460.0, cx=319.5, cy=239.5, distortion=LENS)
TAGS = [(tag.id, tag.size, tag.x, tag.y, tag.heading) for tag in PAD.tags]
DETECTOR = PadDetector(PAD, CAMERA, PerceptionParameters())


def frame(pose, seed=0, **picture):
    rng = np.random.default_rng(seed)
    image = render(TAGS, pose, CAMERA.matrix, LENS, blur=0.6, noise=3.0, rng=rng, samples=3, **picture)
    return CameraFrame(t=2.0, t_arrival=2.04, sequence=7, image=image)


def transform(pose, shift=(0.0, 0.0, 0.0)):
    return RigidTransform(rotation=pose[0], translation=pose[1] + shift)


def error_of(hypothesis, pose):
    return np.concatenate((pose[1] - hypothesis.translation, cv2.Rodrigues(pose[0] @ hypothesis.rotation.T)[0][:, 0]))


@pytest.mark.parametrize("height", [0.16, 0.3, 0.7, 1.5, 3.0, 6.0])
def test_the_pad_is_seen_from_afar_down_to_touchdown(height):
    pose = look_down(height, tilt=0.15, axis=1.0, turn=0.4, x=0.05 * height, y=-0.05 * height)
    observed, how = DETECTOR.examine(frame(pose), transform(pose, (0.02 * height, -0.02 * height, 0.03)))
    assert observed.seen
    assert observed.search == "window"
    assert (observed.t, observed.sequence) == (2.0, 7)
    assert not how.window_failed
    error = error_of(observed.hypotheses[0], pose)
    assert np.abs(error[:3]).max() < 0.001 * height + 0.0005 * height**2
    assert np.abs(error[3:]).max() < 0.002 * height + 0.0005
    assert error @ np.linalg.solve(observed.hypotheses[0].covariance, error) < 40.0


def test_window_and_frame_agree():
    pose = look_down(1.5, tilt=0.1, axis=2.0, turn=1.0)
    picture = frame(pose)
    window, whole = DETECTOR.observe(picture, transform(pose)), DETECTOR.observe(picture, None)
    assert (window.search, whole.search) == ("window", "frame")
    np.testing.assert_allclose(window.hypotheses[0].translation, whole.hypotheses[0].translation, atol=1e-3)


def test_a_wrong_prediction_falls_back_to_the_whole_frame():
    pose = look_down(2.5, x=0.7, y=0.4)
    observed, how = DETECTOR.examine(frame(pose), transform(look_down(2.5, x=-0.9, y=-0.5)))
    assert observed.search == "frame"
    assert observed.seen
    assert how.window_failed


def test_a_prediction_out_of_sight_goes_straight_to_the_whole_frame():
    pose = look_down(2.5)
    observed, how = DETECTOR.examine(frame(pose), transform(look_down(1.0, x=50.0)))
    assert observed.seen
    assert how.window is None


def test_no_pad_is_said_plainly():
    image = np.full((480, 640), 120, dtype=np.uint8)
    observed, how = DETECTOR.examine(CameraFrame(t=0.0, t_arrival=0.0, sequence=1, image=image), None)
    assert not observed.seen
    assert observed.detections == ()
    assert how.reason == "no tag of the pad"


def test_a_frame_of_another_size_is_refused():
    image = np.zeros((240, 320), dtype=np.uint8)
    with pytest.raises(InputError, match="320x240"):
        DETECTOR.observe(CameraFrame(t=0.0, t_arrival=0.0, sequence=1, image=image), None)


def test_the_same_frame_gives_the_same_bits():
    pose = look_down(1.5, tilt=0.1, axis=2.0, turn=1.0)
    picture = frame(pose)
    DETECTOR.observe(frame(look_down(4.0)), transform(look_down(4.0)))
    first = DETECTOR.observe(picture, transform(pose))
    fresh = PadDetector(PAD, CAMERA, PerceptionParameters()).observe(picture, transform(pose))
    assert first.hypotheses[0].covariance.tobytes() == fresh.hypotheses[0].covariance.tobytes()
    assert first.hypotheses[0].rotation.tobytes() == fresh.hypotheses[0].rotation.tobytes()


def test_it_travels_to_a_worker_process():
    pose = look_down(1.0)
    copy = pickle.loads(pickle.dumps(DETECTOR))
    assert copy.observe(frame(pose), None).seen


def test_corners_from_elsewhere_are_solved_alike():
    pose = look_down(1.2, tilt=0.2)
    tags = [
        TagDetection(
            id=tag_id,
            corners=CAMERA.project(PAD.corners[tag_id] @ pose[0].T + pose[1]),
            corner_sigma=0.1,
            method="corners",
        )
        for tag_id in (0, 1, 2)
    ]
    stranger = TagDetection(id=400, corners=tags[0].corners, corner_sigma=0.1, method="corners")
    observed = DETECTOR.observe_corners(3.0, 9, [*tags, stranger])
    assert (observed.t, observed.sequence) == (3.0, 9)
    assert observed.detections == tuple(tags)
    assert np.abs(error_of(observed.hypotheses[0], pose)).max() < 1e-4
    assert not DETECTOR.observe_corners(3.0, 9, []).seen


@given(
    height=st.floats(0.1, 8.0),
    tilt=st.floats(0, 1.2),
    axis=st.floats(0, 6.28),
    turn=st.floats(0, 6.28),
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
)
@settings(max_examples=80, deadline=None)
def test_the_window_holds_every_tag_in_sight(height, tilt, axis, turn, x, y):
    pose = look_down(height, tilt=tilt, axis=axis, turn=turn, x=x * height, y=y * height)
    window = predict_window(PAD, CAMERA, transform(pose), WindowParameters())
    seen = CAMERA.project(PAD.all_corners.reshape(-1, 3) @ pose[0].T + pose[1]).reshape(-1, 4, 2)
    inside = ((seen >= 0) & (seen <= [639, 479])).all(axis=(1, 2))
    if window is None:
        assert not inside.any()
        return
    assert 0 <= window.left < window.right <= 640
    assert 0 <= window.top < window.bottom <= 480
    for quad in seen[inside]:
        assert (quad >= [window.left, window.top]).all()
        assert (quad <= [window.right - 1, window.bottom - 1]).all()


@pytest.mark.parametrize("height", [0.3, 0.6, 1.2, 2.5])
def test_corners_from_a_reduced_window_are_not_shifted(height):
    pose = look_down(height, turn=0.6)
    image = frame(pose).image
    window = predict_window(PAD, CAMERA, transform(pose), WindowParameters())
    assert (window.reduction > 1) == (height < 2.0)
    found = find_in_window(image, window, ArucoFinder(PAD.ids))
    errors = [tag.corners - CAMERA.project(PAD.corners[tag.id] @ pose[0].T + pose[1]) for tag in found]
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.2


def test_an_uncertain_prediction_has_a_larger_window():
    pose = transform(look_down(3.0))
    sure = predict_window(PAD, CAMERA, pose, WindowParameters(), position_sigma=0.01)
    unsure = predict_window(PAD, CAMERA, pose, WindowParameters(), position_sigma=0.2)
    assert unsure.right - unsure.left > sure.right - sure.left + 100


@pytest.mark.parametrize("translation", [[0, 0, -1.0], [0, 0, 0.0], [math.nan, 0, 1.0], [0, math.inf, 1.0]])
def test_an_impossible_prediction_has_no_window(translation):
    pose = RigidTransform(rotation=look_down(1.0)[0], translation=np.array(translation))
    assert predict_window(PAD, CAMERA, pose, WindowParameters()) is None
