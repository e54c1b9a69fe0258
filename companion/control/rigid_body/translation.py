"""Position control: linear-quadratic feedback with feed-forward, integral, and a band in which nothing is done.

With e the goal's position minus the estimated one, along each axis of c, the gains k of `gains.py` and r = k_p / k_v:

    s = limit(r e) + de/dt,    a = a_goal + k_v dead(s, r b) + k_i sum(e T)

which is the regulator a_goal + k_p e + k_v de/dt + k_i sum(e T) where |s| is well above the band b. The lines |s| = r b
in the plane of e and de/dt are the switching lines of a phase-plane controller: between them the body coasts. The band
is as wide as the estimate is uncertain, `noise_band` standard deviations of s / r, since a correction that the estimate
takes back a second later costs propellant twice.
"""

from __future__ import annotations

import math

import numpy as np

from companion.control.rigid_body.gains import translation_gains
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.geometry.arrays import Array


class TranslationFeedback:
    """Holds the integral."""

    def __init__(self, parameters: RigidBodyParameters) -> None:
        self._p = parameters
        self._gains = translation_gains(parameters)
        self._ratio = self._gains.position / self._gains.velocity
        self._disturbance = np.zeros(3)

    @property
    def disturbance(self) -> Array:
        """Acceleration [m/s^2] that the integral makes up for, (3,), in c."""
        return self._disturbance

    def reset(self) -> None:
        """Forget the integral."""
        self._disturbance = np.zeros(3)

    def acceleration(self, error: Array, velocity_error: Array, band: Array) -> Array:
        """Give the correction [m/s^2] on top of the goal's acceleration, (3,), in c.

        Args:
            error: (3,) [m] goal minus estimate, in c.
            velocity_error: (3,) [m/s] likewise.
            band: (3,) [m] see `band`.
        """
        wish = self._ratio * error
        size = math.sqrt(float(wish @ wish))
        if size > self._p.correction_speed_max:
            wish *= self._p.correction_speed_max / size
        closing = wish + velocity_error
        edge = self._ratio * band
        beyond = closing - np.minimum(np.maximum(closing, -edge), edge)
        return self._gains.velocity * beyond + self._disturbance

    def integrate(self, error: Array, band: Array) -> None:
        """Add one period to the integral; not to be called while the nozzles are short of force.

        Args:
            error: (3,) [m] goal minus estimate, in c. An error so large that the correction is at its speed limit is
                no disturbance, and one within the band is none that can be seen: neither counts.
            band: as above.
        """
        p = self._p
        if self._ratio * math.sqrt(float(error @ error)) > p.correction_speed_max:
            return
        beyond = error - np.minimum(np.maximum(error, -band), band)
        added = self._disturbance + self._gains.integral * p.period * beyond
        self._disturbance = np.minimum(np.maximum(added, -p.disturbance_max), p.disturbance_max)

    def band(self, covariance: Array) -> Array:
        """Give the half width [m] of the band along x, y, z of c: the uncertainty of e + (de/dt) / r.

        Args:
            covariance: (9, 9) or (6, 6), of the estimated position and velocity first.
        """
        lead = 1.0 / self._ratio
        variances = covariance.diagonal()
        mixed = covariance[:3, 3:6].diagonal()
        spread = np.sqrt(np.maximum(variances[:3] + 2.0 * lead * mixed + lead * lead * variances[3:6], 0.0))
        return np.minimum(np.maximum(self._p.noise_band * spread, self._p.position_band), self._p.position_band_max)
