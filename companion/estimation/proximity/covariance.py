"""The covariance of the errors of (position, velocity, attitude[, gyro bias]): in one piece, or in two.

Errors: position and velocity of the centre of mass in c; attitude as a rotation vector in d, truth = estimate * error;
gyro bias in d. "Joint" means in this order, (9, 9) or with bias (12, 12).

The tandem structure needs a point of the body whose position error has nothing to do with the attitude error: a
measurement that depends on this point alone then concerns one of the two filters alone, and neither has to guess
what it shares with the other. For ranges it is the radio (so Parikh et al., eq. 4, estimate rho_ij, the radio's place,
not the centre of mass); for pictures it is the middle of the markers, seen as a point of the body. With the lever l of
that point,

    dp = drho + R [l]x theta,    cov(drho, theta) = 0

says the whole joint covariance, cross terms included.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.estimation.proximity.attitude import Triple, turn_back
from companion.geometry.arrays import Array
from companion.geometry.rotations import skew

POSITION, VELOCITY, ATTITUDE, BIAS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
_EYE3 = np.eye(3)
_EYE6 = np.eye(6)


class Step(NamedTuple):
    """What happens between two instants."""

    turn_time: float  # [s] the attitude moves on by it
    rate: Triple  # [rad/s] in d, all the time
    time: float  # [s] position and velocity move on by it, 0: not yet
    c_from_d: Array  # (3, 3) at the end
    acceleration: Array  # (3,) [m/s^2] commanded, in d
    acceleration_density: float  # [m^2/s^3] of the white acceleration


class Noise(NamedTuple):
    """Densities of what drives the attitude error, and how long an attitude error acts on a position."""

    gyro: float  # [rad^2/s]
    bias: float  # [rad^2/s^3]
    coupling_time: float  # [s] of a turn
    burst_time: float  # [s] of thrust


class Compounded(NamedTuple):
    """One covariance of 9 states (12 with bias)."""

    matrix: Array

    def predicted(self, step: Step, noise: Noise) -> Compounded:
        """Move on by a step, in which both times are the same."""
        size = len(self.matrix)
        transition = np.eye(size)
        dt = step.time
        transition[POSITION, VELOCITY] = dt * _EYE3
        if step.acceleration.any():
            sideways = -dt * (step.c_from_d @ skew(step.acceleration))
            transition[VELOCITY, ATTITUDE] = sideways
            transition[POSITION, ATTITUDE] = 0.5 * dt * sideways
        transition[ATTITUDE, ATTITUDE] = turn_back(step.rate, dt)
        if size == BIAS.stop:
            transition[ATTITUDE, BIAS] = -dt * _EYE3
        matrix = transition @ self.matrix @ transition.T
        matrix[:6, :6] += _wander(dt, step.acceleration_density)
        _add_gyro_noise(matrix[6:, 6:], step.turn_time, noise)
        return Compounded(matrix)

    def joint(self, c_from_d: Array) -> Array:  # noqa: ARG002  the tandem structure needs it
        """Give the joint covariance."""
        return self.matrix


class Tandem(NamedTuple):
    """Two covariances: (6, 6) of a body point and the velocity, (3, 3) of the attitude, (6, 6) with bias."""

    translation: Array
    rotation: Array
    lever: Array  # (3,) [m] of the point, in d

    def predicted(self, step: Step, noise: Noise) -> Tandem:
        """Move on by a step. The attitude error acts on the translation as noise, for both are kept apart."""
        rotation, translation = self.rotation, self.translation
        if step.turn_time > 0.0:
            transition = turn_back(step.rate, step.turn_time)
            if len(rotation) > len(transition):
                back, transition = transition, _EYE6.copy()
                transition[:3, :3] = back
                transition[:3, 3:] = -step.turn_time * _EYE3
            rotation = transition @ rotation @ transition.T
            _add_gyro_noise(rotation, step.turn_time, noise)
        if step.time > 0.0:
            transition = _EYE6.copy()
            transition[POSITION, VELOCITY] = step.time * _EYE3
            translation = transition @ translation @ transition.T
            translation += self._driven(step, noise)
        return Tandem(translation, rotation, self.lever)

    def _driven(self, step: Step, noise: Noise) -> Array:
        """Process noise (6, 6): white acceleration, and what the attitude error does to thrust and to the point."""
        theta = max(self.rotation[0, 0], self.rotation[1, 1], self.rotation[2, 2])
        x, y, z = self.lever.tolist()
        u, v, w = step.rate
        swing = (v * z - w * y) ** 2 + (w * x - u * z) ** 2 + (u * y - v * x) ** 2
        thrust = step.acceleration
        sideways = 2.0 * noise.burst_time * theta * float(thrust @ thrust)
        driven = _wander(step.time, step.acceleration_density + sideways)
        point = step.time * (2.0 * noise.coupling_time * theta * swing + noise.gyro * (x * x + y * y + z * z))
        driven[0, 0] += point
        driven[1, 1] += point
        driven[2, 2] += point
        return driven

    def joint(self, c_from_d: Array) -> Array:
        """Give the joint covariance, cross terms included."""
        size = 6 + len(self.rotation)
        matrix = np.zeros((size, size))
        matrix[:6, :6] = self.translation
        matrix[6:, 6:] = self.rotation
        lever = c_from_d @ skew(self.lever)
        cross = lever @ self.rotation[:3]
        matrix[POSITION, 6:] = cross
        matrix[6:, POSITION] = cross.T
        matrix[POSITION, POSITION] += cross[:, :3] @ lever.T
        return matrix


Covariance = Compounded | Tandem


def split(joint: Array, c_from_d: Array, lever: Array) -> Tandem:
    """Part a joint covariance at a body point; what the two still share there is dropped.

    Args:
        joint: (9, 9) or (12, 12).
        c_from_d: (3, 3).
        lever: (3,) [m] of the point, in d.
    """
    arm = c_from_d @ skew(lever)
    translation = joint[:6, :6].copy()
    shared = arm @ joint[ATTITUDE, :6]
    translation[POSITION] -= shared
    translation[:, POSITION] -= shared.T
    translation[POSITION, POSITION] += arm @ joint[ATTITUDE, ATTITUDE] @ arm.T
    return Tandem(translation, joint[6:, 6:].copy(), lever)


def _add_gyro_noise(rotation: Array, dt: float, noise: Noise) -> None:
    for k in range(3):
        rotation[k, k] += noise.gyro * dt
    for k in range(3, len(rotation)):
        rotation[k, k] += noise.bias * dt


def _wander(dt: float, density: float) -> Array:
    """Covariance (6, 6) that white acceleration of a density [m^2/s^3] makes of position and velocity in `dt`."""
    wander = np.zeros((6, 6))
    speed = density * dt
    crossed = 0.5 * speed * dt
    place = crossed * dt / 1.5
    for k in range(3):
        wander[k, k] = place
        wander[k + 3, k + 3] = speed
        wander[k, k + 3] = wander[k + 3, k] = crossed
    return wander
