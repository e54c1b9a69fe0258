"""Bodies with upright boards: their files, and their pose from tags in several planes."""

import math
from pathlib import Path

import numpy as np
import pytest

from companion.errors import InputError
from companion.geometry.rotations import rotation_about_z
from companion.geometry.transform import RigidTransform
from companion.messages.perception import TagDetection
from companion.perception.calibration_file import load_calibration
from companion.perception.pad_file import load_pad
from companion.perception.pad_pose import solve_pad_pose
from companion.perception.pose_parameters import PoseParameters
from companion.perception.window import WindowParameters, predict_window

CONFIG = Path(__file__).resolve().parents[3] / "config"
BODY = load_pad(CONFIG / "pads" / "rover_target.yaml")
DOCK = load_pad(CONFIG / "pads" / "free_flyer_dock.yaml")  # in its place the camera has its origin behind itself
CAMERA = load_calibration(CONFIG / "cameras" / "sim_640x480.yaml")
FRD_FROM_CAM = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # looks ahead, picture's top up
CAMERA_HEIGHT = 0.32


def seen(place, heading, *, sigma=0.05, dice=None, body=BODY):
    """Give what is seen of `body` at `place` ahead and right [m] of the camera: the faces turned to it, with noise."""
    body_in_level = np.array([*place, CAMERA_HEIGHT])
    tags = []
    for face in body.faces:
        for tag in face.tags:
            corners = body.corners[tag.id] @ rotation_about_z(heading).T + body_in_level
            outward = rotation_about_z(heading) @ (math.cos(face.facing), math.sin(face.facing), 0.0)
            if outward @ corners.mean(axis=0) > -0.3 * np.linalg.norm(corners.mean(axis=0)):
                continue  # seen under more than 70 degrees, or from behind
            in_cam = corners @ FRD_FROM_CAM
            pixels = CAMERA.project(in_cam) if (in_cam[:, 2] > 0.1).all() else None
            if pixels is None or not ((pixels > 2.0) & (pixels < (637.0, 477.0))).all():
                continue
            noise = 0.0 if dice is None else dice.normal(0.0, sigma, (4, 2))
            tags.append(TagDetection(id=tag.id, corners=pixels + noise, corner_sigma=sigma, method="made up"))
    return tags


def solved(tags, body=BODY):
    pose = solve_pad_pose(body, tags, CAMERA, PoseParameters())
    assert pose.hypotheses, pose.reason
    best = pose.hypotheses[0]
    turned = FRD_FROM_CAM @ best.rotation
    return FRD_FROM_CAM @ best.translation, math.atan2(turned[1, 0], turned[0, 0]), pose


@pytest.mark.parametrize("heading", np.linspace(-math.pi, math.pi, 13))
@pytest.mark.parametrize("place", [(3.0, 0.0), (1.6, 0.2), (6.0, -1.5)])
def test_the_pose_is_found_from_every_side(place, heading) -> None:
    tags = seen(place, heading, dice=np.random.default_rng(7))
    assert len(tags) >= 1
    position, found, pose = solved(tags)
    assert math.remainder(found - heading, math.tau) == pytest.approx(0.0, abs=0.03 if len(tags) > 1 else 0.2)
    assert position[:2] == pytest.approx(place, abs=0.01 * math.hypot(*place))
    assert len(pose.hypotheses) <= 2


def test_seen_straight_from_behind_two_faces_give_the_heading_that_one_does_not() -> None:
    """Why the body has an edge to the back: a single plane seen head-on hardly tells how it is turned."""
    deviations = []
    for heading, count in ((0.0, 2), (math.radians(30.0), 1)):
        tags = seen((1.6, 0.0), heading)
        facing = sorted(tags, key=lambda tag: abs(tag.corners[:, 0].mean() - 320.0))[:count]
        best = solve_pad_pose(BODY, facing, CAMERA, PoseParameters()).hypotheses[0]
        in_level = FRD_FROM_CAM @ best.covariance[3:, 3:] @ FRD_FROM_CAM.T
        deviations.append(math.sqrt(in_level[2, 2]))
    assert deviations[1] > 1.5 * deviations[0]


@pytest.mark.parametrize(
    ("body", "place", "heading"), [(BODY, (2.5, 0.3), 0.2), (DOCK, (-0.2, 0.0), 0.0), (DOCK, (-0.2, 0.03), 0.1)]
)
def test_the_covariance_covers_the_scatter_and_there_is_one_pose(body, place, heading) -> None:
    dice = np.random.default_rng(11)
    errors = []
    for _ in range(200):
        tags = seen(place, heading, dice=dice, body=body)
        assert len(tags) == 2
        position, found, pose = solved(tags, body)
        assert len(pose.hypotheses) == 1
        covariance = pose.hypotheses[0].covariance
        in_level = FRD_FROM_CAM @ covariance[:3, :3] @ FRD_FROM_CAM.T
        error = position - (*place, CAMERA_HEIGHT)
        errors.append(float(error @ np.linalg.solve(in_level, error)))
        assert found == pytest.approx(heading, abs=0.02)
    assert 2.0 < np.mean(errors) < 4.0  # three degrees of freedom


@pytest.mark.parametrize("place", [(-0.2, 0.0), (-0.15, 0.05), (1.5, 0.2)])
def test_the_window_holds_the_boards_also_where_the_origin_is_behind_the_camera(place) -> None:
    cam_from_body = RigidTransform(
        rotation=FRD_FROM_CAM.T @ rotation_about_z(0.1),
        translation=FRD_FROM_CAM.T @ np.array([*place, CAMERA_HEIGHT]),
    )
    window = predict_window(DOCK, CAMERA, cam_from_body, WindowParameters())
    assert window is not None
    tags = seen(place, 0.1, body=DOCK)
    assert tags
    for tag in tags:
        assert (tag.corners >= (window.left, window.top)).all()
        assert (tag.corners <= (window.right - 1, window.bottom - 1)).all()


@pytest.mark.parametrize("place", [(0.0, 3.0), (-1.2, 0.0), (-3.0, 0.5)])
def test_boards_beside_or_behind_the_camera_have_no_window(place) -> None:
    cam_from_body = RigidTransform(
        rotation=FRD_FROM_CAM.T, translation=FRD_FROM_CAM.T @ np.array([*place, CAMERA_HEIGHT])
    )
    assert not seen(place, 0.0, body=DOCK)
    assert predict_window(DOCK, CAMERA, cam_from_body, WindowParameters(position_sigma=0.01)) is None


def test_the_boards_of_the_project_have_room_for_their_margin() -> None:
    """A tag needs a white module around its eight."""
    for face in BODY.faces:
        for tag in face.tags:
            assert tag.size * 10.0 / 8.0 <= min(face.size) + 1e-9
    assert BODY.upright


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("id: 21", "id: 20", "on the pad already"),
        ("size_m: 0.36, x_m: 0, y_m: 0", "size_m: 0.36, x_m: 0.2, y_m: 0", "hangs over the rim"),
        ("height_m: 0.325", "height_m: -0.1", "height_m"),
        ("faces:", "tags: [{id: 1, size_m: 0.1, x_m: 0, y_m: 0}]\nfaces:", "tags or faces, not both"),
        ("faces:", "landing_point_m: [0.1, 0.0]\nfaces:", "count from its reference point"),
    ],
)
def test_mistakes_are_told(tmp_path, old, new, expected) -> None:
    text = (CONFIG / "pads" / "rover_target.yaml").read_text()
    path = tmp_path / "body.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=expected):
        load_pad(path)


def test_how_far_a_place_is_from_the_boards() -> None:
    target, dock = (load_pad(CONFIG / "pads" / f"free_flyer_{name}.yaml") for name in ("target", "dock"))
    assert (target.boards_ahead, dock.boards_ahead) == pytest.approx((0.0, 0.65), abs=1e-3)
    assert (target.boards_radius, dock.boards_radius) == pytest.approx((0.22, 0.16), abs=1e-3)
    assert target.clearance(-0.7, 0.0) == pytest.approx(0.7 - 0.22, abs=0.001)  # an edge looks back
    assert target.clearance(0.0, 1.0) == pytest.approx(1.0 - 0.1905, abs=0.001)  # a face looks aside
    assert dock.clearance(0.0, 0.0) == pytest.approx(0.65 - 0.16, abs=0.001)
    assert target.clearance(0.05, -0.02) < 0.0
    assert BODY.clearance(-0.1, 0.0) < 0.0
    board = load_pad(CONFIG / "pads" / "landing_pad_0p8.yaml")
    assert (board.boards_ahead, board.clearance(0.0, 0.0)) == (0.0, math.inf)
