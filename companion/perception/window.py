"""Where in the next picture the pad should be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from companion.geometry.arrays import Array
from companion.geometry.transform import RigidTransform
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad

_NEAREST = 0.02  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowParameters:
    """Tuning of the predicted window."""

    margin: Annotated[float, Ge(0.0)] = 0.2  # added on each side, as a share of the pad's size in the picture
    margin_px: Annotated[float, Ge(0.0)] = 16.0  # [px] added on each side, at least
    position_sigma: Annotated[float, Ge(0.0)] = 0.05  # [m] of the prediction, where the caller does not say
    sigmas: Annotated[float, Gt(0.0)] = 3.0  # how many of them are added on each side
    smallest: Annotated[int, Gt(8)] = 80  # [px] least width and height
    readable_side: Annotated[float, Gt(4.0)] = 11.0  # [px] tags that should appear smaller are not looked for
    # tags are looked for in a picture made smaller until the fourth largest has this side
    comfortable_side: Annotated[float, Gt(10.0)] = 32.0  # [px]
    largest_reduction: Annotated[int, Interval(ge=1, le=4)] = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A rectangle of the picture, and how large the tags in it should appear."""

    left: int  # [px] first column
    top: int  # [px] first row
    right: int  # [px] column after the last
    bottom: int  # [px] row after the last
    smallest_side: float  # [px] of the smallest tag that should be readable
    reduction: int  # whole factor by which the picture may be made smaller for the search


def predict_window(
    pad: Pad,
    camera: CameraModel,
    cam_from_pad: RigidTransform,
    parameters: WindowParameters,
    *,
    position_sigma: float | None = None,
) -> Window | None:
    """Predict where the pad's tags appear.

    Args:
        pad: the pad.
        camera: the camera.
        cam_from_pad: predicted pose.
        parameters: tuning.
        position_sigma: standard deviation [m] of the predicted position; None takes the parameters'.

    Returns:
        The window, clipped to the picture; None where all tags should be out of sight, or the prediction is not finite.
    """
    quads = cam_from_pad.apply(pad.all_corners.reshape(-1, 3)).reshape(-1, 4, 3)
    if not bool(np.isfinite(quads).all()):
        return None
    quads = quads[(quads[..., 2] > _NEAREST).all(axis=1)]  # tags beside or behind the camera are not seen
    limits = np.array([camera.width, camera.height])
    sigma = parameters.position_sigma if position_sigma is None else position_sigma
    spread = parameters.sigmas * sigma * camera.focal_length / quads[..., 2:]
    rays = (quads[..., :2] / quads[..., 2:]).reshape(-1, 2)
    seen = camera.distort(_within(rays, camera.largest_radius)).reshape(-1, 4, 2)
    lows, highs = (seen - spread).min(axis=1), (seen + spread).max(axis=1)
    near = ((highs + parameters.margin_px >= 0.0) & (lows - parameters.margin_px <= limits)).all(axis=1)
    if not near.any():
        return None
    seen, lows, highs = seen[near], lows[near], highs[near]
    size = min(float(np.ptp(seen.reshape(-1, 2), axis=0).max()), float(limits.max()))
    margin = max(parameters.margin * size, parameters.margin_px)
    low, high = lows.min(axis=0) - margin, highs.max(axis=0) + margin
    grow = np.maximum(0.5 * (parameters.smallest - (high - low)), 0.0)
    low, high = low - grow, high + grow
    left, top = np.clip(np.floor(low), 0, limits).astype(int).tolist()
    right, bottom = np.clip(np.ceil(high) + 1.0, 0, limits).astype(int).tolist()
    if right - left < parameters.readable_side or bottom - top < parameters.readable_side:
        return None
    smallest_side, reduction = _expected_sides(seen, limits, parameters)
    return Window(left=left, top=top, right=right, bottom=bottom, smallest_side=smallest_side, reduction=reduction)


def _within(normalised: Array, largest_radius: float) -> Array:
    """Pull rays beyond the camera model's reach back to its rim."""
    radius = np.hypot(normalised[:, 0], normalised[:, 1])
    limit = min(largest_radius, 6.0)
    return normalised * np.minimum(1.0, limit / np.maximum(radius, 1e-9))[:, None]


def _expected_sides(quads: Array, limits: Array, parameters: WindowParameters) -> tuple[float, int]:
    """Give the least side to look for and the reduction, from the tags that should lie in the picture."""
    step = np.roll(quads, -1, axis=1) - quads
    sides = np.sqrt((step * step).sum(axis=2)).min(axis=1)
    inside = ((quads >= 0.0) & (quads <= limits - 1.0)).all(axis=(1, 2))
    visible = np.sort(sides[inside & (sides >= parameters.readable_side)])[::-1]
    if visible.size == 0:
        return parameters.readable_side, 1
    reference = float(visible[min(3, visible.size - 1)])
    reduction = int(min(max(reference // parameters.comfortable_side, 1), parameters.largest_reduction))
    wanted = visible[visible >= parameters.readable_side * reduction]
    smallest = float(wanted[-1]) if wanted.size else float(visible[0])
    return 0.6 * smallest, reduction
