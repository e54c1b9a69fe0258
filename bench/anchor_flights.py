"""Made-up flights around ranging anchors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.estimation.anchor_problem import FlownPath, FlownRanges
from companion.geometry.arrays import Array

ANCHORS = np.array([[3.0, -3.0, -0.1], [3.0, 3.0, -1.2], [-3.0, 3.0, -0.1], [-3.0, -3.0, -1.2]])  # [m]
RANGE_STD = 0.02  # [m]
OUTLIERS = 0.05  # of the ranges, longer by 0.15 to 1 m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnchorFlight:
    """What a calibration gets, and the truth."""

    path: FlownPath
    ranges: FlownRanges
    delays: Array  # (4,) [m]
    outliers: int
    drift: Array  # (N, 3) [m] of the odometry


def squares(t: Array, *, side: float = 6.0, speed: float = 1.0, heights: tuple[float, float] = (1.0, 3.0)) -> Array:
    """Give positions (N, 3) of a flight along a square, half of the time at either height."""
    half = 0.5 * side
    corners = np.array([[half, half], [half, -half], [-half, -half], [-half, half], [half, half]])
    way = (t * speed / side) % 4.0
    begun = way.astype(int)
    level = corners[begun] + (way - begun)[:, np.newaxis] * (corners[begun + 1] - corners[begun])
    climbed = np.clip((t - t[-1] / 2.0) / 4.0, 0.0, 1.0)
    return np.column_stack([level, -heights[0] - climbed * (heights[1] - heights[0])])


def anchor_flight(seed: int, positions: Array | None = None, *, drift: float = 0.01) -> AnchorFlight:
    """Give two minutes with 50 ranges a second, of all anchors in turn.

    Args:
        seed: of noise, delays, outliers and the drift's direction.
        positions: (6000, 3) [m] at 50 Hz; None: `squares`.
        drift: of the odometry, share of the way flown.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(6000) * 0.02
    truth = squares(t) if positions is None else positions
    direction = rng.normal(size=3)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth, axis=0), axis=1))])
    drifted = drift * way[:, np.newaxis] * direction / np.linalg.norm(direction)
    t_range = t[:-1] + 0.007
    anchor = np.arange(t_range.size) % len(ANCHORS)
    antenna = np.column_stack([np.interp(t_range, t, truth[:, axis]) for axis in range(3)])
    delays = rng.uniform(-0.15, 0.15, len(ANCHORS))
    ranges = (
        np.linalg.norm(antenna - ANCHORS[anchor], axis=1) + delays[anchor] + rng.normal(0.0, RANGE_STD, anchor.size)
    )
    wrong = rng.uniform(size=anchor.size) < OUTLIERS
    ranges[wrong] += rng.uniform(0.15, 1.0, int(wrong.sum()))
    return AnchorFlight(
        path=FlownPath(t=t, position=truth + drifted, covariance=np.eye(3) * 0.005**2),
        ranges=FlownRanges(t=t_range, anchor=anchor.astype(float), range=ranges),
        delays=delays,
        outliers=int(wrong.sum()),
        drift=drifted,
    )
