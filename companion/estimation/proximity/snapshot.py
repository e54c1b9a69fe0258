"""What the filter knows at one instant, and how it moves on. Never changed: a step makes a new one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from companion.estimation.proximity.covariance import BIAS, Compounded, Covariance, Noise, Step, split
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.geometry.arrays import Array
from companion.geometry.quaternions import Quaternion, Triple, rotation_of, turned
from companion.messages.proximity import ProximityState

_COAST = np.zeros(3)
GYRO_GAP = 0.05  # [s] between two readings of the gyro; over a longer gap no straight line is drawn


class Refusals(NamedTuple):
    """Readings of one sensor of which too many were rejected."""

    since: float  # [s] the first of them
    excess: float  # rejected ones, less half of the accepted ones


NO_REFUSALS = Refusals(math.inf, 0.0)


class Snapshot(NamedTuple):
    """The filter's state after a reading."""

    t: float  # [s] of the attitude
    t_translation: float  # [s] of position and velocity; a tandem filter leaves them behind while only the gyro speaks
    position: Array  # (3,) [m] of the centre of mass, in c
    velocity: Array  # (3,) [m/s], in c
    quaternion: Quaternion  # c_from_d
    rate: Triple  # [rad/s] newest reading of the gyro, in d
    t_rate: float  # [s] of it, -inf before the first
    bias: Triple  # [rad/s] of the gyro, in d
    acceleration: Array  # (3,) [m/s^2] commanded, in d
    t_coast: float  # [s] when the command ends
    covariance: Covariance
    t_range: float = -math.inf  # [s] of the newest fused range
    t_vision: float = -math.inf  # [s] of the newest fused picture
    t_pose: float = -math.inf  # [s] of the newest picture that gave the whole pose (three markers)
    range_refusals: Refusals = NO_REFUSALS
    vision_refusals: Refusals = NO_REFUSALS
    reopenings: int = 0  # how often a gate had locked itself out

    @property
    def true_rate(self) -> Triple:
        """Turn rate [rad/s] in d without the estimated bias."""
        return self.rate[0] - self.bias[0], self.rate[1] - self.bias[1], self.rate[2] - self.bias[2]


class Mover:
    """Moves snapshots on in time. Holds constants only."""

    def __init__(self, setup: ProximitySetup, parameters: ProximityParameters) -> None:
        self._mass = setup.mass
        self._period = setup.control_period
        self._floor = parameters.acceleration_noise**2
        self._share = 2.0 * parameters.force_error_time * parameters.force_error**2
        self._noise = Noise(
            parameters.gyro_noise**2,
            parameters.gyro_bias_noise**2,
            parameters.force_error_time,
        )

    def first(self, state: ProximityState, setup: ProximitySetup, parameters: ProximityParameters) -> Snapshot:
        """Give the snapshot of an initial estimate; a tandem filter drops cross terms that it cannot express."""
        joint = np.array(state.covariance)
        if parameters.gyro_bias:
            joint = np.zeros((BIAS.stop, BIAS.stop))
            joint[:9, :9] = state.covariance
            joint[BIAS, BIAS] = parameters.gyro_bias_std**2 * np.eye(3)
        w, x, y, z = (float(number) for number in state.quaternion / np.linalg.norm(state.quaternion))
        together = parameters.structure == "compounded"
        return Snapshot(
            t=state.t,
            t_translation=state.t,
            position=np.array(state.position),
            velocity=np.array(state.velocity),
            quaternion=(w, x, y, z),
            rate=_triple(state.rate),
            t_rate=-math.inf,
            bias=(0.0, 0.0, 0.0),
            acceleration=_COAST,
            t_coast=math.inf,
            covariance=Compounded(joint)
            if together
            else split(joint, rotation_of((w, x, y, z)), setup.lever_arm, _triple(state.rate)),
        )

    def command(self, s: Snapshot, t: float, force: Array) -> Snapshot:
        """Let the mean `force` (3,) [N] in d act for one control period."""
        return self.accelerated(s, t, force / self._mass, self._period)

    def accelerated(self, s: Snapshot, t: float, acceleration: Array, duration: float) -> Snapshot:
        """Let an `acceleration` (3,) [m/s^2] in d act from `t` for `duration` [s]."""
        return self.moved(s, t)._replace(acceleration=acceleration, t_coast=t + duration)

    def gyro(self, s: Snapshot, t: float, rate: Triple) -> Snapshot:
        """Take a reading [rad/s] as the rate from now on, and straighten the past: eq. 3, trapezoidal.

        The interval was crossed with its first rate; half of the change makes it the mean of both.
        """
        s = self.moved(s, t, attitude_only=not isinstance(s.covariance, Compounded))
        quaternion, gap = s.quaternion, t - s.t_rate
        if gap < GYRO_GAP:
            half = 0.5 * gap
            change = (half * (rate[0] - s.rate[0]), half * (rate[1] - s.rate[1]), half * (rate[2] - s.rate[2]))
            quaternion = turned(quaternion, change)
        return s._replace(quaternion=quaternion, rate=rate, t_rate=t)

    def moved(self, s: Snapshot, t: float, *, attitude_only: bool = False) -> Snapshot:
        """Move on to `t` [s], not before the snapshot's; a command that ends on the way ends at its time."""
        if s.t_coast <= t:
            s = self._moved(s, s.t_coast, attitude_only=False)._replace(acceleration=_COAST, t_coast=math.inf)
        return self._moved(s, t, attitude_only=attitude_only)

    def _moved(self, s: Snapshot, t: float, *, attitude_only: bool) -> Snapshot:
        turn_time = t - s.t
        time = 0.0 if attitude_only else t - s.t_translation
        if turn_time <= 0.0 and time <= 0.0:
            return s
        rate = s.true_rate
        quaternion = turned(s.quaternion, (rate[0] * turn_time, rate[1] * turn_time, rate[2] * turn_time))
        position, velocity, t_translation, thrust = s.position, s.velocity, s.t_translation, s.acceleration
        c_from_d = _EYE3
        density = self._floor
        if time > 0.0:
            if s.t_coast < math.inf:
                c_from_d = rotation_of(quaternion)
                density += self._share * float(thrust @ thrust)
                gain = time * (c_from_d @ thrust)
                position = position + time * (velocity + 0.5 * gain)
                velocity = velocity + gain
            else:
                position = position + time * velocity
            t_translation = t
        step = Step(turn_time, rate, time, c_from_d, thrust, density)
        return s._replace(
            t=t,
            t_translation=t_translation,
            position=position,
            velocity=velocity,
            quaternion=quaternion,
            covariance=s.covariance.predicted(step, self._noise),
        )


_EYE3 = np.eye(3)


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z
