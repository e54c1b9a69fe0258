"""Blurred straight edges, fitted to the pixels beside the sides of tags.

A side is fitted, by Levenberg-Marquardt, with a straight edge that lens and motion have blurred and each pixel has
averaged:

    I(d) = b + (w - b) [G(d + 1/2) - G(d - 1/2)],   G(x) = x Phi(x/s) + s phi(x/s)

where d [px] is the pixel's distance outside the edge, s [px] the blur, b and w the black and white levels (each linear
along the side, for uneven light), Phi and phi the normal distribution and density. A blur that is symmetric across the
edge does not move it. The noise of the pixels is white, so the fit's covariance can be believed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.edge_pixels import SidePixels, Singles

Flags = NDArray[np.bool_]

_HALF = np.float32(0.5)
_INVERSE_SQRT_TAU = np.float32(1.0 / np.sqrt(2.0 * np.pi))
_TAIL = tuple(np.float32(c) for c in (1.330274429, -1.821255978, 1.781477937, -0.356563782, 0.319381530))
_UNKNOWNS = 7  # offset, turn, blur, black, its slope, white, its slope
_SMALLEST_BLUR = 0.2  # [px]
_TYPICAL_BLUR = 0.8  # [px]
_STARTING_BLUR = 1.2  # [px] a wide edge is felt from afar
_QUANTISATION = 1.0 / 12.0  # [grey^2] variance of rounding to whole grey levels
_ASSUMED_NOISE = 25.0  # [grey^2] weighs the pixels against what is known beforehand


@dataclass(slots=True, eq=False)
class EdgeFit:
    """The fitted edges of S sides."""

    state: Array  # (S, 7): offset [px], turn [px], blur [px], black, its slope, white, its slope [grey]
    covariance: Array  # (S, 2, 2) [px^2] of offset and turn
    contrast: Array  # (S,) [grey] white minus black
    noise: Array  # (S,) [grey] standard deviation of the residuals
    valid: Flags  # (S,)


def first_state(sides: int) -> Array:
    """Give where the fit of so many sides begins (S, 7)."""
    state = np.zeros((sides, _UNKNOWNS))
    state[:, 2] = _STARTING_BLUR
    state[:, 3] = np.nan  # levels: taken from the pixels
    return state


def next_state(fit: EdgeFit) -> Array:
    """Give where to begin (S, 7) around the edges that a fit has found; afresh where it is not valid."""
    state = fit.state.copy()
    state[:, 0:2] = 0.0
    state[~fit.valid] = first_state(1)
    return state


def _with_levels(pixels: SidePixels, state: Array) -> Array:
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


def fit_edges(pixels: SidePixels, state: Array, parameters: EdgeParameters, *, early: bool) -> EdgeFit:
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
    return EdgeFit(state=state, covariance=covariance, contrast=contrast, noise=noise, valid=valid)


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


def _normal_equations(
    pixels: SidePixels, state: Array, prior: Array, centre: Array
) -> tuple[Array, Array, Array, Array]:
    """Give the normal matrix (S, 7, 7), the gradient (S, 7), the cost (S,) and the squared residuals (S,) [grey^2]."""
    residual, jacobian = _edge_model(pixels, state)
    normal = np.matmul(jacobian, jacobian.transpose(0, 2, 1)).astype(np.float64) / _ASSUMED_NOISE
    gradient = np.matmul(jacobian, residual[:, :, None])[:, :, 0].astype(np.float64) / _ASSUMED_NOISE
    squares = np.einsum("ij,ij->i", residual, residual).astype(np.float64)
    away = centre - state
    index = np.arange(_UNKNOWNS)
    normal[:, index, index] += prior
    return normal, gradient + prior * away, squares / _ASSUMED_NOISE + (prior * away * away).sum(axis=1), squares


def _edge_model(pixels: SidePixels, state: Array) -> tuple[Singles, Singles]:
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
