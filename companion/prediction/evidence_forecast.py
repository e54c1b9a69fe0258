"""A forecast that leads from the present state into the motion that the target is taken to follow."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array
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

    Before the anchor the velocity is held. The arrays are taken over, and may not be written to any more.
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
            getattr(self, name).setflags(write=False)

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]."""
        since = max(t - self.anchor_t, 0.0)
        pose, rate, acceleration = self._motion(min(since, self.lasting))
        if since > self.lasting:
            over = since - self.lasting
            left = math.exp(-over / self.lasting)
            reach = self.lasting * (1.0 - left)
            for axis, mean in enumerate(self.mean_rate.tolist()):
                excess = rate[axis] - mean
                pose[axis] += mean * over + excess * reach
                rate[axis] = mean + excess * left
                acceleration[axis] = excess * (-left / self.lasting)
        before = min(t - self.anchor_t, 0.0)
        departure = zip(self.deviation.tolist(), self.deviation_rate.tolist(), self.decay.tolist(), strict=True)
        for axis, (r, q, k) in enumerate(departure):
            fade = math.exp(-k * since)
            deviation = r + q * since
            rate[axis] += (q - k * deviation) * fade
            pose[axis] += deviation * fade + before * rate[axis]
        covariance = self.anchor_covariance.copy()
        covariance.reshape(-1)[::5] += self.spread.after(since)
        return TargetPose(
            t=t,
            position_ned=np.array(pose[:3]),
            velocity_ned=np.array(rate[:3]),
            acceleration_ned=np.array(acceleration[:3]),
            yaw=pose[3],
            yaw_rate=rate[3],
            covariance=covariance,
        )

    def positions_ned(self, times: Array) -> Array:
        """Give positions (N, 3) [m] at the instants (N,) [s], in the order of time."""
        since = times - self.anchor_t
        early = float(since[0]) < 0.0
        if early:
            before, since = np.minimum(since, 0.0), np.maximum(since, 0.0)
        if float(since[-1]) <= self.lasting:
            result = self._places(since)
        else:
            result = self._places(np.minimum(since, self.lasting))
            over = np.maximum(since - self.lasting, 0.0)[:, None]
            mean = self.mean_rate[:3]
            excess = np.array(self._motion(self.lasting)[1][:3]) - mean
            result += mean * over + (self.lasting * excess) * -np.expm1(over / -self.lasting)
        column = since[:, None]
        deviation = column * self.deviation_rate[:3]
        deviation += self.deviation[:3]
        deviation *= np.exp(column * -self.decay[:3])
        result += deviation
        if early:
            result += before[:, None] * self.at(self.anchor_t).velocity_ned
        return result

    def _motion(self, since: float) -> tuple[list[float], list[float], list[float]]:
        """Give pose, rate and acceleration (4) of the motion m."""
        s = min(since, self.hold)
        held = since - s
        square, cube = s * (s + 2.0 * held), s * s * (s + 3.0 * held)
        pose, rate, acceleration = [], [], []
        for c0, c1, c2, c3 in zip(*self.motion.tolist(), strict=True):
            pose.append(c0 + since * c1 + square * c2 + cube * c3)
            rate.append(c1 + 2.0 * s * c2 + 3.0 * s * s * c3)
            acceleration.append(2.0 * c2 + 6.0 * s * c3 if held == 0.0 else 0.0)
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
        powers = np.empty((4, len(since)))
        powers[0] = 1.0
        powers[1] = since
        thrice = 3.0 * since - 2.0 * s  # s + 3 (since - s)
        np.multiply(s, thrice - since + s, out=powers[2])
        np.multiply(s * s, thrice, out=powers[3])
        result: Array = powers.T @ self.motion[:, :3]
        if self.arc_velocity != 0.0:
            place = self._arc_places(since)
            result[:, 0] += place.real
            result[:, 1] += place.imag
        return result

    def _arc_places(self, since: Array) -> NDArray[np.complexfloating[Any, Any]]:
        """Give the places (N,) [m] on the arc, north + i east."""
        velocity, rate = self.arc_velocity, self.arc_rate
        places: NDArray[np.complexfloating[Any, Any]]
        if abs(rate) < _SLOW_TURN:
            places = velocity * since
        elif float(since[-1]) <= self.turn_hold:
            places = (velocity / (1j * rate)) * (np.exp((1j * rate) * since) - 1.0)
        else:
            turning = np.minimum(since, self.turn_hold)
            turned = np.exp((1j * rate) * turning)
            places = velocity * ((turned - 1.0) / (1j * rate) + turned * (since - turning))
        return places

    def _arc(self, since: float) -> tuple[complex, complex, complex]:
        """Give place [m], velocity [m/s] and acceleration [m/s^2] on the arc, north + i east."""
        velocity, rate = self.arc_velocity, self.arc_rate
        if abs(rate) < _SLOW_TURN:
            return velocity * since, velocity, 0.0j
        turning = min(since, self.turn_hold)
        turned = velocity * cmath.exp(1j * rate * turning)
        place = (turned - velocity) / (1j * rate) + turned * (since - turning)
        return place, turned, 1j * rate * turned if since <= self.turn_hold else 0.0j
