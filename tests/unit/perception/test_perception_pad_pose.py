from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from perception_render import look_down
from scipy.stats import chi2

from companion.messages.perception import TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.pad import single_tag_pad
from companion.perception.pad_file import load_pad
from companion.perception.pad_pose import solve_pad_pose
from companion.perception.pose_parameters import PoseParameters

PAD = load_pad(Path(__file__).resolve().parents[3] / "config" / "pads" / "landing_pad_0p8.yaml")
CAMERA = CameraModel(
    width=640,
    height=480,
    fx=460.0,
    fy=460.0,
    cx=319.5,
    cy=239.5,
    distortion=np.array([-0.12, 0.03, 0.0005, -0.0004, 0.0]),
)
PARAMETERS = PoseParameters()


def see(pose, ids, sigma, rng=None, pad=PAD, shifts=None):
    tags = []
    for tag_id in ids:
        corners = CAMERA.project(pad.corners[tag_id] @ pose[0].T + pose[1])
        if rng is not None:
            corners = corners + rng.normal(0.0, sigma, (4, 2))
        if shifts and tag_id in shifts:
            corners = corners + shifts[tag_id]
        tags.append(TagDetection(id=tag_id, corners=corners, corner_sigma=sigma, method="test"))
    return tags


def error_of(hypothesis, pose):
    turn = cv2.Rodrigues(pose[0] @ hypothesis.rotation.T)[0][:, 0]
    return np.concatenate((pose[1] - hypothesis.translation, turn))


@given(
    height=st.floats(0.2, 5.0),
    tilt=st.floats(0.02, 0.9),
    axis=st.floats(0, 6.28),
    turn=st.floats(0, 6.28),
    ids=st.sets(st.integers(0, 11), min_size=1, max_size=12),
)
@settings(max_examples=60, deadline=None)
def test_exact_corners_give_the_exact_pose(height, tilt, axis, turn, ids):
    pose = look_down(height, tilt=tilt, axis=axis, turn=turn)
    tags = see(pose, sorted(ids), 0.01)
    tags = [tag for tag in tags if ((tag.corners >= 0.0) & (tag.corners <= [639.0, 479.0])).all()]
    assume(tags)
    answer = solve_pad_pose(PAD, tags, CAMERA, PARAMETERS)
    assert answer.reason == ""
    best = min(np.abs(error_of(hypothesis, pose)).max() for hypothesis in answer.hypotheses)
    assert best < 1e-3
    assert answer.hypotheses[0].reprojection_rms < 1e-3


@pytest.mark.parametrize(
    ("ids", "height", "tilt"),
    [((0,), 1.5, 0.5), ((0, 2), 2.0, 0.3), ((0, 1, 2, 3), 4.0, 0.1), (tuple(range(12)), 1.5, 0.0), ((8, 9), 0.2, 0.1)],
)
def test_the_covariance_is_honest(ids, height, tilt):
    rng = np.random.default_rng(8)
    runs, nees, position_nees = 250, [], []
    for _ in range(runs):
        axis, turn = rng.uniform(0, 2 * np.pi, 2)
        pose = look_down(height, tilt=tilt, axis=axis, turn=turn, x=0.05 * height, y=-0.08 * height)
        answer = solve_pad_pose(PAD, see(pose, ids, 0.1, rng), CAMERA, PARAMETERS)
        hypothesis = min(answer.hypotheses, key=lambda h: np.abs(error_of(h, pose)[3:]).max())
        error = error_of(hypothesis, pose)
        nees.append(error @ np.linalg.solve(hypothesis.covariance, error))
        position_nees.append(error[:3] @ np.linalg.solve(hypothesis.covariance[:3, :3], error[:3]))
    # 99.9 % bounds of the mean, widened by a tenth for what is not linear
    for values, size in ((nees, 6), (position_nees, 3)):
        low, high = chi2.ppf([0.0005, 0.9995], size * runs) / runs
        assert 0.9 * low < np.mean(values) < 1.1 * high


def test_the_covariance_is_the_inverse_of_the_information_in_the_documented_order():
    pose = look_down(1.2, tilt=0.4, axis=0.5)
    (hypothesis,) = solve_pad_pose(PAD, see(pose, range(4), 0.2), CAMERA, PARAMETERS).hypotheses
    points = PAD.all_corners[:4].reshape(-1, 3)

    def pixels(step):
        rotation = cv2.Rodrigues(step[3:])[0] @ hypothesis.rotation
        return CAMERA.project(points @ rotation.T + hypothesis.translation + step[:3]).ravel()

    jacobian = np.column_stack([(pixels(1e-6 * axis) - pixels(-1e-6 * axis)) / 2e-6 for axis in np.eye(6)])
    np.testing.assert_allclose(
        hypothesis.covariance, np.linalg.inv(jacobian.T @ jacobian) * 0.2**2, rtol=2e-3, atol=1e-12
    )


@pytest.mark.parametrize("height", [0.5, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("tilt", [0.0, 0.0625, 0.25, 0.625])
def test_round_numbers_on_which_opencv_gives_nan_are_solved(height, tilt):
    for axis in (0.0, 0.5, 1.5):
        for turn in (0.0, 0.5, 2.0):
            pose = look_down(height, tilt=tilt, axis=axis, turn=turn)
            tags = [tag for tag in see(pose, [0, 1, 2, 8], 0.1) if (np.abs(tag.corners - [320, 240]) < 240).all()]
            answer = solve_pad_pose(PAD, tags, CAMERA, PARAMETERS)
            assert answer.rejected == ()
            assert min(np.abs(error_of(hypothesis, pose)).max() for hypothesis in answer.hypotheses) < 1e-4


def test_both_poses_of_a_small_far_tag_are_kept_and_one_is_true():
    rng = np.random.default_rng(4)
    both = 0
    for _ in range(60):
        pose = look_down(4.0, tilt=0.3, axis=rng.uniform(0, 6.28), turn=rng.uniform(0, 6.28))
        answer = solve_pad_pose(PAD, see(pose, [0], 0.15, rng), CAMERA, PARAMETERS)
        both += len(answer.hypotheses) == 2
        turns = [np.linalg.norm(error_of(hypothesis, pose)[3:]) for hypothesis in answer.hypotheses]
        assert min(turns) < 0.25
        errors = [hypothesis.reprojection_rms for hypothesis in answer.hypotheses]
        assert errors == sorted(errors)
    assert both >= 40


def test_a_large_near_tag_has_one_pose():
    rng = np.random.default_rng(4)
    pose = look_down(0.7, tilt=0.4, axis=1.0)
    assert len(solve_pad_pose(PAD, see(pose, [0], 0.05, rng), CAMERA, PARAMETERS).hypotheses) == 1


def test_a_wrong_tag_is_outvoted():
    rng = np.random.default_rng(6)
    pose = look_down(1.5, tilt=0.3, axis=2.0)
    tags = see(pose, [0, 1, 2, 5], 0.1, rng, shifts={1: [25.0, -10.0]})
    answer = solve_pad_pose(PAD, tags, CAMERA, PARAMETERS)
    assert [tag.id for tag in answer.rejected] == [1]
    assert np.abs(error_of(answer.hypotheses[0], pose)).max() < 0.02


def test_a_tag_turned_by_a_quarter_is_outvoted():
    rng = np.random.default_rng(6)
    pose = look_down(1.5, tilt=0.3, axis=2.0)
    tags = see(pose, [0, 1, 2, 3], 0.1, rng)
    tags[2] = TagDetection(id=2, corners=np.roll(tags[2].corners, 1, axis=0), corner_sigma=0.1, method="test")
    answer = solve_pad_pose(PAD, tags, CAMERA, PARAMETERS)
    assert [tag.id for tag in answer.rejected] == [2]


def test_a_twin_of_one_tag_is_told_apart_by_the_others():
    pose = look_down(1.5, tilt=0.3, axis=2.0)
    tags = see(pose, [0, 1, 2], 0.1)
    twin = TagDetection(id=1, corners=tags[1].corners + np.array([60.0, 40.0]), corner_sigma=0.1, method="test")
    answer = solve_pad_pose(PAD, [tags[0], twin, tags[1], tags[2]], CAMERA, PARAMETERS)
    assert answer.rejected == (twin,)
    assert np.abs(error_of(answer.hypotheses[0], pose)).max() < 1e-3


@pytest.mark.parametrize("ids", [(0,), (0, 1, 2)])
def test_two_equal_pads_are_no_pose(ids):
    left, right = look_down(2.5, x=-0.6), look_down(2.5, x=0.6)
    answer = solve_pad_pose(PAD, see(left, ids, 0.1) + see(right, ids, 0.1), CAMERA, PARAMETERS)
    assert answer.hypotheses == ()
    assert "contradict" in answer.reason


def test_two_tags_that_contradict_each_other_are_no_pose():
    answer = solve_pad_pose(PAD, see(look_down(1.5), [0, 1], 0.1, shifts={1: [80.0, 0.0]}), CAMERA, PARAMETERS)
    assert answer.hypotheses == ()


def test_a_badly_printed_pad_grows_the_covariance_and_is_still_solved():
    rng = np.random.default_rng(1)
    pose = look_down(1.0, tilt=0.2)
    shifts = {tag_id: rng.normal(0.0, 0.4, 2) for tag_id in range(8)}
    crooked = solve_pad_pose(PAD, see(pose, range(8), 0.05, shifts=shifts), CAMERA, PARAMETERS)
    straight = solve_pad_pose(PAD, see(pose, range(8), 0.05), CAMERA, PARAMETERS)
    assert len(crooked.used) == 8
    assert np.trace(crooked.hypotheses[0].covariance) > 4.0 * np.trace(straight.hypotheses[0].covariance)


BROKEN = {
    "not a number": np.full((4, 2), np.nan),
    "one point": np.full((4, 2), 100.0),
    "on a line": np.array([[10.0, 10], [20, 20], [30, 30], [40, 40]]),
    "three corners on a line": np.array([[10.0, 10], [20, 20], [30, 30], [10, 40]]),
    "crossed": np.array([[10.0, 10], [50, 50], [50, 10], [10, 50]]),
    "mirrored": np.array([[10.0, 10], [10, 50], [50, 50], [50, 10]]),
    "infinite": np.array([[10.0, 10], [np.inf, 10], [50, 50], [10, 50]]),
    "huge": np.array([[-1e9, -1e9], [1e9, -1e9], [1e9, 1e9], [-1e9, 1e9]]),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_corners_raise_nothing_and_give_nothing_that_is_not_finite(name):
    tag = TagDetection(id=0, corners=BROKEN[name], corner_sigma=0.1, method="test")
    answer = solve_pad_pose(PAD, [tag], CAMERA, PARAMETERS)
    for hypothesis in answer.hypotheses:
        assert np.isfinite(hypothesis.covariance).all()
        assert np.isfinite(hypothesis.translation).all()
        assert np.linalg.eigvalsh(hypothesis.covariance).min() > 0.0
    beside = solve_pad_pose(PAD, [tag, *see(look_down(1.5), [1, 2], 0.1)], CAMERA, PARAMETERS)
    assert {used.id for used in beside.used} >= {1, 2}


@given(st.lists(st.floats(-2000, 2000), min_size=8, max_size=8), st.floats(1e-3, 10))
@settings(max_examples=80, deadline=None)
def test_any_quad_is_survived(numbers, sigma):
    tag = TagDetection(id=3, corners=np.array(numbers).reshape(4, 2), corner_sigma=sigma, method="test")
    for hypothesis in solve_pad_pose(single_tag_pad(3, 0.2), [tag], CAMERA, PARAMETERS).hypotheses:
        assert np.isfinite(hypothesis.covariance).all()
        np.testing.assert_allclose(hypothesis.rotation @ hypothesis.rotation.T, np.eye(3), atol=1e-6)
        assert hypothesis.translation[2] > 0.0


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, np.inf])
def test_a_tag_without_a_usable_sigma_is_ignored(sigma):
    (tag,) = see(look_down(1.5), [0], 0.1)
    odd = TagDetection(id=0, corners=tag.corners, corner_sigma=sigma, method="test")
    assert solve_pad_pose(PAD, [odd], CAMERA, PARAMETERS).reason == "no tag of the pad"


def test_tags_of_other_pads_are_ignored():
    (tag,) = see(look_down(1.5), [0], 0.1)
    other = TagDetection(id=300, corners=tag.corners, corner_sigma=0.1, method="test")
    assert solve_pad_pose(PAD, [other], CAMERA, PARAMETERS).hypotheses == ()
    assert solve_pad_pose(PAD, [other, tag], CAMERA, PARAMETERS).used == (tag,)
