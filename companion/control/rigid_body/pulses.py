"""On/off pulses for a wanted impulse and angular impulse.

A valve that opens for less than its least on-time gives no dependable impulse. On-times of the optimal allocation
that are long enough are given. For what the short ones would have done, w, a table of small firings is searched:
every set of up to five nozzles, none open for less than the least on-time. The firing of the least cost is taken.
Its cost is the harm of what it leaves undone, r = w - B u, and a price for every least pulse of propellant:

    |r_force / (m v)|^2 + |r_torque / (I o)|^2 + price * sum(u) / u_least

with v = b_p k_p / k_v and o = b_a k_a / k_w: the velocity and the turn rate at which the feedback takes back the
errors b_p and b_a that are not worth a pulse. While the harm of w itself is below 1 nothing is done; when the
valves open, all axes are put right together. Opening one nozzle whenever it does some good is cheaper at once and
dearer in the end: what it leaves undone is soon too much again.

What is left undone is owed: the next period asks for it again, but for the part (k_v T, k_w T) that the feedback
asks for anyway since it sees the error. It cannot grow without bound: on-times of at least the least on-time are
always given.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from companion.control.rigid_body.allocation import Allocation, NozzleAllocator
from companion.control.rigid_body.gains import attitude_gains, translation_gains
from companion.control.rigid_body.nozzles import effectiveness
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.geometry.arrays import Array

_MOST = 5  # nozzles of a small firing
_SWEEPS = 8  # over the nozzles; a firing that is not yet the best of its set costs a little more, and is no less right


class PulseMaker:
    """Holds what is owed."""

    def __init__(self, parameters: RigidBodyParameters) -> None:
        p = parameters
        linear, angular = translation_gains(p), attitude_gains(p)
        self._effect = effectiveness(p.nozzle_places, p.nozzle_directions, p.thrust)
        self._allocator = NozzleAllocator(self._effect, p.period)
        self._least, self._longest, self._price = p.least_on_time, p.period, p.pulse_price
        self._force_unit = p.mass * linear.position / linear.velocity  # [N s] for a band of 1 m
        self._torque_unit = np.array(p.inertia) * angular.attitude / angular.rate  # [N m s] for a band of 1 rad
        still = (max(0.0, 1.0 - linear.velocity * p.period), max(0.0, 1.0 - angular.rate * p.period))
        self._still_owed = np.repeat(still, 3)
        self._sets = p.least_on_time * _firing_sets(self._effect.shape[1])
        self._inside = [np.flatnonzero(column) for column in self._sets.T]
        self._owed = np.zeros(6)

    @property
    def owed(self) -> Array:
        """Impulse [N s] and angular impulse [N m s] that the next period asks for on top, (6,), in d."""
        return self._owed

    @property
    def effect(self) -> Array:
        """Matrix (6, N) from on-times to impulse and angular impulse."""
        return self._effect

    def reset(self) -> None:
        """Forget what is owed."""
        self._owed = np.zeros(6)

    def update(self, wanted: Array, *, position_band: float, attitude_band: float) -> Allocation:
        """Give the on-times of one period, each 0 or at least the least on-time.

        Args:
            wanted: (6,) impulse [N s] and angular impulse [N m s], in d.
            position_band: [m] error that is not worth a pulse.
            attitude_band: [rad] likewise.
        """
        ideal = self._allocator.allocate(wanted + self._owed)
        on_times = np.where(ideal.on_times < self._least, 0.0, ideal.on_times)
        given: Array = self._effect @ on_times
        undone = ideal.wrench - given
        more = self._small_firing(undone, self._weights(position_band, attitude_band))
        if more is not None and float((on_times + more).max()) <= self._longest:
            on_times = on_times + more
            given = self._effect @ on_times
            undone = ideal.wrench - given
        self._owed = self._still_owed * undone
        return Allocation(on_times=on_times, wrench=given, share=ideal.share, torque_share=ideal.torque_share)

    def _small_firing(self, wrench: Array, weights: Array) -> Array | None:
        """Give the firing of least cost for a small wrench (6,); None: better none.

        In each set the weighted least squares with lower bounds are solved by coordinate descent, all sets at once.
        """
        aim = wrench * weights
        harm = float(aim @ aim)
        if harm <= 1.0:
            return None
        weighted = self._effect.T * weights
        gram, pull = weighted @ weighted.T, weighted @ aim
        firings = self._sets.copy()
        for _ in range(_SWEEPS):
            for j, inside in enumerate(self._inside):
                slope = firings[inside] @ gram[j] - pull[j]
                firings[inside, j] = np.maximum(firings[inside, j] - slope / gram[j, j], self._least)
        left = aim - firings @ weighted
        costs = np.einsum("ij,ij->i", left, left) + (self._price / self._least) * firings.sum(axis=1)
        best = int(np.argmin(costs))
        return firings[best].copy() if float(costs[best]) < harm else None

    def _weights(self, position_band: float, attitude_band: float) -> Array:
        """Give (6,) that turn a wrench left undone into the square root of its harm."""
        force = 1.0 / (self._force_unit * position_band)
        return np.array([force, force, force, *(1.0 / (self._torque_unit * attitude_band)).tolist()])


def _firing_sets(count: int) -> Array:
    """List the sets of nozzles of small firings: (S, N), 1 inside, 0 outside."""
    sets = [chosen for size in range(1, _MOST + 1) for chosen in combinations(range(count), size)]
    return np.array([[1.0 if j in chosen else 0.0 for j in range(count)] for chosen in sets])
