"""Confidence intervals: of a mean by the bootstrap, of a rate by Wilson."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

RESAMPLES = 10_000
_Z = 1.959963984540054  # of the normal distribution, 95 % two-sided


def mean_interval(values: Sequence[float], rng: np.random.Generator) -> tuple[float, float] | None:
    """Give the 95 % percentile-bootstrap interval of the mean (Efron and Tibshirani, 1993, section 13.3).

    Args:
        values: one for each independent trial.
        rng: for the resampling.

    Returns:
        Its ends; None below two values, which tell nothing of the spread.
    """
    if len(values) < 2:
        return None
    sample = np.asarray(values, dtype=float)
    means = sample[rng.integers(0, len(sample), size=(RESAMPLES, len(sample)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)


def rate_interval(successes: int, trials: int) -> tuple[float, float] | None:
    """Give Wilson's 95 % interval of a rate (Wilson, 1927); None without trials.

    (p + z²/2n ± z sqrt(p (1 - p) / n + z²/4n²)) / (1 + z²/n)
    """
    if trials == 0:
        return None
    rate, share = successes / trials, _Z * _Z / trials
    half = _Z * math.sqrt(rate * (1.0 - rate) / trials + share / (4.0 * trials))
    middle, scale = rate + 0.5 * share, 1.0 + share
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)
