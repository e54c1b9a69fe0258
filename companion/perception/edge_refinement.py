"""Corners of a tag from its four edges, to a few hundredths of a pixel.

A tag's side is the border between its black frame and the white paper. Along each side the pixels near the border are
chosen (`edge_pixels`) and fitted with a blurred edge (`edge_fit`); neighbouring edges meet in the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.geometry.arrays import Array, Image
from companion.perception.camera_model import CameraModel
from companion.perception.edge_fit import EdgeFit, Flags, first_state, fit_edges, next_state
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.edge_pixels import Sides, bending_of, choose_pixels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refinement:
    """The refined corners of N tags."""

    corners: Array  # (N, 4, 2) [px]; the given ones where `refined` is false
    sigma: Array  # (N,) [px] standard deviation of a corner coordinate; NaN where `refined` is false
    refined: Flags  # (N,)


def refine_corners(
    image: Image, corners: Array, *, camera: CameraModel | None, parameters: EdgeParameters
) -> Refinement:
    """Refine the corners of all tags of one picture at once.

    Args:
        image: (height, width) grey.
        corners: (N, 4, 2) [px], clockwise in the picture, each within about 2 px of the truth.
        camera: bends the sides as the lens does; None takes them as straight.
        parameters: tuning.
    """
    count = len(corners)
    if count == 0:
        return Refinement(corners=np.zeros((0, 4, 2)), sigma=np.zeros(0), refined=np.zeros(0, dtype=bool))
    start = np.array(corners, dtype=np.float64)
    usable = _usable(start, parameters)
    current = start.copy()
    sigma = np.full(count, np.nan)
    if not bool(usable.any()):
        return Refinement(corners=current, sigma=sigma, refined=usable)
    bending = bending_of(start[usable], camera)
    fitted = start[usable]
    state = first_state(len(fitted) * 4)
    for remaining in reversed(range(parameters.rounds)):
        sides = Sides.of(fitted)
        pixels = choose_pixels(image, sides, bending, parameters)
        fit = fit_edges(pixels, state, parameters, early=remaining > 0)
        fitted, variance = _meet(sides, fit)
        state = next_state(fit)
    good = _good(start[usable], fitted, fit, parameters)
    spread = np.sqrt(variance + parameters.sigma_floor**2 + _pull_of_cells(sides, fit, parameters) ** 2)
    index = np.flatnonzero(usable)
    current[index[good]] = fitted[good]
    sigma[index[good]] = spread[good]
    refined = np.zeros(count, dtype=bool)
    refined[index[good]] = True
    return Refinement(corners=current, sigma=sigma, refined=refined)


def _usable(quads: Array, parameters: EdgeParameters) -> Flags:
    finite: Flags = np.asarray(np.isfinite(quads).all(axis=(1, 2)))
    step = np.where(finite[:, None, None], np.roll(quads, -1, axis=1) - quads, 0.0)
    after = np.roll(step, -1, axis=1)
    turning = step[:, :, 0] * after[:, :, 1] - step[:, :, 1] * after[:, :, 0]
    shortest = np.sqrt((step * step).sum(axis=2)).min(axis=1)
    result: Flags = finite & (turning > 0.0).all(axis=1) & (shortest >= parameters.smallest_side)
    return result


def _meet(sides: Sides, fit: EdgeFit) -> tuple[Array, Array]:
    """Intersect neighbouring edges: corners (N, 4, 2) and the mean variance (N,) [px^2] of their coordinates."""
    offset, turn = fit.state[:, 0], fit.state[:, 1]
    first = sides.begin + sides.outward * (offset - turn)[:, None]
    last = sides.begin + sides.along * sides.length[:, None] + sides.outward * (offset + turn)[:, None]
    step = last - first
    normal = np.stack((step[:, 1], -step[:, 0]), axis=1) / np.sqrt((step * step).sum(axis=1))[:, None]
    level = (normal * first).sum(axis=1)
    # corner k is where side k - 1 ends and side k begins
    before = np.roll(np.arange(len(level)).reshape(-1, 4), 1, axis=1).ravel()
    a, b = normal[before], normal
    determinant = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    determinant = np.where(np.abs(determinant) > 1e-3, determinant, np.nan)
    x = (level[before] * b[:, 1] - level * a[:, 1]) / determinant
    y = (level * a[:, 0] - level[before] * b[:, 0]) / determinant
    at_begin = fit.covariance[:, 0, 0] - 2.0 * fit.covariance[:, 0, 1] + fit.covariance[:, 1, 1]
    at_end = fit.covariance[:, 0, 0] + 2.0 * fit.covariance[:, 0, 1] + fit.covariance[:, 1, 1]
    spread = 0.5 * (at_begin + at_end[before]) / (determinant * determinant)
    return np.stack((x, y), axis=1).reshape(-1, 4, 2), spread.reshape(-1, 4).mean(axis=1)


def _pull_of_cells(sides: Sides, fit: EdgeFit, parameters: EdgeParameters) -> Array:
    """Give the error [px] (N,) that the tag's inner cells cause, measured on rendered tags."""
    blur = fit.state[:, 2]
    share = blur / np.maximum(sides.frame, 1e-6)
    pull = blur * np.minimum(parameters.sigma_cells * share * share, parameters.sigma_cells_limit)
    result: Array = np.sqrt((pull * pull).reshape(-1, 4).mean(axis=1))
    return result


def _good(start: Array, fitted: Array, fit: EdgeFit, parameters: EdgeParameters) -> Flags:
    sides_valid = fit.valid.reshape(-1, 4).all(axis=1)
    shift = np.sqrt(((fitted - start) ** 2).sum(axis=2)).max(axis=1)
    step = np.roll(start, -1, axis=1) - start
    side = np.sqrt((step * step).sum(axis=2)).min(axis=1)
    allowed = np.maximum(parameters.largest_shift_px, parameters.largest_shift * side)
    result: Any = sides_valid & np.isfinite(fitted).all(axis=(1, 2)) & (shift <= allowed)
    return np.asarray(result, dtype=bool)
