"""The fast camera: tag corners directly, spoilt the way a real detector's are on rendered pictures.

The numbers in `corners.yaml` are fitted by `bench/fit_corners_camera.py` to the rendered camera, seen through the
companion's detector. For a tag with side `s` [px] (root of its area), moved by `b` [px] during the exposure and seen
under the cosine `c` between its normal and the line of sight, with
`f = (1, ln(s/40), ln(s/40)^2, m, m^2, 1/c - 1, ln(S/s))`, `m = 8 b / s` the motion in modules of the tag, `S` the side
of the largest tag in the picture (a detector looks for large ones first):

- missed with probability `1 / (1 + exp(-miss . f))`, and always where a corner is nearer than `border` to the picture's
  edge or the tag smaller than `smallest`;
- corner noise of standard deviation `exp(sigma . f + spread n)` [px] per coordinate, `n` normal, one per tag, of whose
  variance the share `common` is the same for the tag's four corners; a share `outliers` of the tags has it multiplied
  by `outlier_scale`.

Pose flips are not put in: they come out of the noise in whatever solves the pose, as they do from pictures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sitl_stub.world.camera import Content, TagCorners
from sitl_stub.world.documents import FRACTION, NOT_NEGATIVE, Bounds, read_document
from sitl_stub.world.exposure import Exposure, Scene
from sitl_stub.world.lens import Intrinsics
from sitl_stub.world.pads import Face, Pad, corners_of

Array = npt.NDArray[np.float64]

FEATURES = 7
REFERENCE_SIDE = 40.0  # [px]
_MODEL = Path(__file__).with_name("corners.yaml")
_NEAREST = 0.03  # [m] in front of the lens
_MOST_MOTION = 2.5  # [modules] the fit ends there
_WEIGHT = Bounds(low=-100.0, high=100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CornersModel:
    """The fitted numbers; see the module."""

    sigma: tuple[float, ...]  # weights of the features, logarithm of [px]
    sigma_limits: tuple[float, float]  # [px] range of the fit
    spread: float  # standard deviation of the logarithm of the noise between like tags
    miss: tuple[float, ...]  # weights of the features, log-odds
    common: float  # share of the noise variance that a tag's four corners have in common
    outliers: float  # share of tags with noise of `outlier_scale` times the deviation
    outlier_scale: float
    border: float  # [px]
    smallest: float  # [px]

    @classmethod
    def load(cls, path: Path = _MODEL) -> CornersModel:
        """Read the fitted numbers; raises `WorldFileError`."""
        document = read_document(path)
        low, high = document.vector("sigma_limits_px", 2, bounds=NOT_NEGATIVE)
        model = cls(
            sigma=document.vector("sigma", FEATURES, bounds=_WEIGHT),
            sigma_limits=(low, high),
            spread=document.number("spread", bounds=Bounds(low=0.0, high=3.0)),
            miss=document.vector("miss", FEATURES, bounds=_WEIGHT),
            common=document.number("common_share", bounds=FRACTION),
            outliers=document.number("outlier_share", bounds=FRACTION),
            outlier_scale=document.number("outlier_scale", bounds=Bounds(low=1.0)),
            border=document.number("border_px", bounds=NOT_NEGATIVE),
            smallest=document.number("smallest_px", bounds=NOT_NEGATIVE),
        )
        document.finish()
        return model

    def sigmas(self, features: Array) -> Array:
        """Give the middle of the corner noise (n,) [px] of tags with features (n, FEATURES)."""
        return np.asarray(np.clip(np.exp(features @ np.asarray(self.sigma)), *self.sigma_limits))

    def miss_probabilities(self, features: Array) -> Array:
        """Give the probability (n,) that tags with features (n, FEATURES) are not found."""
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(-(features @ np.asarray(self.miss)), -50.0, 50.0))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagView:
    """Where the tags of one board really are in the picture, and how they look."""

    ids: tuple[int, ...]
    corners: Array  # (n, 4, 2) [px] exact, at the middle of the exposure
    side: Array  # (n,) [px] root of the area
    border: Array  # (n,) [px] least distance of a corner from the picture's edge, negative outside
    features: Array  # (n, FEATURES)


class BoardView:
    """Projects the tags of one board."""

    def __init__(self, board: Pad | Face) -> None:
        self._ids = tuple(tag.id for tag in board.tags)
        corners = corners_of(board.tags)
        count = len(self._ids)
        self._corners = np.concatenate([corners.reshape(-1, 2), np.ones((4 * count, 1))], axis=1)
        self._centers = np.concatenate([corners.mean(axis=1), np.ones((count, 1))], axis=1)

    def look(self, intrinsics: Intrinsics, scenes: tuple[Scene, Scene, Scene], index: int) -> TagView | None:
        """Look at board `index` of the scenes at the shutter's opening, middle and closing; None: from behind."""
        opening, middle, closing = scenes
        plane = middle.plane_in_cam(middle.boards[index])
        if not middle.boards[index].is_before(middle.camera_ned):
            return None
        points = self._corners @ plane.T
        ahead = (points[:, 2] > _NEAREST).reshape(-1, 4).all(axis=1)
        if not ahead.any():
            return None
        ids = self._ids if ahead.all() else tuple(self._ids[k] for k in np.flatnonzero(ahead))
        points = points.reshape(-1, 4, 3)[ahead]
        corners = intrinsics.project(points)
        centers = self._centers[ahead]
        ends = [intrinsics.project(centers @ scene.plane_in_cam(scene.boards[index]).T) for scene in (opening, closing)]
        return self._describe(intrinsics, ids, corners, centers @ plane.T, plane, ends[1] - ends[0])

    @staticmethod
    def _describe(
        intrinsics: Intrinsics, ids: tuple[int, ...], corners: Array, sight: Array, plane: Array, moved: Array
    ) -> TagView:
        across, down = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        area = 0.5 * (across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0])
        side = np.sqrt(np.maximum(area, 1e-6))
        normal = np.cross(plane[:, 0], plane[:, 1])
        cosine = (sight @ normal) / np.sqrt((sight * sight).sum(axis=1))
        motion = np.minimum(8.0 * np.hypot(moved[:, 0], moved[:, 1]) / side, _MOST_MOTION)
        low = corners.min(axis=(1, 2))
        right = intrinsics.width - 1 - corners[..., 0].max(axis=1)
        bottom = intrinsics.height - 1 - corners[..., 1].max(axis=1)
        border = np.minimum(low, np.minimum(right, bottom))
        log_side = np.log(side / REFERENCE_SIDE)
        slant = 1.0 / np.maximum(cosine, 0.05) - 1.0
        smaller = np.maximum(np.max(log_side, initial=-10.0, where=border >= 0.0) - log_side, 0.0)
        ones = np.ones_like(side)
        features = np.stack([ones, log_side, log_side**2, motion, motion**2, slant, smaller], axis=1)
        return TagView(
            ids=ids,
            corners=corners,
            side=side,
            border=border,
            features=features,
        )


class CornersImager:
    """Makes the tags of a frame without a picture."""

    def __init__(
        self, intrinsics: Intrinsics, pads: Sequence[Pad], rng: np.random.Generator, model: CornersModel | None = None
    ) -> None:
        self._intrinsics = intrinsics
        self._boards = tuple(BoardView(board) for pad in pads for board in pad.boards)
        self._model = model or CornersModel.load()
        self._rng = rng

    def capture(self, exposure: Exposure, *, bad: bool) -> Content:
        """Give tags and their stated deviations; nothing is found in a spoilt picture."""
        scenes = (exposure.at(exposure.t_open), exposure.at(exposure.t_middle), exposure.at(exposure.t_close))
        tags: list[TagCorners] = []
        sigmas: list[float] = []
        for index, board in enumerate(self._boards):
            view = board.look(self._intrinsics, scenes, index)
            if view is not None:
                self._find(view, tags, sigmas)
        return Content(tags=(), sigmas=()) if bad else Content(tags=tuple(tags), sigmas=tuple(sigmas))

    def _find(self, view: TagView, tags: list[TagCorners], sigmas: list[float]) -> None:
        model, rng, count = self._model, self._rng, len(view.ids)
        dice = rng.random((2, count))
        noise = rng.standard_normal((count, 5, 2))
        spread = np.exp(model.spread * rng.standard_normal(count))
        missed = dice[0] < model.miss_probabilities(view.features)
        missed |= (view.border < model.border) | (view.side < model.smallest)
        middle = model.sigmas(view.features)
        sigma = middle * spread * np.where(dice[1] < model.outliers, model.outlier_scale, 1.0)
        common, own = math.sqrt(model.common), math.sqrt(1.0 - model.common)
        noisy = view.corners + sigma[:, None, None] * (own * noise[:, :4] + common * noise[:, 4:])
        stated = middle * math.exp(model.spread**2)  # the rms over like tags, outliers left out
        for k in np.flatnonzero(~missed):
            tags.append((view.ids[k], noisy[k]))
            sigmas.append(float(stated[k]))
