"""How the pad lies, as the autopilot's attitude has it: what the camera shows beyond it.

The downward normal of a level pad, turned by the autopilot's attitude, would be straight down. What is left is the
error of that attitude, which wanders, and the slope of the pad. Near the pad a single picture shows it to a few
milliradians, where the attitude is wrong by twenty. Whoever sets down wants to stand parallel to the pad, and need not
tell the two apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z


@dataclass(frozen=True, slots=True, kw_only=True)
class PadSlopeParameters:
    """Tuning of the filter."""

    prior: Annotated[float, Gt(0.0)] = 0.03  # [rad] deviation before the first sighting
    wander: Annotated[float, Gt(0.0)] = 0.0125  # [rad/sqrt(s)] random walk: 0.8 deg within 2.5 s
    floor: Annotated[float, Gt(0.0)] = 0.003  # [rad] least deviation of one sighting: lens, corners, mount


class PadSlope:
    """Holds the estimate between sightings: a random walk of two equal axes, forward and right."""

    def __init__(self, parameters: PadSlopeParameters | None = None) -> None:
        self._p = parameters or PadSlopeParameters()
        self.reset()

    def reset(self) -> None:
        """Forget the pad."""
        self._slope = np.zeros(2)
        self._variance = self._p.prior**2
        self._t = -math.inf

    @property
    def std(self) -> float:
        """Standard deviation of each axis [rad], at the newest sighting."""
        return math.sqrt(self._variance)

    def update(self, t: float, slope_level: Array, std: float) -> None:
        """Take a sighting. One that is not newer is ignored.

        Args:
            t: of its capture [s].
            slope_level: (2,) forward and right components of the pad's downward normal in `level`.
            std: its standard deviation [rad], each axis.
        """
        if t <= self._t or not (math.isfinite(std) and math.isfinite(float(slope_level[0]) + float(slope_level[1]))):
            return
        elapsed = 0.0 if math.isinf(self._t) else t - self._t
        variance = min(self._p.prior**2, self._variance + self._p.wander**2 * elapsed)
        share = variance / (variance + std * std + self._p.floor**2)
        self._slope = self._slope + share * (slope_level - self._slope)
        self._variance = (1.0 - share) * variance
        self._t = t

    def ned(self, yaw: float) -> Array:
        """Give the pad's downward normal, north and east (2,), for a vehicle with heading `yaw` [rad]."""
        turned: Array = rotation_about_z(yaw)[:2, :2] @ self._slope
        return turned
