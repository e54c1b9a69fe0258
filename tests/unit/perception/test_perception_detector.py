import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from perception_render import corners_of, look_down, render

from companion.perception.camera_model import CameraModel
from companion.perception.detector import AprilTagFinder, ArucoFinder, FoundTag, detect_tags, without_repeats
from companion.perception.edge_parameters import EdgeParameters

PHOTOS = Path(__file__).resolve().parents[4] / "shared" / "reference" / "photos"
NAMES = ("33369213973_9d9bb4cc96_c", "34085369442_304b6bafd9_c")
UNMARKED = np.array([370.0, 356.0])  # a real tag of the first photograph that has no mark

MATRIX = np.array([[460.0, 0, 319.5], [0, 460.0, 239.5], [0, 0, 1.0]])
CAMERA = CameraModel(width=640, height=480, fx=460.0, fy=460.0, cx=319.5, cy=239.5)
TAGS = [(0, 0.2, 0.12, -0.12, 0.0), (17, 0.2, -0.12, 0.12, 0.7), (586, 0.08, 0.2, 0.2, 2.5)]


def marks(name):
    rows = []
    for line in (PHOTOS / f"{name}.txt").read_text().splitlines():
        numbers = [float(word) for word in re.findall(r"[-\d.]+", line)]
        rows.append(np.array(numbers[1:]).reshape(4, 2) - 0.5)  # the marks' pixel centres lie at +0.5
    return rows


@pytest.mark.skipif(not PHOTOS.is_dir(), reason="the reference photographs lie beside the checkout, not in it")
def test_the_photographs_tags_are_found_once_and_nothing_else():
    found_marks, errors = 0, []
    for name in NAMES:
        image = cv2.imread(str(PHOTOS / f"{name}.jpg"), cv2.IMREAD_GRAYSCALE)
        wanted = marks(name)
        centres = np.array([quad.mean(axis=0) for quad in wanted])
        taken = set()
        for tag in detect_tags(image, AprilTagFinder(), camera=None, parameters=EdgeParameters()):
            assert tag.id == 0
            centre = tag.corners.mean(axis=0)
            nearest = int(np.argmin(np.linalg.norm(centres - centre, axis=1)))
            if np.linalg.norm(centres[nearest] - centre) > 4.0:
                assert np.linalg.norm(centre - UNMARKED) < 6.0, f"no tag is at {centre} of {name}"
                continue
            assert nearest not in taken, f"the tag at {centre} of {name} is found twice"
            taken.add(nearest)
            # the marks begin at any corner and run the other way round
            shifts = [np.roll(wanted[nearest][::-1], k, axis=0) - tag.corners for k in range(4)]
            best = min(shifts, key=lambda shift: float(np.abs(shift).max()))
            errors.extend(np.linalg.norm(best, axis=1))
        found_marks += len(taken)
    assert found_marks >= 36
    assert np.median(errors) < 0.6


@pytest.mark.parametrize("finder", [AprilTagFinder(), ArucoFinder([0, 17, 586])], ids=["apriltag", "aruco"])
@pytest.mark.parametrize("turn", [0.0, 0.8, 2.0, 4.0])
def test_corners_come_as_printed_in_both_detectors(finder, turn):
    pose = look_down(1.0, tilt=0.2, axis=1.0, turn=turn)
    image = render(TAGS, pose, MATRIX, blur=0.6)
    found = detect_tags(image, finder, camera=CAMERA, parameters=EdgeParameters())
    assert [tag.id for tag in found] == [0, 17, 586]
    for tag, seen in zip(TAGS, found, strict=True):
        truth = CAMERA.project(corners_of(tag) @ pose[0].T + pose[1])
        assert np.abs(seen.corners - truth).max() < 0.15
        assert seen.method == f"{finder.name}+edges"


@pytest.mark.parametrize("finder", [AprilTagFinder([17]), ArucoFinder([17])], ids=["apriltag", "aruco"])
def test_only_wanted_ids_are_found(finder):
    image = render(TAGS, look_down(1.0), MATRIX, blur=0.6)
    assert [tag.id for tag in finder.find(image, smallest_side=0.0)] == [17]


def test_unrefined_corners_have_no_half_pixel_shift():
    image = render(TAGS[:1], look_down(1.0, turn=0.3), MATRIX, blur=0.6)
    truth = CAMERA.project(corners_of(TAGS[0]) @ look_down(1.0, turn=0.3)[0].T + [0, 0, 1.0])
    (tag,) = AprilTagFinder().find(image, smallest_side=0.0)
    assert np.abs((tag.corners - truth).mean(axis=0)).max() < 0.1


@pytest.mark.parametrize("finder", [AprilTagFinder(), ArucoFinder(range(587))], ids=["apriltag", "aruco"])
def test_noise_and_nothing_hold_no_tag(finder):
    rng = np.random.default_rng(0)
    for image in (np.zeros((240, 320), np.uint8), rng.integers(0, 256, (240, 320)).astype(np.uint8)):
        assert finder.find(image, smallest_side=0.0) == []


def test_repeats_are_dropped_and_twins_kept():
    square = np.array([[0.0, 0], [20, 0], [20, 20], [0, 20]])
    tags = [
        FoundTag(id=4, corners=square, quality=1.0),
        FoundTag(id=4, corners=square + 1.0, quality=3.0),
        FoundTag(id=4, corners=square + 100.0, quality=2.0),
        FoundTag(id=5, corners=square, quality=1.0),
    ]
    kept = without_repeats(tags)
    assert [(tag.id, tag.quality) for tag in kept] == [(4, 3.0), (4, 2.0), (5, 1.0)]
    assert [tag.quality for tag in without_repeats(tags[::-1])] == [3.0, 2.0, 1.0]


@pytest.mark.parametrize("ids", [[], [-1], [587]])
def test_ids_outside_the_family_are_refused(ids):
    with pytest.raises(ValueError, match="expected ids"):
        ArucoFinder(ids)
