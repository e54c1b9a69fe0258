"""The heading of a target that winds about regularly, as a sum of sines.

    psi(t) = c + sum_h a_h cos(h w t) + b_h sin(h w t),    h = 1 .. harmonics

by Bayesian linear regression for each w of a grid, with forgetting. The marginal likelihoods weigh the grid, so it
begins to know before a period is over, and a heading that does not wind gives sines of no size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array
from companion.prediction.parameters import WindingParameters

_NEGLIGIBLE = 0.01  # share of the weight below which a period is left out of a forecast


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadingCourse:
    """Headings expected at instants a constant step apart; only their differences mean something."""

    t_start: float  # [s]
    step: float  # [s]
    headings: Array  # (N,) [rad], not wrapped

    def change(self, earlier: float, later: Array) -> Array:
        """Give the change of heading (M,) [rad] from one instant [s] to others (M,)."""
        times = self.t_start + self.step * np.arange(len(self.headings))
        result: Array = np.interp(later, times, self.headings) - float(np.interp(earlier, times, self.headings))
        return result


class WindingRegression:
    """Takes headings and tells how they go on, in constant memory.

    Args:
        parameters: of the regression.
    """

    def __init__(self, parameters: WindingParameters) -> None:
        self._p = p = parameters
        frequencies = np.linspace(1.0 / p.period_most, 1.0 / p.period_least, p.periods)
        harmonics = np.arange(1, p.harmonics + 1)
        self._rates: Array = math.tau * frequencies[:, None] * harmonics  # (K, H) [rad/s]
        self._unknowns = 1 + 2 * p.harmonics
        sizes = [p.size] + [p.size_overtone] * (p.harmonics - 1)
        self._precision = np.diag([p.heading**-2, *(size**-2 for size in sizes for _ in range(2))])
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        count = len(self._rates)
        self._gram: Array = np.zeros((count, self._unknowns, self._unknowns))
        self._moment: Array = np.zeros((count, self._unknowns))
        self._t: float | None = None

    def turn(self, angle: float) -> None:
        """Follow a turn of the frame: all headings so far become larger by `angle` [rad]."""
        self._moment += angle * self._gram[:, 0, :]

    def add(self, t: float, heading: float) -> None:
        """Take a heading [rad], not wrapped, at `t` [s]; called in the order of time."""
        p = self._p
        if self._t is not None:
            kept = math.exp((self._t - t) / p.memory)
            self._gram *= kept
            self._moment *= kept
        self._t = t
        row = self._basis(self._rates, t)
        precision = p.deviation**-2
        self._gram += precision * row[:, :, None] * row[:, None, :]
        self._moment += (precision * heading) * row

    def course(self, t: float) -> HeadingCourse:
        """Give the headings expected from a little before `t` [s] on: the mean over all periods by their evidence."""
        p = self._p
        precision = self._gram + self._precision
        mean = np.linalg.solve(precision, self._moment[:, :, None])[:, :, 0]
        evidence = 0.5 * ((self._moment * mean).sum(axis=1) - np.linalg.slogdet(precision)[1])
        weights = np.exp(evidence - evidence.max())
        weights /= weights.sum()
        told = np.flatnonzero(weights >= min(_NEGLIGIBLE, float(weights.max())))
        share = weights[told] / weights[told].sum()
        times: Array = t - p.back + p.step * np.arange(round((p.back + p.ahead) / p.step) + 1.0)
        rows = self._basis(self._rates[told, None, :], times[:, None])
        headings = share @ (rows * mean[told, None, :]).sum(axis=-1)
        return HeadingCourse(t_start=float(times[0]), step=p.step, headings=headings)

    def _basis(self, rates: Array, t: float | Array) -> Array:
        """Give 1, cosines and sines in turn, (..., 2 H + 1), for rates (..., H)."""
        angles = rates * t
        rows = np.empty((*angles.shape[:-1], self._unknowns))
        rows[..., 0] = 1.0
        rows[..., 1::2] = np.cos(angles)
        rows[..., 2::2] = np.sin(angles)
        return rows
