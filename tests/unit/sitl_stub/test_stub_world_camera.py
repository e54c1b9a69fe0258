"""The camera as a device: geometry of the mount and lens, timing, losses, and the corners it gives directly."""

from __future__ import annotations

import dataclasses
import math

import cv2
import numpy as np
import pytest
from stub_world_support import CAMERA, PAD, above_pad, exposure, on_board, truth

from sitl_stub.world.camera import CameraFaults, CameraSensor, Content, Dropout, Frame
from sitl_stub.world.corners import CornersImager, CornersModel
from sitl_stub.world.exposure import Exposure, Mount, board_pose

STEP = 0.004
PERFECT = CornersModel(
    sigma=(-50.0, *[0.0] * 6),
    sigma_limits=(0.0, 1.0),
    spread=0.0,
    miss=(-50.0, *[0.0] * 6),
    common=0.0,
    outliers=0.0,
    outlier_scale=1.0,
    border=0.0,
    smallest=0.0,
)


class Remembering:
    """Keeps the exposures it is asked for."""

    def __init__(self) -> None:
        self.exposures: list[Exposure] = []

    def capture(self, exposure: Exposure, *, bad: bool) -> Content:
        self.exposures.append(exposure)
        return Content(tags=(), sigmas=())


def film(faults: CameraFaults, seconds: float, seed: int = 1, step: float = STEP) -> tuple[list[Frame], Remembering]:
    imager = Remembering()
    sensor = CameraSensor(CAMERA, faults, imager, (PAD,), np.random.default_rng(seed))
    frames = []
    for k in range(1, round(seconds / step) + 1):
        t = k * step
        sensor.step(t, truth(t, (t * t, 0.0, -2.0), (0.0, 0.0, 0.1 * t), (0.0, 0.5 * t), 0.2 * t))
        new = sensor.frames(t)
        assert all(t - step < frame.t_delivery <= t for frame in new)
        frames += new
    return frames, imager


NO_FAULTS = CameraFaults(lost=0.0, bad=0.0)


def test_projection_is_opencvs() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.7, 0.7, (200, 2)), np.ones(200)]) * rng.uniform(0.2, 5.0, (200, 1))
    lens = CAMERA.intrinsics
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1.0]])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(lens.distortion))[0][:, 0]
    assert lens.project(points) == pytest.approx(expected, abs=1e-9)


def test_rays_undo_projection() -> None:
    lens = CAMERA.intrinsics
    pixels = np.stack(np.meshgrid(np.linspace(-10, 650, 40), np.linspace(-10, 490, 30)), axis=-1)
    assert lens.project(lens.rays(pixels)) == pytest.approx(pixels, abs=1e-8)


def test_the_top_of_the_picture_is_towards_the_nose() -> None:
    shot = exposure((0.0, 0.0, -2.0))
    scene = shot.at(0.0)
    lens = scene.camera_ned
    assert lens == pytest.approx([0.06, 0.0, -1.96])
    ahead, right = np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.3, 0.0])
    below = np.array([0.06, 0.0, 0.0])
    centre, up, side = (
        CAMERA.intrinsics.project((below + offset - lens) @ scene.ned_from_cam)
        for offset in (0.0 * ahead, ahead, right)
    )
    assert centre == pytest.approx([319.5, 239.5], abs=1e-6)
    assert up[1] < centre[1] - 50
    assert up[0] == pytest.approx(centre[0], abs=1.0)
    assert side[0] > centre[0] + 50


def test_nose_up_looks_ahead_and_a_turned_mount_does_too() -> None:
    pitched = exposure((0.0, 0.0, -2.0), (0.0, 0.3, 0.0)).at(0.0)
    assert (pitched.ned_from_cam @ [0.0, 0.0, 1.0])[0] == pytest.approx(math.sin(0.3))
    mount = Mount.looking_down((0.0, 0.0, 0.0), (0.0, 0.3, 0.0))
    assert (mount.frd_from_cam @ [0.0, 0.0, 1.0])[0] == pytest.approx(math.sin(0.3))


def test_the_board_lies_around_its_landing_point() -> None:
    pad = dataclasses.replace(PAD, landing_point=(0.1, -0.2), landing_heading=0.5)
    pose = board_pose(pad, (3.0, 4.0, -0.15), 0.8)
    assert pose.yaw == pytest.approx(0.3)
    assert pose.center_ned + pose.ned_from_board @ [0.1, -0.2, 0.0] == pytest.approx([3.0, 4.0, -0.15])


def test_frames_come_at_the_rate_with_the_latency() -> None:
    frames, _ = film(NO_FAULTS, 10.0)
    capture = np.array([frame.t_capture for frame in frames])
    delay = np.array([frame.t_delivery - frame.t_capture for frame in frames])
    assert np.diff(capture) == pytest.approx(1.0 / 30.0)
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert len(frames) in range(296, 301)
    assert delay.min() >= CAMERA.latency
    assert delay.mean() == pytest.approx(CAMERA.latency + CAMERA.latency_jitter * math.sqrt(2.0 / math.pi), abs=2e-4)


@pytest.mark.parametrize("step", [STEP, 0.001, 0.0015, 0.05])
def test_the_exposure_sees_the_true_poses_of_its_instants(step: float) -> None:
    frames, imager = film(NO_FAULTS, 2.0, step=step) if step < 0.03 else ([], _coarse(step))
    assert len(imager.exposures) > 50
    for shot in imager.exposures[1:]:
        assert shot.t_close - shot.t_open == pytest.approx(CAMERA.exposure)
        for t in (shot.t_open, shot.t_middle, shot.t_close):
            scene = shot.at(t)
            expected = exposure((t * t, 0.0, -2.0), (0.0, 0.0, 0.1 * t)).at(0.0)
            assert scene.camera_ned == pytest.approx(expected.camera_ned, abs=1e-7 + 0.26 * step**2)
            assert scene.ned_from_cam == pytest.approx(expected.ned_from_cam, abs=1e-7)
            assert scene.boards[0].center_ned == pytest.approx([0.0, 0.5 * t, -0.15], abs=1e-9)
            assert scene.boards[0].yaw == pytest.approx(0.2 * t)
    for frame, shot in zip(frames, imager.exposures, strict=False):
        assert frame.t_capture == pytest.approx(shot.t_middle)


def _coarse(step: float) -> Remembering:
    """Film with steps longer than the time between frames."""
    imager = Remembering()
    sensor = CameraSensor(CAMERA, NO_FAULTS, imager, (PAD,), np.random.default_rng(1))
    for k in range(1, round(3.0 / step) + 1):
        t = k * step
        sensor.step(t, truth(t, (t * t, 0.0, -2.0), (0.0, 0.0, 0.1 * t), (0.0, 0.5 * t), 0.2 * t))
    return imager


def test_phase_is_drawn_and_seeds_repeat() -> None:
    first, again, other = (film(CameraFaults(), 1.0, seed)[0] for seed in (1, 1, 2))
    assert [f.t_delivery for f in first] == [f.t_delivery for f in again]
    assert first[0].t_capture != other[0].t_capture


def test_lost_frames_leave_gaps_in_the_sequence() -> None:
    frames, _ = film(CameraFaults(lost=0.2, bad=0.0), 60.0)
    numbers = [frame.sequence for frame in frames]
    assert numbers == sorted(set(numbers))
    assert len(numbers) / numbers[-1] == pytest.approx(0.8, abs=0.05)
    assert np.diff([f.t_capture for f in frames]) == pytest.approx(np.diff(numbers) / 30.0)


def test_a_dropout_schedule_is_kept_and_repeats() -> None:
    once = CameraFaults(lost=0.0, bad=0.0, dropouts=(Dropout(begin=1.0, length=0.5),))
    times = [frame.t_capture for frame in film(once, 6.0)[0]]
    assert not [t for t in times if 1.0 <= t < 1.5]
    assert len(times) in range(162, 168)
    repeated = dataclasses.replace(once, dropout_period=2.0)
    times = [frame.t_capture for frame in film(repeated, 6.0)[0]]
    assert not [t for t in times if 1.0 <= t % 2.0 < 1.5]


def test_corners_without_noise_are_the_exact_projection() -> None:
    camera = CornersImager(CAMERA.intrinsics, (PAD,), np.random.default_rng(0), PERFECT)
    shot = exposure(above_pad(1.2), (0.1, -0.15, 2.0), velocity=(0.5, 0.2, -0.1), rates=(0.3, -0.2, 0.5), pad_yaw=0.4)
    content = camera.capture(shot, bad=False)
    assert content.tags is not None
    assert content.sigmas is not None
    assert [i for i, _ in content.tags] == list(range(12))
    assert len(content.sigmas) == 12
    for tag, (_, corners) in zip(PAD.tags, content.tags, strict=True):
        assert corners == pytest.approx(on_board(shot.at(0.0), tag.corners_board()), abs=1e-9)


def test_corners_are_given_only_for_tags_wholly_in_view_from_above() -> None:
    camera = CornersImager(CAMERA.intrinsics, (PAD,), np.random.default_rng(0), PERFECT)
    low = camera.capture(exposure(above_pad(0.2)), bad=False).tags
    assert low is not None
    assert [i for i, _ in low] == [8, 9, 10, 11]
    for nothing in (
        exposure((0.0, 0.0, -0.1)),
        exposure(above_pad(1.0), (math.pi, 0.0, 0.0)),
        exposure(above_pad(1.0, 9.0)),
    ):
        assert camera.capture(nothing, bad=False).tags == ()
    assert camera.capture(exposure(above_pad(1.0)), bad=True).tags == ()


def test_steep_low_views_with_tags_behind_the_lens_are_no_trouble() -> None:
    camera = CornersImager(CAMERA.intrinsics, (PAD,), np.random.default_rng(0), PERFECT)
    for pitch in np.linspace(-1.5, 1.5, 31):
        for _, corners in camera.capture(exposure(above_pad(0.15), (0.2, float(pitch), 0.0)), bad=False).tags or ():
            assert np.isfinite(corners).all()
            assert corners.min() >= 0.0


def test_stated_deviations_are_those_of_the_noise() -> None:
    model = dataclasses.replace(CornersModel.load(), outliers=0.0, spread=0.0)
    camera = CornersImager(CAMERA.intrinsics, (PAD,), np.random.default_rng(0), model)
    shot = exposure(above_pad(1.0), (0.1, 0.0, 0.0))
    scaled = []
    for _ in range(200):
        content = camera.capture(shot, bad=False)
        for (number, corners), sigma in zip(content.tags or (), content.sigmas or (), strict=True):
            scaled.append((corners - on_board(shot.at(0.0), PAD.tags[number].corners_board())) / sigma)
    assert np.std(scaled) == pytest.approx(1.0, rel=0.05)
    assert abs(np.mean(scaled)) < 0.05
