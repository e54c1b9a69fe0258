"""Where the pad is while it cannot be seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.geometry.arrays import Array, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoarseTarget:
    """The pad by survey, odometry and ranges: good enough to fly towards, not to descend or land on."""

    t: float  # [s] instant of validity
    position_ned: Array  # (3,) [m] landing point in the autopilot's local frame, by the odometry at `t`
    yaw: float  # [rad] the pad's heading from north
    covariance: Array  # (4, 4) of [north, east, down, yaw], relative to the vehicle
    mahalanobis: float  # root mean square Mahalanobis distance per degree of freedom of the last second's measurements
    t_range: float  # [s] of the newest fused range, -inf before the first
    by_ranges: bool  # ranges are expected: without them it is not what it should be

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_ned", frozen(self.position_ned, (3,)))
        object.__setattr__(self, "covariance", frozen(self.covariance, (4, 4)))

    @property
    def position_std(self) -> float:
        """Largest standard deviation of the horizontal position [m]."""
        north, east, cross = self.covariance[0, 0], self.covariance[1, 1], self.covariance[0, 1]
        half = 0.5 * (north + east)
        return math.sqrt(max(0.0, half + math.hypot(0.5 * (north - east), cross)))

    @property
    def inconsistency(self) -> float:
        """Averaged squared distance per degree of freedom above one, at least 0."""
        return max(0.0, self.mahalanobis**2 - 1.0)
