"""The earliest meeting of the forecast target and the reachable set."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from companion.geometry.arrays import Array
from companion.messages.target import Intercept, Prediction, TargetPose
from companion.prediction.reach import Reachability

SCAN_STEP = 0.1  # [s] longest between two instants looked at
SMOOTH = 2.0  # [m] a margin that changes by more between them is looked at more finely,
REFINEMENTS = 2  # so often; each divides the bracket by 9


def earliest_intercept(
    *,
    prediction: Prediction,
    position_ned: Array,
    velocity_ned: Array,
    reach: Reachability,
    t: float,
    horizon: float,
    tolerance: float = 0.05,
) -> Intercept:
    """Find the smallest t* in [t, t + horizon] at which the target is in the reachable set, to within a tolerance.

    Patel et al., section 3: |p(t*)| - r(t*) < tolerance. A scan brackets the first crossing, in which the margin is
    taken for linear: at 3 m/s^2 that is wrong by 4 mm at most. Finer scans help where it jumps. Where there is none the
    intercept is set at the horizon, so that an approach is still attempted with the most time for planning anew.

    Args:
        prediction: of the target, in the autopilot's local frame.
        position_ned: (3,) [m] the vehicle now.
        velocity_ned: (3,) [m/s] the vehicle now.
        reach: of the vehicle.
        t: [s] now.
        horizon: [s] how far ahead to look.
        tolerance: [m].
    """
    positions: Callable[[Array], Array] = getattr(prediction, "positions_ned", None) or _one_by_one(prediction)
    low, high, found = 0.0, horizon, False
    count = max(2, math.ceil(horizon / SCAN_STEP) + 1)
    for _ in range(1 + REFINEMENTS):
        elapsed = low + (high - low) * _shares(count)
        margin = reach.margin(elapsed, positions(t + elapsed) - position_ned, velocity_ned)
        inside = margin > -tolerance
        first = int(inside.argmax())
        if not inside[first]:
            break
        found, high, count = True, float(elapsed[first]), 10
        if first == 0:
            break
        low, below, above = float(elapsed[first - 1]), float(margin[first - 1]), float(margin[first])
        if above - below < SMOOTH:
            high = low + (high - low) * (-tolerance - below) / (above - below)
            break
    pose = prediction.at(t + high)
    margin_there, probability = _margin_and_probability(pose, high, position_ned, velocity_ned, reach)
    return Intercept(t=t + high, pose=pose, feasible=found, margin=margin_there, probability=probability)


@lru_cache(maxsize=8)
def _shares(count: int) -> Array:
    """Give (count,) numbers from 0 to 1, a constant step apart."""
    shares = np.linspace(0.0, 1.0, count)
    shares.setflags(write=False)
    return shares


def _one_by_one(prediction: Prediction) -> Callable[[Array], Array]:
    """Make `positions_ned` of a prediction that answers for one instant at a time."""

    def positions(times: Array) -> Array:
        return np.array([prediction.at(float(instant)).position_ned for instant in times])

    return positions


def _margin_and_probability(
    pose: TargetPose, elapsed: float, position_ned: Array, velocity_ned: Array, reach: Reachability
) -> tuple[float, float]:
    """Give the margin [m] and the probability that it is positive, linearised in the target's position."""
    margin, gradient = reach.nearest(elapsed, pose.position_ned - position_ned, velocity_ned)
    variance = float(gradient @ pose.covariance[:3, :3] @ gradient)
    if variance <= 0.0:
        return margin, 1.0 if margin >= 0.0 else 0.0
    return margin, 0.5 * math.erfc(-margin / math.sqrt(2.0 * variance))
