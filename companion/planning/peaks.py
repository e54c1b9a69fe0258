"""How fast, hard and sharp a polynomial piece gets, against the limits.

Peaks are taken over 65 Chebyshev-Lobatto nodes, the ends among them. A polynomial of degree n exceeds its largest
value on N + 1 such nodes by at most the factor 1 / cos(n pi / 2N) (Ehlich & Zeller, 1964): at most 2.3 % for the
horizontal speed (its square has degree 12), 1.6 % for the acceleration, 0.5 % for the jerk; in practice by less
than 0.3 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.messages.motion import MotionLimits
from companion.planning.spline import SNAP, derivative_row

LIMIT_NAMES = (
    "speed_horizontal",
    "speed_up",
    "speed_down",
    "acceleration_horizontal",
    "acceleration_vertical",
    "jerk",
    "yaw_rate",
    "yaw_acceleration",
    "closing_speed",
)
# By which power of time each falls when a motion from rest to rest is slowed down.
TIME_POWERS = (1, 1, 1, 2, 2, 3, 1, 2, 1)

_NODES = 65
_DEGREE = 2 * SNAP - 1
Peaks = tuple[float, ...]  # as LIMIT_NAMES


def _grid() -> Array:
    nodes = 0.5 * (1.0 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1)))
    return frozen([derivative_row(float(s), _DEGREE, k) for k in (1, 2, 3) for s in nodes])


# (3 * 65, 8): coefficients over s to velocity, acceleration and jerk over s, at the nodes.
GRID = _grid()


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitUse:
    """How far the most used limit is used."""

    name: str  # one of LIMIT_NAMES
    ratio: float  # peak divided by limit; above 1 the limit is broken


def limit_values(limits: MotionLimits, closing_speed: float = math.inf) -> Peaks:
    """Give the limits in the order of LIMIT_NAMES. `closing_speed`: [m/s] relative to the goal."""
    return (
        limits.speed_horizontal,
        limits.speed_up,
        limits.speed_down,
        limits.acceleration_horizontal,
        limits.acceleration_vertical,
        limits.jerk,
        limits.yaw_rate,
        limits.yaw_acceleration,
        closing_speed,
    )


def position_peaks(values: Array, duration: float, goal_velocity: tuple[float, float, float] | None) -> Peaks:
    """Give the peaks of the translation; the yaw's two entries are zero.

    Args:
        values: (195, 3) `GRID @ coefficients`.
        duration: of the piece [s].
        goal_velocity: [m/s] ned; None where the closing speed does not matter.
    """
    stacked = values.reshape(3, _NODES, 3)
    squares = stacked[:2] * stacked[:2]
    horizontal = (squares[:, :, 0] + squares[:, :, 1]).max(axis=1).tolist()
    highest = stacked.max(axis=1).tolist()
    lowest = stacked.min(axis=1).tolist()
    closing = 0.0
    if goal_velocity is not None:
        relative = stacked[0] - np.array(goal_velocity) * duration
        closing = math.sqrt(float(np.einsum("ij,ij->i", relative, relative).max())) / duration
    rate = 1.0 / duration
    return (
        math.sqrt(horizontal[0]) * rate,
        max(-lowest[0][2] * rate, 0.0),
        max(highest[0][2] * rate, 0.0),
        math.sqrt(horizontal[1]) * rate**2,
        max(highest[1][2], -lowest[1][2]) * rate**2,
        max(*highest[2], *(-low for low in lowest[2])) * rate**3,
        0.0,
        0.0,
        closing,
    )


def yaw_peaks(coefficients: tuple[float, float, float, float], duration: float) -> tuple[float, float]:
    """Give the exact largest yaw rate [rad/s] and yaw acceleration [rad/s^2] of a cubic over s."""
    _, c1, c2, c3 = coefficients
    rates = [c1, c1 + 2.0 * c2 + 3.0 * c3]
    if c3 != 0.0 and 0.0 < -c2 / (3.0 * c3) < 1.0:
        rates.append(c1 - c2 * c2 / (3.0 * c3))
    acceleration = max(abs(2.0 * c2), abs(2.0 * c2 + 6.0 * c3))
    return max(map(abs, rates)) / duration, acceleration / duration**2


def worst_use(peaks: Peaks, limits: Peaks) -> LimitUse:
    """Give the limit that is used most."""
    ratios = [peak / limit for peak, limit in zip(peaks, limits, strict=True)]
    index = max(range(len(ratios)), key=ratios.__getitem__)
    return LimitUse(name=LIMIT_NAMES[index], ratio=ratios[index])
