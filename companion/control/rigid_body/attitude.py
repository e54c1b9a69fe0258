"""Attitude control: quaternion feedback with a limit on the turn rate.

With q the vector part of the error quaternion d_from_goal, w >= 0 (the short way round), k and c of `gains.py`:

    rate_wanted = limit(rate_goal + 2 k / c q),    torque = I c (rate_wanted - rate) + rate x I rate

Below the limit that is torque = 2 k I q + c I (rate_goal - rate) + rate x I rate, the quaternion feedback of Wie &
Barba (1985), whose gains proportional to the inertia turn about the shortest axis and are stable for every error. The
limit is the cascade of Wie & Lu (Feedback control logic for spacecraft eigenaxis rotations under slew rate and control
constraints, 1995). Where k / c is below c / 4, the part of an error beyond the widest band counts with c / 4, which is
critical damping: a large turn is then stopped by few long pulses instead of many short ones. Which errors are not worth
a pulse is decided in `pulses.py`, for all axes together.
"""

from __future__ import annotations

import math

import numpy as np

from companion.control.rigid_body.gains import attitude_gains
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.geometry.arrays import Array


class AttitudeFeedback:
    """The gains and limits; no state."""

    def __init__(self, parameters: RigidBodyParameters) -> None:
        self._p = parameters
        self._gains = attitude_gains(parameters)
        self._ratio = self._gains.attitude / self._gains.rate

    def torque(self, error: Array, rate_goal: Array, rate: Array) -> Array:
        """Give the torque [N m], (3,), in d.

        Args:
            error: (4,) d_from_goal.
            rate_goal: (3,) [rad/s] of the goal, in d.
            rate: (3,) [rad/s] of d, in d.
        """
        p, inertia = self._p, self._p.inertia
        wanted = rate_goal + self._approach(error)
        size = math.sqrt(float(wanted @ wanted))
        if size > p.rate_max:
            wanted *= p.rate_max / size
        x, y, z = wanted.tolist()
        wx, wy, wz = rate.tolist()
        hx, hy, hz = inertia[0] * wx, inertia[1] * wy, inertia[2] * wz
        gain = self._gains.rate
        ax, ay, az = gain * (x - wx), gain * (y - wy), gain * (z - wz)
        return np.array(
            [
                inertia[0] * ax + wy * hz - wz * hy,
                inertia[1] * ay + wz * hx - wx * hz,
                inertia[2] * az + wx * hy - wy * hx,
            ]
        )

    def _approach(self, error: Array) -> Array:
        """Give the turn rate (3,) [rad/s] towards the goal: soft near it, critically damped farther off."""
        sine = math.sqrt(float(error[1:] @ error[1:]))
        lead = self._ratio
        beyond = 2.0 * sine - self._p.attitude_band_max
        if beyond > 0.0:
            lead += max(0.0, 0.25 * self._gains.rate - self._ratio) * beyond / (2.0 * sine)
        towards: Array = math.copysign(2.0 * lead, error[0]) * error[1:]
        return towards

    def band(self, covariance: Array) -> float:
        """Give the error [rad] that is not worth a pulse: as large as attitude and rate are uncertain.

        Args:
            covariance: (3, 3) [rad^2] of the estimated attitude, in d.
        """
        p = self._p
        spread = math.sqrt(max(float(covariance.trace()) / 3.0, 0.0) + (p.rate_noise / self._ratio) ** 2)
        return min(max(p.noise_band * spread, p.attitude_band), p.attitude_band_max)
