"""Sight taken away, and targets shown where they are not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from stub_world_support import CAMERA, PAD, truth

from sitl_stub.world.camera import CameraFaults, CameraSensor, Frame
from sitl_stub.world.corners import CornersImager
from sitl_stub.world.documents import WorldFileError
from sitl_stub.world.exposure import Scene, board_poses
from sitl_stub.world.pads import find_pad, load_pad
from sitl_stub.world.sight import Blindness, Misplacement
from sitl_stub.world.world import World

CLEAN = CameraFaults(lost=0.0, bad=0.0)
STEP = 0.004


def film(faults: CameraFaults, seconds: float, seed: int = 3) -> list[Frame]:
    rng = np.random.default_rng(seed)
    imager = CornersImager(CAMERA.intrinsics, (PAD,), np.random.default_rng(9))
    sensor, frames = CameraSensor(CAMERA, faults, imager, (PAD,), rng), []
    for k in range(1, round(seconds / STEP) + 1):
        sensor.step(k * STEP, truth(k * STEP, (0.0, 0.0, -2.0)))
        frames += sensor.frames(k * STEP)
    return frames


def middle(frame: Frame) -> np.ndarray:
    assert frame.tags
    return np.concatenate([corners for _, corners in frame.tags]).mean(axis=0)


@pytest.mark.parametrize("kind", ["no_frames", "no_tag"])
def test_sight_is_lost_after_each_time_of_sight(kind: str) -> None:
    blind = Blindness(kind=kind, length=1.0, sight=2.0, begin=1.0, end=6.5)
    frames = film(dataclasses.replace(CLEAN, blindness=blind), 8.0)
    seen = [frame.t_capture for frame in frames if frame.tags]
    gone = [(3.0, 4.0), (6.0, 6.5)]
    assert not [t for t in seen if any(a <= t < b for a, b in gone)]
    assert len(seen) == pytest.approx(30.0 * (8.0 - 1.5 - CAMERA.latency), abs=4)
    blank = [frame.t_capture for frame in frames if not frame.tags]
    if kind == "no_frames":
        assert blank == []
    else:
        assert len(blank) == pytest.approx(45, abs=2)
        assert all(any(a <= t < b for a, b in gone) for t in blank)


def test_corrupted_frames_show_the_pad_elsewhere_and_leave_the_others_alone() -> None:
    clean, spoilt = film(CLEAN, 10.0), film(dataclasses.replace(CLEAN, corrupted=0.5), 10.0)
    assert [frame.t_capture for frame in clean] == [frame.t_capture for frame in spoilt]
    true = middle(clean[0])
    wrong = [frame for frame in spoilt if not frame.tags or np.abs(middle(frame) - true).max() > 8.0]
    assert len(wrong) / len(spoilt) == pytest.approx(0.5, abs=0.1)
    right = [np.abs(middle(frame) - true).max() for frame in spoilt if frame not in wrong]
    assert np.median(right) < 1.0
    again = film(dataclasses.replace(CLEAN, corrupted=0.5), 10.0)
    assert [len(frame.tags or ()) for frame in again] == [len(frame.tags or ()) for frame in spoilt]


def test_wrong_places_differ_from_frame_to_frame() -> None:
    places = np.array([middle(frame) for frame in film(dataclasses.replace(CLEAN, corrupted=1.0), 5.0) if frame.tags])
    assert len(places) > 50
    assert np.linalg.norm(places.std(axis=0)) > 50.0


def test_frames_come_no_more_often_than_the_interval_and_otherwise_as_before() -> None:
    every, some = film(CLEAN, 10.0), film(dataclasses.replace(CLEAN, interval=0.5), 10.0)
    times = [frame.t_capture for frame in some]
    assert np.diff(times) == pytest.approx([0.5] * 19, abs=1e-6)
    assert set(times) <= {frame.t_capture for frame in every}
    assert [frame.sequence for frame in some] == [15 * k for k in range(20)]


def test_a_body_seen_elsewhere_stands_on_its_floor_and_keeps_its_shape() -> None:
    pads = (load_pad(find_pad("free_flyer_dock")), PAD)
    boards = [*board_poses(pads[0], (2.0, 0.5, 0.0), 0.3), *board_poses(PAD, (1.0, 1.0, -0.15), 0.0)]
    ahead = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    scene = Scene(t=0.0, camera_ned=np.array([0.2, 0.0, -0.25]), ned_from_cam=ahead, boards=tuple(boards))
    ranges = []
    for seed in range(40):
        shown = Misplacement(pads, np.random.default_rng(seed))(scene).boards
        assert len(shown) == 7
        before, after = (np.array([board.center_ned for board in some[:6]]) for some in (boards, shown))
        assert after[:, 2] == pytest.approx(before[:, 2])
        sides = [np.linalg.norm(each - np.roll(each, 1, axis=0), axis=1) for each in (before, after)]
        assert sides[0] == pytest.approx(sides[1])
        assert all(abs(board.ned_from_board[2, 0] + 1.0) < 1e-9 for board in shown[:6])
        north, east = after[:, 0].mean() - 0.2, after[:, 1].mean()
        assert abs(np.arctan2(east, north)) < np.radians(24.1)
        ranges.append(np.hypot(north, east))
    assert min(ranges) > 0.49
    assert max(ranges) < 6.01
    assert np.std(ranges) > 1.0


def test_the_world_of_dropouts_covers_the_drive() -> None:
    blindness = World.load("dropouts").camera_faults.blindness
    assert blindness == Blindness(kind="no_frames", length=10.0, sight=5.0, begin=18.0, end=80.0)


@pytest.mark.parametrize("wrong", ["kind: dark, for_s: 3", "for_s: 0", "for_s: 3, sight_s: -1", "for_s: 3, every_s: 5"])
def test_wrong_keys_are_refused(tmp_path: Path, wrong: str) -> None:
    path = tmp_path / "w.yaml"
    path.write_text(f"version: 1\ncamera: {{blind: {{{wrong}}}}}\n")
    with pytest.raises(WorldFileError, match="blind"):
        World.load(path)
