"""A forecast that leads from the present state into the motion that the target is taken to follow."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.messages.target import TargetPose
from companion.prediction.spread import Spread

_SLOW_TURN = 1e-4  # [rad/s] below this an arc is a line


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvidencePrediction:
    """A target's pose over time.

    With s the time since the anchor, the newest state that was measured, per degree of freedom

        p(s) = m(s) + (r + q s) e^(-k s),

    where m is the motion: a cubic up to `hold`, its velocity held from there on, and an arc on top; after `lasting` its
    velocity returns to the mean velocity, in as long again. r is the present deviation from it, and q = k r + the
    deviation of the velocity where that is smooth: the mean, given its present state, of the process that `segments`
    takes the deviations for.

    The variance is that of the anchor plus what the target may do since.

    Before the anchor the velocity is held.
    """

    t: float  # [s]
    horizon: float  # [s]
    reset_counter: int
    anchor_t: float  # [s] not after `t`
    anchor_covariance: Array  # (4, 4) of the pose then
    motion: Array  # (4, 4) rows c0..c3 by the time since the anchor, columns north, east, down [m], yaw [rad]
    hold: float  # [s] after the anchor
    turn_hold: float  # [s] after the anchor, from when on it no longer turns
    lasting: float  # [s] how long the motion is expected to go on
    mean_rate: Array  # (4,) [m/s, rad/s] to which the velocity returns after that
    arc_velocity: complex  # [m/s] north + i east at the anchor; turns with the yaw's rate
    arc_rate: float  # [rad/s]
    deviation: Array  # (4,) r
    deviation_rate: Array  # (4,) q
    decay: Array  # (4,) [1/s] k
    spread: Spread  # what it adds to the variance of the anchor

    def __post_init__(self) -> None:
        for name in ("anchor_covariance", "motion", "deviation", "deviation_rate", "decay", "mean_rate"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]."""
        since = max(t - self.anchor_t, 0.0)
        pose, rate, acceleration = self._motion(min(since, self.lasting))
        if since > self.lasting:
            over = since - self.lasting
            left = math.exp(-over / self.lasting)
            excess = rate - self.mean_rate
            pose += self.mean_rate * over + excess * (self.lasting * (1.0 - left))
            rate = self.mean_rate + excess * left
            acceleration = excess * (-left / self.lasting)
        fade = np.exp(-self.decay * since)
        deviation = self.deviation + self.deviation_rate * since
        pose += deviation * fade
        rate = rate + (self.deviation_rate - self.decay * deviation) * fade

        if t < self.anchor_t:
            pose += (t - self.anchor_t) * rate
        covariance = self.anchor_covariance.copy()
        covariance.reshape(-1)[::5] += self.spread.after(since)
        return TargetPose(
            t=t,
            position_ned=pose[:3],
            velocity_ned=rate[:3],
            acceleration_ned=acceleration[:3],
            yaw=float(pose[3]),
            yaw_rate=float(rate[3]),
            covariance=covariance,
        )

    def positions_ned(self, times: Array) -> Array:
        """Give positions (N, 3) [m] at the instants (N,) [s]."""
        since = np.maximum(times - self.anchor_t, 0.0)
        result = self._places(np.minimum(since, self.lasting))
        if float(since[-1]) > self.lasting:
            over = np.maximum(since - self.lasting, 0.0)[:, None]
            excess = self._motion(self.lasting)[1][:3] - self.mean_rate[:3]
            result += self.mean_rate[:3] * over + excess * (self.lasting * (1.0 - np.exp(over / -self.lasting)))
        deviation = self.deviation[:3] + since[:, None] * self.deviation_rate[:3]
        result += deviation * np.exp(-since[:, None] * self.decay[:3])
        if times[0] < self.anchor_t:
            before = np.minimum(times - self.anchor_t, 0.0)
            result += before[:, None] * self.at(self.anchor_t).velocity_ned
        return result

    def _motion(self, since: float) -> tuple[Array, Array, Array]:
        """Give pose, rate and acceleration (4,) of the motion m."""
        s = min(since, self.hold)
        held = since - s
        weights = np.array(
            [
                [1.0, since, s * s + 2.0 * s * held, s * s * s + 3.0 * s * s * held],
                [0.0, 1.0, 2.0 * s, 3.0 * s * s],
                [0.0, 0.0, 2.0, 6.0 * s] if held == 0.0 else [0.0, 0.0, 0.0, 0.0],
            ]
        )
        pose, rate, acceleration = weights @ self.motion
        if since > self.turn_hold:
            pose[3] -= rate[3] * (since - self.turn_hold)
            rate[3] = 0.0
        place, velocity, turning = self._arc(since)
        pose[0] += place.real
        pose[1] += place.imag
        rate[0] += velocity.real
        rate[1] += velocity.imag
        acceleration[0] += turning.real
        acceleration[1] += turning.imag
        return pose, rate, acceleration

    def _places(self, since: Array) -> Array:
        """Give the positions (N, 3) [m] of the motion m."""
        s = np.minimum(since, self.hold)
        held = since - s
        square = s * s
        powers = np.stack([np.ones_like(s), since, square + 2.0 * s * held, square * (s + 3.0 * held)], axis=1)
        result: Array = powers @ self.motion[:, :3]
        if self.arc_velocity != 0.0:
            place = self.arc_velocity * since
            if abs(self.arc_rate) > _SLOW_TURN:
                turning = np.minimum(since, self.turn_hold)
                turned = np.exp((1j * self.arc_rate) * turning)
                place = self.arc_velocity * ((turned - 1.0) / (1j * self.arc_rate) + turned * (since - turning))
            result[:, 0] += place.real
            result[:, 1] += place.imag
        return result

    def _arc(self, since: float) -> tuple[complex, complex, complex]:
        """Give place [m], velocity [m/s] and acceleration [m/s^2] on the arc, north + i east."""
        velocity, rate = self.arc_velocity, self.arc_rate
        if abs(rate) < _SLOW_TURN:
            return velocity * since, velocity, 0.0j
        turning = min(since, self.turn_hold)
        turned = velocity * cmath.exp(1j * rate * turning)
        place = (turned - velocity) / (1j * rate) + turned * (since - turning)
        return place, turned, 1j * rate * turned if since <= self.turn_hold else 0.0j
