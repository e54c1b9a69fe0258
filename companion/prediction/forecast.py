"""A forecast as a cubic polynomial of time, with a covariance that grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.messages.target import TargetPose


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolynomialPrediction:
    """A target's pose over time: p(s) = c0 + c1 s + c2 s^2 + c3 s^3 with s the time since `t`, per degree of freedom.

    After `hold_after`, and before `t`, the velocity is held. The variance is that of the present pose, plus that of the
    fitted coefficients, plus what the target and the odometry may do: manoeuvre * s^2 + wander * s.
    """

    t: float  # [s]
    horizon: float  # [s]
    reset_counter: int
    coefficients: Array  # (4, 4) rows c0..c3, columns north, east, down [m], yaw [rad]
    hold_after: float  # [s] after `t`
    anchor_covariance: Array  # (4, 4) of the pose at `t`
    coefficient_covariance: Array  # (4, 4, 4) per degree of freedom, of c0..c3 without the anchor's
    manoeuvre: Array  # (4,) [m^2/s^2, rad^2/s^2] variance of a lasting velocity error
    wander: Array  # (4,) [m^2/s, rad^2/s] growth of the variance of a random walk

    def __post_init__(self) -> None:
        for name, shape in (
            ("coefficients", (4, 4)),
            ("anchor_covariance", (4, 4)),
            ("coefficient_covariance", (4, 4, 4)),
            ("manoeuvre", (4,)),
            ("wander", (4,)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), shape))

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]."""
        since = t - self.t
        s = min(max(since, 0.0), self.hold_after)
        held = since - s
        weights = np.array(
            [
                [1.0, s + held, s * s + 2.0 * s * held, s * s * s + 3.0 * s * s * held],
                [0.0, 1.0, 2.0 * s, 3.0 * s * s],
                [0.0, 0.0, 2.0, 6.0 * s],
            ]
        )
        pose, rate, acceleration = weights @ self.coefficients
        if held != 0.0:
            acceleration = np.zeros(4)
        return TargetPose(
            t=t,
            position_ned=pose[:3],
            velocity_ned=rate[:3],
            acceleration_ned=acceleration[:3],
            yaw=float(pose[3]),
            yaw_rate=float(rate[3]),
            covariance=self._covariance(weights[0], abs(since)),
        )

    def positions_ned(self, times: Array) -> Array:
        """Give positions (N, 3) [m] at the instants (N,) [s]."""
        since = times - self.t
        s = np.clip(since, 0.0, self.hold_after)
        held = since - s
        c0, c1, c2, c3 = self.coefficients[:, :3]
        square = s * s
        result: Array = (
            c0
            + since[:, None] * c1
            + (square + 2.0 * s * held)[:, None] * c2
            + (square * s + 3.0 * square * held)[:, None] * c3
        )
        return result

    def _covariance(self, weights: Array, since: float) -> Array:
        covariance = self.anchor_covariance.copy()
        growth = (
            self.coefficient_covariance @ weights @ weights + self.manoeuvre * (since * since) + self.wander * since
        )
        covariance.reshape(-1)[::5] += growth
        return covariance
