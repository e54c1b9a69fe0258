"""The covariance of the errors of (position, velocity, attitude[, gyro bias]): in one piece, or in two.

Errors: position and velocity of the centre of mass in c; attitude as a rotation vector in d, truth = estimate * error;
gyro bias in d. "Joint" means in this order, (9, 9) or with bias (12, 12).

The tandem structure needs a point of the body whose position error has nothing to do with the attitude error: a
measurement that depends on this point alone then concerns one of the two filters alone, and neither has to guess
what it shares with the other. For ranges it is the radio (so Parikh et al., eq. 4, estimate rho_ij, the radio's place,
not the centre of mass); for pictures it is the middle of the markers, seen as a point of the body. With the lever l of
that point, and its velocity w = rate x l against the centre of mass,

    dp = drho + R [l]x theta,    dv = ds + R [w]x theta,    cov((drho, ds), theta) = 0

says the whole joint covariance, cross terms included.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.quaternions import Triple, rotation_of, turned
from companion.geometry.rotations import skew

POSITION, VELOCITY, ATTITUDE, BIAS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
_EYE3 = np.eye(3)
_EYE6 = np.eye(6)
_NEW_RATE = 0.005  # [rad/s] a smaller change of the turn rate is the gyro's noise, and would add up


class Step(NamedTuple):
    """What happens between two instants."""

    turn_time: float  # [s] the attitude moves on by it
    rate: Triple  # [rad/s] in d, all the time
    time: float  # [s] position and velocity move on by it, 0: not yet
    c_from_d: Array  # (3, 3) at the end
    acceleration: Array  # (3,) [m/s^2] commanded, in d
    acceleration_density: float  # [m^2/s^3] of the white acceleration


class Noise(NamedTuple):
    """Densities of what drives the attitude error, and how long it misdirects thrust."""

    gyro: float  # [rad^2/s]
    bias: float  # [rad^2/s^3]
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
        transition[ATTITUDE, ATTITUDE] = _turn_back(step.rate, dt)
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
    """Two covariances: (6, 6) of a body point's place and velocity, (3, 3) of the attitude, (6, 6) with bias."""

    translation: Array
    rotation: Array
    lever: Array  # (3,) [m] of the point, in d
    swing: Triple  # [m/s] in d, its velocity against the centre of mass

    def predicted(self, step: Step, noise: Noise) -> Tandem:
        """Move on by a step."""
        rotation, translation, swing = self.rotation, self.translation, self.swing
        if step.turn_time > 0.0:
            transition = _turn_back(step.rate, step.turn_time)
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
            driven, swing = self._driven(step, noise)
            translation += driven
        return Tandem(translation, rotation, self.lever, swing)

    def _driven(self, step: Step, noise: Noise) -> tuple[Array, Triple]:
        """Process noise (6, 6), and the swing from now on.

        White acceleration; thrust in a wrong direction; the gyro noise, which moves the point; where the turn rate
        changes, the attitude error that acts on the point's velocity. A whole change acts as one: its parts are not
        independent, so variances grow with the square of the whole.
        """
        theta = max(self.rotation[0, 0], self.rotation[1, 1], self.rotation[2, 2])
        sideways = 2.0 * noise.burst_time * theta * float(step.acceleration @ step.acceleration)
        driven = _wander(step.time, step.acceleration_density + sideways)
        size = float(self.lever @ self.lever)
        swing, change = swing_of(step.rate, self.lever), 0.0
        if _squared(swing, self.swing) > _NEW_RATE**2 * size:
            change = theta * abs(_squared(swing) - _squared(self.swing))
        else:
            swing = self.swing
        for k in range(3):
            driven[k, k] += step.time * noise.gyro * size
            driven[k + 3, k + 3] += change
        return driven, swing

    def joint(self, c_from_d: Array) -> Array:
        """Give the joint covariance, cross terms included."""
        size = 6 + len(self.rotation)
        matrix = np.zeros((size, size))
        arms = _arms(c_from_d, self.lever, self.swing)
        cross = arms @ self.rotation[:3]
        matrix[:6, :6] = self.translation + cross[:, :3] @ arms.T
        matrix[6:, 6:] = self.rotation
        matrix[:6, 6:] = cross
        matrix[6:, :6] = cross.T
        return matrix


Covariance = Compounded | Tandem


def split(joint: Array, c_from_d: Array, lever: Array, rate: Triple) -> Tandem:
    """Part a joint covariance at a body point; what the two still share there is dropped.

    Args:
        joint: (9, 9) or (12, 12).
        c_from_d: (3, 3).
        lever: (3,) [m] of the point, in d.
        rate: [rad/s] of the body, in d.
    """
    swing = swing_of(rate, lever)
    arms = _arms(c_from_d, lever, swing)
    shared = arms @ joint[ATTITUDE, :6]
    translation = joint[:6, :6] - shared - shared.T + arms @ joint[ATTITUDE, ATTITUDE] @ arms.T
    return Tandem(translation, joint[6:, 6:].copy(), lever, swing)


def swing_of(rate: Triple, lever: Array) -> Triple:
    """Give the velocity [m/s] in d of a body point (3,) [m] against the centre of mass: `rate x lever`."""
    u, v, w = rate
    x, y, z = lever.tolist()
    return v * z - w * y, w * x - u * z, u * y - v * x


def _turn_back(rate: Triple, dt: float) -> Array:
    """Give the transition (3, 3) of an attitude error in a frame that turns at `rate` [rad/s] for `dt` [s]."""
    return rotation_of(turned((1.0, 0.0, 0.0, 0.0), (-dt * rate[0], -dt * rate[1], -dt * rate[2])))


def _arms(c_from_d: Array, lever: Array, swing: Triple) -> Array:
    """Give (6, 3): what an attitude error does to the centre of mass, the point's place and velocity being right."""
    arms = np.empty((6, 3))
    arms[POSITION] = c_from_d @ skew(lever)
    arms[VELOCITY] = c_from_d @ skew(np.array(swing))
    return arms


def _squared(a: Triple, b: Triple = (0.0, 0.0, 0.0)) -> float:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


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
