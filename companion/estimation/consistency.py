"""Does an estimator's covariance tell the truth? NEES, NIS, chi-square bounds and whiteness.

Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", section 5.4.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import gammaincinv

from companion.geometry.arrays import Array


def chi_square_quantile(probability: float, degrees: float) -> float:
    """Give the value that a chi-square variable of `degrees` degrees of freedom stays below with `probability`."""
    return 2.0 * float(gammaincinv(0.5 * degrees, probability))


def normalised_squared(error: Array, covariance: Array) -> float:
    """Give `e^T P^-1 e`: the NEES of an estimation error, the NIS of an innovation.

    Args:
        error: (n,).
        covariance: (n, n), positive definite.
    """
    return float(error @ np.linalg.solve(covariance, error))


def average_bounds(degrees: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Give the two-sided bounds of a NEES (or NIS) of `degrees` averaged over `runs` independent runs."""
    tail = 0.5 * (1.0 - confidence)
    total = degrees * runs
    return chi_square_quantile(tail, total) / runs, chi_square_quantile(1.0 - tail, total) / runs


def fraction_inside(nees: Array, degrees: int, confidence: float = 0.95) -> float:
    """Give the share of epochs at which the NEES averaged over the runs lies inside its bounds.

    Args:
        nees: (runs, epochs); NaN where a run has no estimate: the bounds follow the number of runs at each epoch.
        degrees: of freedom of one NEES.
        confidence: of the two-sided bounds.
    """
    inside = 0
    counted = 0
    for column in nees.T:
        values = column[np.isfinite(column)]
        if values.size:
            low, high = average_bounds(degrees, int(values.size), confidence)
            counted += 1
            inside += low <= float(values.mean()) <= high
    return inside / counted if counted else math.nan


def autocorrelation(innovations: Array, lag: int = 1) -> float:
    """Give the normalised autocorrelation of a sequence of innovations at a lag: about 0 for a consistent filter.

    Args:
        innovations: (epochs,) or (epochs, n).
        lag: in epochs.
    """
    sequence = innovations.reshape(len(innovations), -1)
    early, late = sequence[:-lag], sequence[lag:]
    norm = math.sqrt(float((early * early).sum()) * float((late * late).sum()))
    return float((early * late).sum()) / norm if norm > 0.0 else 0.0


def whiteness_bound(epochs: int, degrees: int = 1, confidence: float = 0.95) -> float:
    """Give the two-sided bound of `autocorrelation` of a white sequence of `epochs` vectors of `degrees` entries."""
    return math.sqrt(chi_square_quantile(confidence, 1.0) / (epochs * degrees))
