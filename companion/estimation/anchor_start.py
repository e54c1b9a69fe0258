"""One anchor from ranges along a known path: linear trilateration, then robust refinement, from both mirror images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from companion.geometry.arrays import Array

_TRIMS = 4  # rounds of linear trilateration without the worst readings
_KEPT = 2.5  # times the median error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnchorFit:
    """Where an anchor stands if the path does not drift."""

    path: Array  # (n, 3) [m] of the tag
    range: Array  # (n,) [m]
    std: float  # [m] of a range against the path
    delay_std: float  # [m] of a delay before
    position: Array  # (3,) [m]
    delay: float  # [m]
    cost: float  # half the sum of losses; lower by one: e times as likely

    @classmethod
    def of(cls, path: Array, ranges: Array, position: Array, delay: float, std: float, delay_std: float) -> AnchorFit:
        """Build the fit of a place that was found elsewhere; its cost is that of the best place nearby."""
        start = cls(
            path=path, range=ranges, std=std, delay_std=delay_std, position=position, delay=delay, cost=float("inf")
        )
        return start.refined(position)

    def refined(self, position: Array) -> AnchorFit:
        """Give the best fit near a place, by soft L1."""
        result: Any = least_squares(
            self._residuals,
            np.array([*position, self.delay]),
            jac=self._jacobian,
            loss="soft_l1",
            xtol=1e-6,
            ftol=1e-6,
            gtol=1e-6,
            max_nfev=60,
        )
        return replace(self, position=result.x[:3], delay=float(result.x[3]), cost=float(result.cost))

    def _residuals(self, unknowns: Array) -> Array:
        expected = np.linalg.norm(self.path - unknowns[:3], axis=1) + unknowns[3]
        return np.append((expected - self.range) / self.std, unknowns[3] / self.delay_std)

    def _jacobian(self, unknowns: Array) -> Array:
        offsets = unknowns[:3] - self.path
        sight = offsets / np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)[:, np.newaxis]
        rows = np.column_stack([sight, np.ones(self.range.size)]) / self.std
        return np.vstack([rows, [0.0, 0.0, 0.0, 1.0 / self.delay_std]])


def fit_anchor(path: Array, ranges: Array, std: float, delay_std: float) -> AnchorFit:
    """Fit one anchor.

    Args:
        path: (n, 3) [m] of the tag, not all in one plane.
        ranges: (n,) [m].
        std: [m] of a range against the path.
        delay_std: [m] of a delay before.
    """
    start = _trilaterated(path, ranges)
    one = AnchorFit.of(path, ranges, start, 0.0, std, delay_std)
    other = replace(one, delay=0.0).refined(mirrored(start, path))
    return one if one.cost <= other.cost else other


def mirrored(position: Array, path: Array) -> Array:
    """Give the image (3,) of a place in the plane that a path (n, 3) lies in most nearly."""
    centre = path.mean(axis=0)
    normal = np.linalg.svd(path - centre, full_matrices=False)[2][2]
    image: Array = position - 2.0 * float(normal @ (position - centre)) * normal
    return image


def _trilaterated(path: Array, ranges: Array) -> Array:
    """Solve |p|^2 - r^2 = 2 p a - c for the place a (3,) and c, again and again without the worst readings."""
    centre = path.mean(axis=0)
    rows = np.column_stack([2.0 * (path - centre), -np.ones(ranges.size)])
    sides = np.sum((path - centre) ** 2, axis=1) - ranges**2
    kept = np.ones(ranges.size, dtype=bool)
    solution = np.zeros(4)
    for _ in range(_TRIMS):
        solution = np.linalg.lstsq(rows[kept], sides[kept], rcond=None)[0]
        errors = np.abs(rows @ solution - sides)
        kept = errors <= _KEPT * float(np.median(errors)) + 1e-9
    place: Array = centre + solution[:3]
    return place
