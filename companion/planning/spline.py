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
