from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from companion.camera.source import CameraStalled
from companion.geometry.rotations import rotation_from_euler
from companion.messages.perception import PadObservation, PoseHypothesis
from companion.preflight.camera import CameraReport, judge_camera
from companion.preflight.finding import Verdict
from companion.preflight.mount import TiltSample, judge_mount, measure_tilt
from companion.preflight.parameters import CameraLimits
from companion.preflight.picture import blur_effect, picture_quality

LIMITS = CameraLimits()


def scene(blur: float = 0.5, noise: float = 2.0, level: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(5)
    blocks = cv2.resize(rng.integers(0, 2, (60, 80)).astype(np.uint8), (640, 480), interpolation=cv2.INTER_NEAREST)
    picture = cv2.GaussianBlur(20.0 + 180.0 * blocks.astype(np.float32), (0, 0), blur)
    return np.clip(level * picture + rng.normal(0.0, noise, picture.shape), 0, 255).astype(np.uint8)


def test_blur_grows_with_the_width_of_edges_and_not_with_contrast() -> None:
    values = [blur_effect(scene(blur)) for blur in (0.5, 1.0, 2.0, 3.0, 4.0)]
    assert values == sorted(values)
    assert values[0] < 0.4
    assert values[-1] > LIMITS.blur_most
    assert blur_effect(scene(1.0, level=0.4)) == pytest.approx(values[1], abs=0.03)


def test_a_picture_without_anything_is_blurred() -> None:
    assert blur_effect(np.full((48, 64), 7, dtype=np.uint8)) == 1.0


def test_exposure() -> None:
    quality = picture_quality(scene(level=1.6))
    assert quality.bright == pytest.approx(0.5, abs=0.05)
    assert picture_quality(scene(level=0.0, noise=0.0)).dark == 1.0


def report(pictures: list[np.ndarray], *, rate: float = 30.0, gap: float = 0.0, **changes) -> CameraReport:
    arrivals = np.arange(90) / rate
    arrivals[45:] += gap
    fields = {
        "source": "/dev/video0",
        "failure": None,
        "arrivals": list(arrivals),
        "qualities": [picture_quality(picture) for picture in pictures],
        "observations": (),
        "pad": None,
        "troubles": (),
    }
    return CameraReport(**(fields | changes))


def not_fine(one: CameraReport) -> set[str]:
    return {f.check for f in judge_camera(one, LIMITS, (640, 480)) if f.verdict is Verdict.NOT_FINE}


@pytest.mark.parametrize(
    ("one", "rows"),
    [
        (report([scene()]), set()),
        (report([scene()], rate=10.0), {"frame rate"}),
        (report([scene()], gap=0.5), {"frame rate"}),
        (report([scene()], arrivals=[1.0]), {"frame rate"}),
        (report([scene()], troubles=[CameraStalled(t=1.0, silence=0.6, reason="x")]), {"frame rate"}),
        (report([scene(blur=5.0)]), {"sharpness"}),
        (report([scene(level=0.05)]), {"exposure", "sharpness"}),
        (report([scene(level=4.0)]), {"exposure"}),
        (report([], failure="cannot be opened"), {"camera"}),
    ],
)
def test_each_trouble_has_its_row(one: CameraReport, rows: set[str]) -> None:
    assert not_fine(one) == rows


@pytest.mark.parametrize(("error", "fine"), [(0.4, True), (3.0, False)])
def test_the_calibration_is_judged_by_the_pads_corners(error: float, fine: bool) -> None:
    pose = PoseHypothesis(
        rotation=np.eye(3), translation=np.array([0.0, 0.0, 1.0]), covariance=np.eye(6), reprojection_rms=error
    )
    seen = PadObservation(t=0.0, sequence=0, detections=(), hypotheses=(pose,), search="frame")
    one = report([scene()], observations=[seen] * 5, pad="my pad")
    row = next(f for f in judge_camera(one, LIMITS, (640, 480)) if f.check == "calibration")
    assert row.verdict is (Verdict.FINE if fine else Verdict.NOT_FINE)
    assert f"{error:.2f} px" in row.found


# ---- the tilt test


def samples(
    mount_roll: float, mount_pitch: float, slope: tuple[float, float], headings: np.ndarray, *, noise: float = 0.0
) -> list[TiltSample]:
    """What is seen where the true mount differs from the configured one by small angles [rad]."""
    rng = np.random.default_rng(2)
    ned_from_pad = rotation_from_euler(slope[1], -slope[0], 0.4)  # its downward axis leans to (north, east)
    found = []
    for heading in headings:
        roll, pitch = rng.normal(0.0, 0.08, 2)  # held by hand
        ned_from_frd = rotation_from_euler(roll, pitch, heading)
        frd_from_pad = ned_from_frd.T @ ned_from_pad
        true_from_configured = rotation_from_euler(mount_roll, mount_pitch, 0.0)
        wobble = rotation_from_euler(*rng.normal(0.0, noise, 3))
        found.append(TiltSample(frd_from_pad=true_from_configured.T @ wobble @ frd_from_pad, ned_from_frd=ned_from_frd))
    return found


ROLL, PITCH = math.radians(2.0), math.radians(-1.2)


def test_on_a_level_pad_one_heading_is_enough() -> None:
    result = measure_tilt(samples(ROLL, PITCH, (0.0, 0.0), np.full(10, 0.7)))
    assert result is not None
    assert not result.separated
    assert result.roll == pytest.approx(ROLL, abs=0.004)
    assert result.pitch == pytest.approx(PITCH, abs=0.004)


def test_turning_about_tells_the_mount_from_a_pad_that_slopes() -> None:
    slope = (math.radians(3.0), math.radians(-2.0))
    standing = measure_tilt(samples(ROLL, PITCH, slope, np.full(12, 0.7)))
    turned = measure_tilt(samples(ROLL, PITCH, slope, np.linspace(0.7, 0.7 + math.pi, 12), noise=0.002))
    assert standing is not None
    assert turned is not None
    assert math.hypot(standing.roll - ROLL, standing.pitch - PITCH) > math.radians(2.0)
    assert turned.separated
    assert turned.roll == pytest.approx(ROLL, abs=0.005)
    assert turned.pitch == pytest.approx(PITCH, abs=0.005)
    assert turned.slope == pytest.approx(math.hypot(*slope), abs=0.006)
    assert turned.scatter < 0.01


def test_the_correction_is_told_with_its_sign() -> None:
    off = judge_mount(measure_tilt(samples(ROLL, PITCH, (0.0, 0.0), np.linspace(0.0, 3.0, 12))), "pad", LIMITS)
    assert off.verdict is Verdict.NOT_FINE
    assert "add +2.0 to camera.mount.roll_deg and -1.2 to pitch_deg" in off.wanted
    right = judge_mount(measure_tilt(samples(0.0, 0.0, (0.0, 0.0), np.full(8, 0.1))), "pad", LIMITS)
    assert right.verdict is Verdict.FINE


@pytest.mark.parametrize(("pad", "word"), [(None, "--mission"), ("my pad", "turn it half round")])
def test_without_a_pad_in_sight_it_says_what_to_do(pad: str | None, word: str) -> None:
    finding = judge_mount(measure_tilt(samples(0.0, 0.0, (0.0, 0.0), np.zeros(4))), pad, LIMITS)
    assert finding.verdict is Verdict.NOT_CHECKED
    assert word in finding.wanted
