"""A turn about one axis from rest to rest, with a smooth and bounded rate; and how far two attitudes are apart."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.geometry.quaternions import between, product

_STILL = 1e-9  # [rad] a turn by less is none


def quaternion_error(quaternion: Array, wanted: Array) -> Array:
    """Give the rotation from an attitude to the wanted one as a quaternion in the body, q^-1 * wanted, w >= 0.

    Args:
        quaternion: (4,) c_from_d.
        wanted: (4,) likewise.
    """
    error = np.array(between(quaternion.tolist(), wanted.tolist()))
    return error if error[0] >= 0.0 else -error


def misalignment(quaternion: Array, wanted: Array) -> float:
    """Give the norm of the vector part of the error quaternion: sine of half the angle between two attitudes."""
    error = quaternion_error(quaternion, wanted).tolist()
    return min(1.0, math.sqrt(error[1] ** 2 + error[2] ** 2 + error[3] ** 2))


class Turn:
    """A turn about a fixed axis; the rate rises and falls as a cubic s(x) = 3 x^2 - 2 x^3, so its slope is continuous.

    Through half a turn exactly the axis is ambiguous; either way round is as long.
    """

    def __init__(self, *, start: Array, end: Array, t_start: float, rate: float, ramp: float) -> None:
        """Plan the turn.

        Args:
            start: (4,) attitude at `t_start`, c_from_d.
            end: (4,) attitude after it.
            t_start: [s].
            rate: largest rate [rad/s].
            ramp: time [s] from rest to that rate; a short turn keeps the ramps and stays below the rate.
        """
        error = quaternion_error(start, end)
        sine = float(np.linalg.norm(error[1:]))
        self._angle = 2.0 * math.atan2(sine, float(error[0]))
        self._axis = error[1:] / sine if self._angle > _STILL else np.array([1.0, 0.0, 0.0])
        self._start, self._end = frozen(start, (4,)), frozen(end, (4,))
        self._t = t_start
        self._ramp = ramp
        self._rate = min(rate, self._angle / ramp)
        self._duration = self._angle / self._rate + ramp if self._angle > _STILL else 0.0

    @property
    def t_end(self) -> float:
        """Instant [s] at which the goal stands in the attitude of the end."""
        return self._t + self._duration

    def at(self, t: float) -> tuple[Array, Array]:
        """Give the attitude (4,) c_from_d and the rate (3,) [rad/s] in d at `t`."""
        since = t - self._t
        if since >= self._duration:
            return self._end, np.zeros(3)
        if since <= 0.0:
            return self._start, np.zeros(3)
        angle, rate = self._profile(since)
        return self._turned(angle), rate * self._axis

    def _profile(self, since: float) -> tuple[float, float]:
        """Give angle [rad] and rate [rad/s] of the profile."""
        left = self._duration - since
        if since < self._ramp:
            x = since / self._ramp
            return self._rate * self._ramp * x**3 * (1.0 - 0.5 * x), self._rate * x * x * (3.0 - 2.0 * x)
        if left < self._ramp:
            x = left / self._ramp
            rest = self._rate * self._ramp * x**3 * (1.0 - 0.5 * x)
            return self._angle - rest, self._rate * x * x * (3.0 - 2.0 * x)
        return self._rate * (since - 0.5 * self._ramp), self._rate

    def _turned(self, angle: float) -> Array:
        """Give start * (rotation by `angle` about the axis)."""
        half = 0.5 * angle
        x, y, z = (math.sin(half) * self._axis).tolist()
        return np.array(product(self._start.tolist(), (math.cos(half), x, y, z)))
