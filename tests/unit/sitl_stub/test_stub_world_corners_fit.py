"""The fast camera against the rendered one, both seen through the companion: fresh views, not those of the fit."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest
from stub_world_support import CAMERA

TOOL = Path(__file__).resolve().parents[3] / "bench" / "fit_corners_camera.py"
SIDES = ((11.5, 14.0), (14.0, 17.0), (17.0, 22.0), (22.0, 35.0), (35.0, 70.0), (70.0, 300.0))  # [px]
# [modules] moved during the exposure; the last are few, and their noise rises by ten from end to end
MOTIONS = ((0.0, 0.2, 1.35), (0.2, 0.5, 1.35), (0.5, 1.0, 1.5), (1.0, 2.5, 2.0))


def _tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fit_corners_camera", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


tool = _tool()


@pytest.fixture(scope="module")
def rendered():
    return tool.sample(420, 77, rendered=True)


@pytest.fixture(scope="module")
def fast():
    return tool.sample(3000, 78, rendered=False)


def inside(data, low: float, high: float, value: np.ndarray):
    return data.part((value >= low) & (value < high) & (data.border > 3.0))


def noise(data) -> np.ndarray:
    """Give the rms corner error [px] of every tag found."""
    good = data.error[data.found & ~data.rejected]
    return np.sqrt((good**2).mean(axis=(1, 2)))


@pytest.mark.parametrize(("low", "high"), SIDES)
def test_noise_and_misses_agree_for_every_size(rendered, fast, low: float, high: float) -> None:
    real, model = (inside(data, low, high, data.side) for data in (rendered, fast))
    assert real.found.sum() > 20
    chance = 1.0 + 2.0 / np.sqrt(real.found.sum())  # quantiles of few tags scatter
    for quantile, factor in ((0.5, 1.35 * chance), (0.9, 1.6 * chance)):
        ratio = np.quantile(noise(model), quantile) / np.quantile(noise(real), quantile)
        assert 1.0 / factor < ratio < factor
    by_frame = [real.found[real.frame == k].mean() for k in np.unique(real.frame)]  # a frame's tags are missed together
    assert abs(model.found.mean() - real.found.mean()) < 0.04 + 2.5 * np.std(by_frame) / np.sqrt(len(by_frame))


@pytest.mark.parametrize(("low", "high", "factor"), MOTIONS)
def test_noise_and_misses_agree_for_every_motion(rendered, fast, low: float, high: float, factor: float) -> None:
    real, model = (
        data.part(data.side > 20.0)
        for data in (inside(data, low, high, data.features[:, 3]) for data in (rendered, fast))
    )
    assert real.found.sum() > 30
    ratio = np.median(noise(model)) / np.median(noise(real))
    assert 1.0 / factor < ratio < factor
    assert abs(model.found.mean() - real.found.mean()) < 0.08


def test_outliers_are_as_frequent(rendered, fast) -> None:
    model = tool.CornersModel.load()

    def share(data) -> float:
        part = inside(data, 14.0, 300.0, data.side)
        scaled = noise(part) / model.sigmas(part.features[part.found & ~part.rejected])
        return float(((scaled > 4.0).sum() + part.rejected.sum()) / part.found.sum())

    assert 0.0 < share(fast) < 0.05
    assert abs(share(rendered) - share(fast)) < 0.015


def test_both_see_at_least_one_tag_in_as_many_frames(rendered, fast) -> None:
    def share(data) -> float:
        part = data.part((data.side > 20.0) & (data.border > 5.0))
        return float(np.mean([part.found[part.frame == k].any() for k in np.unique(part.frame)]))

    assert abs(share(rendered) - share(fast)) < 0.03


def test_the_noise_has_no_bias(rendered) -> None:
    big = inside(rendered, 25.0, 300.0, rendered.side)
    error = big.error[big.found & ~big.rejected]
    assert np.abs(np.median(error.reshape(-1, 2), axis=0)).max() < 0.004
    outward = big.exact[big.found & ~big.rejected]
    outward = outward - outward.mean(axis=1, keepdims=True)
    outward /= np.linalg.norm(outward, axis=2, keepdims=True)
    assert abs(np.median((error * outward).sum(axis=2))) < 0.01


def flips(data, count: int) -> float:
    """Give the share of single tags whose pose with the smaller reprojection error is the wrong one of the two."""
    part = inside(data, 20.0, 60.0, data.side)
    part = part.part(part.found & ~part.rejected)
    lens = CAMERA.intrinsics
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1.0]])
    bending = np.array(lens.distortion)
    square = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])

    def normals(corners: np.ndarray) -> list[np.ndarray]:
        _, turns, _, _ = cv2.solvePnPGeneric(square, corners, matrix, bending, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        return [cv2.Rodrigues(turn)[0][:, 2] for turn in turns]

    wrong = []
    for exact, error in zip(part.exact[:count], part.error[:count], strict=True):
        true, other = normals(exact)
        chosen = normals(exact + error)[0]
        wrong.append(chosen @ true < chosen @ other)
    return float(np.mean(wrong))


def test_poses_of_single_tags_flip_as_often(rendered, fast) -> None:
    real, model = flips(rendered, 2000), flips(fast, 3000)
    assert 0.0 < model < 0.2
    assert abs(real - model) < 0.02
