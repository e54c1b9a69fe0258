"""Corners of a tag from its four edges, to a few hundredths of a pixel.

A tag's side is the border between its black frame and the white paper. Along each side the pixels near the border are
fitted, by Levenberg-Marquardt, with a straight edge that lens and motion have blurred and each pixel has averaged:

    I(d) = b + (w - b) [G(d + 1/2) - G(d - 1/2)],   G(x) = x Phi(x/s) + s phi(x/s)

where d [px] is the pixel's distance outside the edge, s [px] the blur, b and w the black and white levels (each linear
along the side, for uneven light), Phi and phi the normal distribution and density. The pixels are taken as they are,
never interpolated, so their noise is white and the fit's covariance can be believed. A blur that is symmetric across
the edge does not move it. Neighbouring edges meet in the corners. With a calibrated camera the bending of the
side by the lens is taken from the model; without, sides are taken as straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from companion.geometry.arrays import Array, Image
from companion.perception.camera_model import CameraModel

Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]

_HALF = np.float32(0.5)
_INVERSE_SQRT_TAU = np.float32(1.0 / np.sqrt(2.0 * np.pi))
_TAIL = tuple(np.float32(c) for c in (1.330274429, -1.821255978, 1.781477937, -0.356563782, 0.319381530))
_MODULES = 8.0  # a 36h11 tag is 8 cells wide, of which the outer ring is black
_UNKNOWNS = 7  # offset, turn, blur, black, its slope, white, its slope
_SMALLEST_BLUR = 0.2  # [px]
_TYPICAL_BLUR = 0.8  # [px]
_STARTING_BLUR = 1.2  # [px] a wide edge is felt from afar
_QUANTISATION = 1.0 / 12.0  # [grey^2] variance of rounding to whole grey levels
_ASSUMED_NOISE = 25.0  # [grey^2] weighs the pixels against what is known beforehand


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeParameters:
    """Tuning of the edge fit."""

    rows: Annotated[int, Interval(ge=6, le=64)] = 14  # lines of pixels across each side, with up to four tags
    fewest_rows: Annotated[int, Interval(ge=6, le=64)] = 8  # with many tags: together they have enough
    reach: Annotated[float, Interval(ge=1.5, le=8.0)] = 4.5  # [px] furthest pixel from the edge that is used
    # share of the black frame's width that is used: beyond it the fit would see the tag's inner cells
    frame_share: Annotated[float, Interval(gt=0.2, le=1.0)] = 0.55
    corner_margin: Annotated[float, Interval(ge=0.02, le=0.3)] = 0.08  # share of the side left out at each end
    corner_margin_px: Annotated[float, Interval(ge=0.0, le=6.0)] = 1.5  # [px] at least this much
    rounds: Annotated[int, Interval(ge=1, le=5)] = 2  # times the pixels are chosen anew around the improved edge
    iterations: Annotated[int, Interval(ge=1, le=10)] = 6  # Levenberg-Marquardt steps in the last round, at most
    early_iterations: Annotated[int, Interval(ge=1, le=10)] = 3  # ... and in the rounds before it
    converged: Annotated[float, Gt(0.0)] = 0.03  # [px] steps smaller than this end the last round
    nearly: Annotated[float, Gt(0.0)] = 0.3  # [px] ... and the rounds before it
    smallest_contrast: Annotated[float, Gt(0.0)] = 12.0  # [grey levels] white minus black
    smallest_contrast_to_noise: Annotated[float, Gt(0.0)] = 5.0  # white minus black over the residuals' deviation
    largest_shift: Annotated[float, Interval(gt=0.0, le=0.5)] = 0.12  # of the side: a corner that moves more is refused
    largest_shift_px: Annotated[float, Gt(0.0)] = 2.5  # [px] a corner may always move this far
    smallest_side: Annotated[float, Gt(4.0)] = 9.0  # [px] smaller tags are not refined
    sigma_floor: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.02  # [px] what no fit can promise to beat
    # where the blur s reaches across the frame's width f, the inner cells pull the edge: by about sigma_cells s (s/f)^2
    sigma_cells: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.7
    sigma_cells_limit: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.25  # of s, at most


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
    bending = _bending(start[usable], camera)
    fitted = start[usable]
    state = _first_state(len(fitted) * 4)
    for remaining in reversed(range(parameters.rounds)):
        sides = _Sides.of(fitted)
        pixels = _choose_pixels(image, sides, bending, parameters)
        fit = _fit(pixels, state, parameters, early=remaining > 0)
        fitted, variance = _meet(sides, fit)
        state = _next_state(fit)
    good = _good(start[usable], fitted, fit, parameters)
    spread = np.sqrt(variance + parameters.sigma_floor**2 + _pull_of_cells(sides, fit, parameters) ** 2)
    index = np.flatnonzero(usable)
    current[index[good]] = fitted[good]
    sigma[index[good]] = spread[good]
    refined = np.zeros(count, dtype=bool)
    refined[index[good]] = True
    return Refinement(corners=current, sigma=sigma, refined=refined)


@dataclass(slots=True, eq=False)
class _Sides:
    """The S = 4N sides of N quads: side k of a quad runs from corner k to corner k + 1."""

    begin: Array  # (S, 2)
    along: Array  # (S, 2) unit
    outward: Array  # (S, 2) unit, towards the paper
    length: Array  # (S,)
    frame: Array  # (S,) [px] width of the black frame across this side

    @classmethod
    def of(cls, quads: Array) -> _Sides:
        following = np.roll(quads, -1, axis=1)
        step = (following - quads).reshape(-1, 2)
        length = np.sqrt(np.einsum("ij,ij->i", step, step))
        along = step / length[:, None]
        outward = np.stack((along[:, 1], -along[:, 0]), axis=1)
        # how deep the tag is behind this side, at its shallower end
        opposite = np.roll(quads, -2, axis=1)
        before = np.roll(quads, 1, axis=1)
        depth_begin = -np.einsum("ij,ij->i", (before - quads).reshape(-1, 2), outward)
        depth_end = -np.einsum("ij,ij->i", (opposite - following).reshape(-1, 2), outward)
        return cls(
            begin=quads.reshape(-1, 2),
            along=along,
            outward=outward,
            length=length,
            frame=np.minimum(depth_begin, depth_end) / _MODULES,
        )


@dataclass(slots=True, eq=False)
class _Pixels:
    """The pixels beside S sides: R rows across each side, C pixels in each row."""

    grey: Singles  # (S, M) with M = R C
    distance: Singles  # (S, M) [px] outside the present edge
    place: Singles  # (S, M) along the side, -1 at its beginning, 1 at its end
    weight: Singles  # (S, M) 0 or 1
    reach: Array  # (S,) [px]


@dataclass(slots=True, eq=False)
class _Fit:
    state: Array  # (S, 7)
    covariance: Array  # (S, 2, 2) [px^2] of offset and turn
    contrast: Array  # (S,) [grey] white minus black
    noise: Array  # (S,) [grey] standard deviation of the residuals
    valid: Flags  # (S,)


def _usable(quads: Array, parameters: EdgeParameters) -> Flags:
    finite: Flags = np.asarray(np.isfinite(quads).all(axis=(1, 2)))
    step = np.where(finite[:, None, None], np.roll(quads, -1, axis=1) - quads, 0.0)
    after = np.roll(step, -1, axis=1)
    turning = step[:, :, 0] * after[:, :, 1] - step[:, :, 1] * after[:, :, 0]
    shortest = np.sqrt((step * step).sum(axis=2)).min(axis=1)
    result: Flags = finite & (turning > 0.0).all(axis=1) & (shortest >= parameters.smallest_side)
    return result


def _bending(quads: Array, camera: CameraModel | None) -> Array | None:
    """Give how far [px] the lens bends each side outward from its chord at 1/4, 1/2 and 3/4: (S, 3)."""
    if camera is None or camera.distortion.size == 0 or not bool(camera.distortion.any()):
        return None
    rays = camera.undistort(quads.reshape(-1, 2)).reshape(-1, 4, 2)
    following = np.roll(rays, -1, axis=1)
    fraction = np.array([0.25, 0.5, 0.75])[:, None]
    inner = rays[:, :, None, :] + fraction * (following - rays)[:, :, None, :]
    seen = camera.distort(inner.reshape(-1, 2)).reshape(-1, 3, 2)
    sides = _Sides.of(quads)
    offset = np.einsum("sij,sj->si", seen - sides.begin[:, None, :], sides.outward)
    result: Array = np.nan_to_num(offset)
    return result


def _choose_pixels(image: Image, sides: _Sides, bending: Array | None, parameters: EdgeParameters) -> _Pixels:
    """Take whole rows or columns of pixels across each side, whichever cross it more squarely."""
    height, width = image.shape
    reach = np.clip(parameters.frame_share * sides.frame, 1.5, parameters.reach)
    flat = np.abs(sides.along[:, 0]) >= np.abs(sides.along[:, 1])  # the side runs along x: take columns
    main = np.where(flat, 0, 1)
    every = np.arange(len(main))
    speed = sides.along[every, main]  # change of the running coordinate per px along the side
    margin = np.maximum(parameters.corner_margin * sides.length, parameters.corner_margin_px)
    margin = np.minimum(margin, 0.25 * sides.length)
    crowded = round(parameters.rows * 4.0 / math.sqrt(len(main)))  # four sides a tag
    fraction = np.linspace(0.0, 1.0, min(parameters.rows, max(parameters.fewest_rows, crowded)))
    wanted = margin[:, None] + fraction * (sides.length - 2.0 * margin)[:, None]  # (S, R) [px] along the side
    running = np.rint(sides.begin[every, main][:, None] + wanted * speed[:, None])
    repeated = np.zeros(running.shape, dtype=bool)
    repeated[:, 1:] = running[:, 1:] == running[:, :-1]
    slope = sides.along[every, 1 - main] / speed
    crossing = sides.begin[every, 1 - main][:, None] + (running - sides.begin[every, main][:, None]) * slope[:, None]
    half = math.ceil(float((reach / np.abs(speed)).max()))
    across = np.rint(crossing)[:, :, None] + np.arange(-half, half + 1)
    running = np.broadcast_to(running[:, :, None], across.shape)
    columns = np.where(flat[:, None, None], running, across).astype(np.intp)
    rows = np.where(flat[:, None, None], across, running).astype(np.intp)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height) & ~repeated[:, :, None]
    grey = image[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    relative_x = columns - sides.begin[:, 0][:, None, None]
    relative_y = rows - sides.begin[:, 1][:, None, None]
    normal, direction = sides.outward[:, None, None, :], sides.along[:, None, None, :]
    distance = relative_x * normal[..., 0] + relative_y * normal[..., 1]
    place = (relative_x * direction[..., 0] + relative_y * direction[..., 1]) * (2.0 / sides.length)[
        :, None, None
    ] - 1.0
    if bending is not None:
        distance = distance - _bent(bending, place)
    weight = inside & (np.abs(distance) <= reach[:, None, None])
    shape = (len(main), -1)
    return _Pixels(
        grey=grey.reshape(shape).astype(np.float32),
        distance=distance.reshape(shape).astype(np.float32),
        place=place.reshape(shape).astype(np.float32),
        weight=weight.reshape(shape).astype(np.float32),
        reach=reach,
    )


def _bent(bending: Array, place: Array) -> Array:
    """Interpolate the bending by the quartic that is zero at both ends."""
    f = 0.5 * (place + 1.0)
    hump = f * (1.0 - f)
    first, middle, last = (bending[:, k][:, None, None] for k in range(3))
    # Lagrange through 1/4, 1/2, 3/4 of bending / hump
    u, v, w = first * (16.0 / 3.0), middle * 4.0, last * (16.0 / 3.0)
    result: Array = hump * (
        u * (f - 0.5) * (f - 0.75) * 8.0 - v * (f - 0.25) * (f - 0.75) * 16.0 + w * (f - 0.25) * (f - 0.5) * 8.0
    )
    return result


def _first_state(sides: int) -> Array:
    state = np.zeros((sides, _UNKNOWNS))
    state[:, 2] = _STARTING_BLUR
    state[:, 3] = np.nan  # levels: taken from the pixels
    return state


def _next_state(fit: _Fit) -> Array:
    state = fit.state.copy()
    state[:, 0:2] = 0.0
    state[~fit.valid] = _first_state(1)
    return state


def _with_levels(pixels: _Pixels, state: Array) -> Array:
    """Start the black and white levels from the pixels well inside and well outside."""
    if not bool(np.isnan(state[:, 3]).any()):
        return state
    limit = 0.4 * pixels.reach[:, None]
    outside = pixels.weight * (pixels.distance > limit)
    inside = pixels.weight * (pixels.distance < -limit)
    white = (outside * pixels.grey).sum(axis=1) / np.maximum(outside.sum(axis=1), 1.0)
    black = (inside * pixels.grey).sum(axis=1) / np.maximum(inside.sum(axis=1), 1.0)
    missing = np.isnan(state[:, 3])
    state = state.copy()
    state[missing, 3] = black[missing]
    state[missing, 5] = white[missing]
    return state


def _fit(pixels: _Pixels, state: Array, parameters: EdgeParameters, *, early: bool) -> _Fit:
    """Fit S blurred edges at once, by Levenberg-Marquardt; each side accepts or refuses its own steps."""
    state = _with_levels(pixels, state)
    prior = _prior_precision(state)
    centre = _prior_centre(state)
    damping = np.full(len(state), 1e-3)
    normal, gradient, cost, squares = _normal_equations(pixels, state, prior, centre)
    converged = parameters.nearly if early else parameters.converged
    for _ in range(parameters.early_iterations if early else parameters.iterations):
        diagonal = np.einsum("ijj->ij", normal)
        damped = normal + np.eye(_UNKNOWNS) * (diagonal * damping[:, None])[:, None, :]
        trial = state + np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
        before = state[:, :2]
        np.clip(trial[:, 2], _SMALLEST_BLUR, pixels.reach, out=trial[:, 2])
        trial_equations = _normal_equations(pixels, trial, prior, centre)
        better = trial_equations[2] < cost
        damping = np.where(better, 0.2 * damping, 20.0 * np.maximum(damping, 1e-2))
        state = np.where(better[:, None], trial, state)
        normal = np.where(better[:, None, None], trial_equations[0], normal)
        gradient = np.where(better[:, None], trial_equations[1], gradient)
        cost = np.where(better, trial_equations[2], cost)
        squares = np.where(better, trial_equations[3], squares)
        if float(np.abs(trial[:, :2] - before).max()) < converged:
            break
    freedom = pixels.weight.sum(axis=1) - _UNKNOWNS
    variance = squares / np.maximum(freedom, 1.0) + _QUANTISATION
    covariance = np.linalg.inv(normal)[:, 0:2, 0:2] * (variance / _ASSUMED_NOISE)[:, None, None]
    contrast = state[:, 5] - state[:, 3]
    noise = np.sqrt(variance)
    valid = (
        np.isfinite(state).all(axis=1)
        & (freedom >= _UNKNOWNS)
        & (contrast >= parameters.smallest_contrast)
        & (contrast >= parameters.smallest_contrast_to_noise * noise)
    )
    return _Fit(state=state, covariance=covariance, contrast=contrast, noise=noise, valid=valid)


def _prior_precision(state: Array) -> Array:
    """Give what is known of the unknowns beforehand (S, 7): weak, it only holds what the pixels do not show."""
    contrast = np.maximum(np.abs(state[:, 5] - state[:, 3]), 10.0)
    spread = np.empty((len(state), _UNKNOWNS))
    spread[:, 0] = spread[:, 1] = 2.0  # [px]
    spread[:, 2] = 0.8  # [px]
    spread[:, 3] = spread[:, 5] = contrast
    spread[:, 4] = spread[:, 6] = 0.15 * contrast
    return 1.0 / (spread * spread)


def _prior_centre(state: Array) -> Array:
    centre = np.zeros_like(state)
    centre[:, 2] = _TYPICAL_BLUR
    centre[:, (3, 5)] = state[:, (3, 5)]
    return centre


def _normal_equations(pixels: _Pixels, state: Array, prior: Array, centre: Array) -> tuple[Array, Array, Array, Array]:
    """Give the normal matrix (S, 7, 7), the gradient (S, 7), the cost (S,) and the squared residuals (S,) [grey^2]."""
    residual, jacobian = _edge_model(pixels, state)
    normal = np.matmul(jacobian, jacobian.transpose(0, 2, 1)).astype(np.float64) / _ASSUMED_NOISE
    gradient = np.matmul(jacobian, residual[:, :, None])[:, :, 0].astype(np.float64) / _ASSUMED_NOISE
    squares = np.einsum("ij,ij->i", residual, residual).astype(np.float64)
    away = centre - state
    index = np.arange(_UNKNOWNS)
    normal[:, index, index] += prior
    return normal, gradient + prior * away, squares / _ASSUMED_NOISE + (prior * away * away).sum(axis=1), squares


def _edge_model(pixels: _Pixels, state: Array) -> tuple[Singles, Singles]:
    """Give the residuals (S, M) and the derivatives (S, 7, M) of the modelled grey by the unknowns."""
    single = state.astype(np.float32)
    offset, turn, blur, black, black_slope, white, white_slope = (single[:, k, None] for k in range(_UNKNOWNS))
    place, weight = pixels.place, pixels.weight
    ends = np.empty((2, *place.shape), dtype=np.float32)  # where the pixel begins and ends, in blurs from the edge
    from_edge = pixels.distance - turn * place
    from_edge -= offset
    np.subtract(from_edge, _HALF, out=ends[0])
    np.add(from_edge, _HALF, out=ends[1])
    ends /= blur
    density, below = _normal(ends)
    share = blur * (ends[1] * below[1] - ends[0] * below[0] + density[1] - density[0])
    jacobian = np.empty((state.shape[0], _UNKNOWNS, place.shape[1]), dtype=np.float32)
    contrast = (white_slope - black_slope) * place
    contrast += white - black
    model = black_slope * place
    model += black
    model += contrast * share
    residual = (pixels.grey - model) * weight
    contrast *= weight
    np.multiply(contrast, below[0] - below[1], out=jacobian[:, 0])
    np.multiply(jacobian[:, 0], place, out=jacobian[:, 1])
    np.multiply(contrast, density[1] - density[0], out=jacobian[:, 2])
    np.multiply(weight, share, out=jacobian[:, 5])
    np.subtract(weight, jacobian[:, 5], out=jacobian[:, 3])
    np.multiply(jacobian[:, 3], place, out=jacobian[:, 4])
    np.multiply(jacobian[:, 5], place, out=jacobian[:, 6])
    return residual, jacobian


def _normal(x: Singles) -> tuple[Singles, Singles]:
    """Give the normal density and distribution at `x` (Abramowitz and Stegun, 26.2.17: error below 1e-7)."""
    density = x * x
    density *= np.float32(-0.5)
    np.exp(density, out=density)
    density *= _INVERSE_SQRT_TAU
    t = np.abs(x)
    t *= np.float32(0.2316419)
    t += np.float32(1.0)
    np.divide(np.float32(1.0), t, out=t)
    tail = t * _TAIL[0]
    for coefficient in _TAIL[1:]:
        tail += coefficient
        tail *= t
    tail *= density
    return density, np.where(x > 0.0, np.float32(1.0) - tail, tail)


def _meet(sides: _Sides, fit: _Fit) -> tuple[Array, Array]:
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


def _pull_of_cells(sides: _Sides, fit: _Fit, parameters: EdgeParameters) -> Array:
    """Give the error [px] (N,) that the tag's inner cells cause, measured on rendered tags."""
    blur = fit.state[:, 2]
    share = blur / np.maximum(sides.frame, 1e-6)
    pull = blur * np.minimum(parameters.sigma_cells * share * share, parameters.sigma_cells_limit)
    result: Array = np.sqrt((pull * pull).reshape(-1, 4).mean(axis=1))
    return result


def _good(start: Array, fitted: Array, fit: _Fit, parameters: EdgeParameters) -> Flags:
    sides_valid = fit.valid.reshape(-1, 4).all(axis=1)
    shift = np.sqrt(((fitted - start) ** 2).sum(axis=2)).max(axis=1)
    step = np.roll(start, -1, axis=1) - start
    side = np.sqrt((step * step).sum(axis=2)).min(axis=1)
    allowed = np.maximum(parameters.largest_shift_px, parameters.largest_shift * side)
    result: Any = sides_valid & np.isfinite(fitted).all(axis=(1, 2)) & (shift <= allowed)
    return np.asarray(result, dtype=bool)
