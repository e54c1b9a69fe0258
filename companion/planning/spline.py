"""Polynomials that minimise the integral of a squared derivative, over normalised time.

A polynomial of degree 2r - 1 minimises the integral of its squared r-th derivative between two ends at which its
first r derivatives (the 0th is the value) are given: r = 4 is minimum snap, r = 2 minimum acceleration (Mellinger &
Kumar, ICRA 2011). Here s = (t - t0) / T runs from 0 to 1 over a piece of duration T [s], and a k-th derivative in
time times T^k is the k-th derivative in s.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from companion.geometry.arrays import Array, frozen

SNAP = 4  # order of minimum snap
ACCELERATION = 2  # order of minimum acceleration


def derivative_row(s: float, degree: int, derivative: int) -> Array:
    """Give the row that takes the coefficients (degree + 1,) to the derivative at `s`."""
    row = np.zeros(degree + 1)
    for power in range(derivative, degree + 1):
        row[power] = math.perm(power, derivative) * s ** (power - derivative)
    return row


@lru_cache(maxsize=8)
def coefficients_from_ends(order: int, free_start: bool = False) -> Array:
    """Give the matrix (2r, 2r) from the derivatives at both ends (start's 0..r-1, then end's) to the coefficients.

    Args:
        order: r.
        free_start: leave the start's highest derivative free; its column is then zero, and the natural boundary
            condition, r-th derivative zero at the start, takes its place.
    """
    degree = 2 * order - 1
    rows = [derivative_row(s, degree, k) for s in (0.0, 1.0) for k in range(order)]
    if free_start:
        rows[order - 1] = derivative_row(0.0, degree, order)
    inverse: Array = np.linalg.inv(np.array(rows))
    if free_start:
        inverse[:, order - 1] = 0.0
    return frozen(inverse)


@lru_cache(maxsize=8)
def cost_from_ends(order: int) -> Array:
    """Give the quadratic form (2r, 2r) of the cost: integral over s of the squared r-th derivative, by the ends."""
    degree = 2 * order - 1
    cost = np.zeros((degree + 1, degree + 1))
    for i in range(order, degree + 1):
        for j in range(order, degree + 1):
            cost[i, j] = math.perm(i, order) * math.perm(j, order) / (i + j - 2 * order + 1)
    basis = coefficients_from_ends(order)
    return frozen(basis.T @ cost @ basis)


def time_powers(duration: float, order: int) -> Array:
    """Give (2r,): T^k for k in 0..r-1, twice: derivatives in time to derivatives in s, at both ends."""
    powers = duration ** np.arange(order)
    return np.concatenate([powers, powers])


def optimal_derivatives(order: int, durations: tuple[float, ...], derivatives: Array, fixed: Array) -> Array:
    """Fill in the free derivatives at the knots so that the whole cost is least, in closed form.

    The cost is d^T R d over all knots' derivatives d; with d split into fixed (F) and free (P), the optimum is
    d_P = -R_PP^-1 R_PF d_F (Richter, Bry & Roy, ISRR 2013).

    Args:
        order: r.
        durations: K pieces [s].
        derivatives: (K + 1, r, axes) derivatives in time at the knots; the free ones are ignored.
        fixed: (K + 1, r) whether each is given.

    Returns:
        (K + 1, r, axes) with the free ones filled in.
    """
    knots, _, axes = derivatives.shape
    size = knots * order
    cost = np.zeros((size, size))
    for piece, duration in enumerate(durations):
        scale = time_powers(duration, order)
        block = cost_from_ends(order) * np.outer(scale, scale) / duration ** (2 * order - 1)
        span = slice(piece * order, (piece + 2) * order)
        cost[span, span] += block
    values = derivatives.reshape(size, axes).copy()
    given = fixed.reshape(size)
    free = ~given
    if np.any(free):
        values[free] = -np.linalg.solve(cost[np.ix_(free, free)], cost[np.ix_(free, given)] @ values[given])
    return values.reshape(knots, order, axes)


def piece_coefficients(order: int, durations: tuple[float, ...], derivatives: Array) -> Array:
    """Give the coefficients (K, 2r, axes) over s of the pieces between knots with the derivatives (K + 1, r, axes)."""
    basis = coefficients_from_ends(order)
    pieces = [
        basis @ (np.concatenate([derivatives[k], derivatives[k + 1]]) * time_powers(duration, order)[:, None])
        for k, duration in enumerate(durations)
    ]
    return np.array(pieces)
