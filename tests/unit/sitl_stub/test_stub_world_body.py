"""Bodies with upright faces in the simulated world: which faces are seen, where, and that both cameras agree."""

import math

import numpy as np
import pytest

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.documents import WorldFileError
from sitl_stub.world.exposure import board_poses
from sitl_stub.world.pads import find_pad, load_pad
from sitl_stub.world.world import World

BODY = load_pad(find_pad("rover_target"))
BACK = {20, 21}


def test_a_face_looks_away_from_the_body_with_its_top_up() -> None:
    for face, pose in zip(BODY.faces, board_poses(BODY, (3.0, -2.0, 0.0), 0.7), strict=True):
        outward = pose.center_ned - (3.0, -2.0, pose.center_ned[2])
        assert pose.ned_from_board[:, 2] @ outward < 0.0
        assert pose.ned_from_board[:, 0] == pytest.approx([0.0, 0.0, -1.0])
        assert np.linalg.det(pose.ned_from_board) == pytest.approx(1.0)
        assert pose.center_ned[2] == pytest.approx(face.center[2])
        assert pose.is_before(pose.center_ned + outward)
        assert not pose.is_before(np.array([3.0, -2.0, -0.3]))


def frame_of(kind, seed=2):
    simulation = Simulation(World.load("rover_follow"), load_vehicle("rover"), seed, kind)
    simulation.advance(0.5)
    return simulation.frames()[-1], simulation.truth()


def test_from_behind_the_two_faces_of_the_back_are_seen_side_by_side() -> None:
    frame, _ = frame_of("corners")
    corners = dict(frame.tags)
    assert set(corners) == BACK
    left, right = corners[21], corners[20]  # -150 degrees looks back and to the left
    assert left[:, 0].max() < right[:, 0].min()
    for quad in corners.values():
        assert quad[0, 0] < quad[1, 0]  # top left, top right
        assert quad[0, 1] < quad[3, 1]  # the top is up


def test_the_rendered_tags_are_where_the_corners_camera_sees_them() -> None:
    import cv2

    given, _ = frame_of("corners")
    rendered, _ = frame_of("rendered")
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    found, ids, _ = detector.detectMarkers(rendered.image)
    corners = {int(tag): quad[0] for tag, quad in zip(ids.ravel(), found, strict=True)}
    assert set(corners) == BACK
    for tag, quad in given.tags:
        # OpenCV begins with the opposite corner of an AprilTag
        assert np.abs(np.roll(corners[tag], 2, axis=0) - quad).max() < 1.5


def test_nothing_stands_on_a_body_and_the_ground_below_it_is_ground() -> None:
    simulation = Simulation(World.load("rover_follow"), load_vehicle("rover"), 2, "corners")
    place = simulation.truth().targets[0].position_ned
    assert place[2] == 0.0
    running = World.load("rover_follow").start(np.random.SeedSequence(2), "corners", load_vehicle("rover").camera)
    assert running.targets.surface_under(place[0], place[1])[1] == "ground"


def test_a_face_turned_away_is_not_seen() -> None:
    """From ahead of the body the front is seen, heading east from the south its right side."""
    for yaw, expected in ((math.pi, {24, 25}), (0.5 * math.pi, {20, 22, 24}), (-0.5 * math.pi, {21, 23, 25})):
        poses = board_poses(BODY, (3.0, 0.0, 0.0), yaw)
        ids = {face.tags[0].id for face, pose in zip(BODY.faces, poses, strict=True) if pose.is_before(np.zeros(3))}
        assert ids == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("id: 21", "id: 20", "stands twice"),
        ("faces:", "tags: [{id: 1, size_m: 0.1, x_m: 0, y_m: 0}]\nfaces:", "one of the two"),
        ("facing_deg: 150, ", "", "facing_deg"),
    ],
)
def test_mistakes_in_a_body_are_told(tmp_path, old, new, expected) -> None:
    path = tmp_path / "body.yaml"
    path.write_text(find_pad("rover_target").read_text(encoding="utf-8").replace(old, new, 1))
    with pytest.raises(WorldFileError, match=expected):
        load_pad(path)
