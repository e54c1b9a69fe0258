"""Where the pad is before it is seen: the proximity filter of Parikh et al., carried by a multirotor.

Frames of the filter: `c` is the pad (x along the landing heading, y right, z down), `d` the vehicle's body (forward,
right, down). What stands for the paper's sensors:

| paper | here |
|---|---|
| gyro | the autopilot's turn rates |
| commanded force | acceleration of the autopilot's velocity, held to its position |
| ranges | ranges to anchors around the pad, with the lever arm of the vehicle's radio; or none: odometry alone |
| markers in the picture | four points of the pad, where the target's own filter has fused a sighting |
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from companion.estimation.ownship import OwnshipReset
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.geometry.arrays import Array
from companion.geometry.rotations import (
    quaternion_from_rotation,
    rotation_about_z,
    rotation_from_quaternion,
    yaw_of,
)
from companion.geometry.transform import RigidTransform
from companion.messages.coarse import CoarseTarget
from companion.messages.ownship import OwnshipState
from companion.messages.proximity import FeatureReading, GyroReading, ProximityState, RangeReading
from companion.messages.target import TargetMeasurement

Positive = Annotated[float, Gt(0.0)]
_HALF_SIDE = 0.4  # [m] of the square on whose corners the pad's four points lie
_POINTS = np.array([(x, y, 0.0) for x in (-_HALF_SIDE, _HALF_SIDE) for y in (-_HALF_SIDE, _HALF_SIDE)])


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarsePadParameters:
    """How the autopilot's odometry errs, as the filter is told."""

    # [m/s^2/sqrt(Hz)] errors of the autopilot's acceleration against ranges, which see them within a second: its
    # velocity is wrong by 0.1 to 0.3 m/s, changing within 2 to 6 s
    acceleration_noise_ranging: Positive = 0.2
    # [m/s^2/sqrt(Hz)] the same without ranges: GNSS holds its position, so only slow drift adds up; 0.5 m in 15 s
    acceleration_noise_odometry: Positive = 0.015
    gyro_noise: Positive = 2e-3  # [rad/s/sqrt(Hz)] of turn rates that come 50 times a second, not 100
    position_gain: Annotated[float, Interval(gt=0.0, le=5.0)] = 1.0  # [1/s] with which velocity is held to position
    velocity_std: Positive = 0.02  # [m/s] at the start, standing
    tilt_std: Positive = 0.03  # [rad] of the autopilot's roll and pitch
    sighting_std: Positive = 0.05  # [m] of a point of the pad by one sighting: the errors of its points are alike
    gap_s: Positive = 0.3  # [s] between two odometry messages above which no acceleration is made of them


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveyedPad:
    """Where the pad is said to be, seen from where the vehicle stands before its first take-off."""

    position_ned: Array  # (3,) [m] of the landing point from the body origin of the standing vehicle
    yaw: float  # [rad] of its landing heading from north
    position_std: float  # [m] of each axis
    heading_std: float  # [rad]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RangingSetup:
    """The radios."""

    anchors: Array  # (N, 3) [m] in the pad's frame
    lever_arm: Array  # (3,) [m] of the vehicle's antenna: forward, right, down of the body origin
    std: float  # [m] of one range


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Place:
    """The pad in the autopilot's frame while the vehicle stands: what a filter starts from."""

    position_ned: Array  # (3,) [m]
    yaw: float  # [rad]
    covariance: Array  # (4, 4) of [north, east, down, yaw]


class CoarsePad:
    """Holds the filter while the vehicle is armed; before that the survey, after it where the pad was left.

    The survey counts from where the vehicle stands when it is armed first. Engaged in flight nothing is known.

    Args:
        survey: where the pad is said to be.
        ranging: the radios; None: odometry alone.
        parameters: noise.
    """

    def __init__(self, survey: SurveyedPad, ranging: RangingSetup | None, parameters: CoarsePadParameters) -> None:
        self._survey = survey
        self._by_ranges = ranging is not None
        self._p = parameters
        anchors = np.zeros((1, 3)) if ranging is None else ranging.anchors
        self._setup = ProximitySetup(
            anchors=anchors,
            lever_arm=np.zeros(3) if ranging is None else ranging.lever_arm,
            markers=_POINTS,
            c_from_t=RigidTransform(rotation=np.eye(3), translation=np.zeros(3)),
            d_from_cam=RigidTransform(rotation=np.eye(3), translation=np.zeros(3)),  # sightings are given in `d`
            mass=1.0,
            control_period=1.0,
        )
        self._noise = ProximityParameters(
            structure="compounded",  # the heading is known by the way flown: the two errors belong together
            gyro_noise=parameters.gyro_noise,
            range_std=0.02 if ranging is None else ranging.std,
            feature_std=parameters.sighting_std,
            acceleration_noise=(
                parameters.acceleration_noise_odometry if ranging is None else parameters.acceleration_noise_ranging
            ),
            force_error=0.0,  # there are no nozzles
            reopened_velocity_std=0.3,
        )
        self._flown = False
        self._place: _Place | None = None
        self._filter: ProximityFilter | None = None
        self._last: OwnshipState | None = None
        self._velocity = np.zeros(3)  # [m/s] held to the position
        self._reckoned = np.zeros(3)  # [m] its integral

    @property
    def by_ranges(self) -> bool:
        """Whether ranges are expected."""
        return self._by_ranges

    def add_ownship(self, state: OwnshipState, reset: OwnshipReset | None, *, standing: bool) -> None:
        """Take the next odometry message.

        Args:
            state: of the vehicle.
            reset: of the autopilot's estimator, which came with it.
            standing: the vehicle is disarmed.
        """
        if self._filter is not None:
            self._follow(self._filter, state, jumped=reset is not None)
            if standing:
                self._place, self._filter = self._left(state), None
        elif standing and not self._flown:
            self._place = self._surveyed(state)
        elif self._place is not None:
            if reset is not None:
                self._place = _moved(self._place, reset)
            if not standing:
                self._begin(state, self._place)
        self._last = state

    def add_ranges(self, readings: Sequence[RangeReading]) -> None:
        """Fuse ranges, each at its time."""
        if self._filter is not None and self._by_ranges:
            for reading in readings:
                self._filter.range(reading)

    def add_sighting(self, measured: TargetMeasurement, ownship: OwnshipState) -> None:
        """Fuse a sighting that the target's own filter has fused; `ownship` is that of its time."""
        if self._filter is None:
            return
        level_from_frd = rotation_about_z(-ownship.yaw) @ ownship.ned_from_frd
        in_level = _POINTS @ rotation_about_z(measured.heading).T + measured.position_level
        markers = tuple(range(len(_POINTS)))
        self._filter.features(FeatureReading(t=measured.t, markers=markers, positions=in_level @ level_from_frd))

    def at(self, ownship: OwnshipState) -> CoarseTarget | None:
        """Give the pad at the time of `ownship`; None where the vehicle has not been seen standing."""
        if self._place is None:
            return None
        if self._filter is None:
            return CoarseTarget(
                t=ownship.t,
                position_ned=self._place.position_ned,
                yaw=self._place.yaw,
                covariance=self._place.covariance,
                mahalanobis=0.0,
                t_range=-math.inf,
                by_ranges=self._by_ranges,
            )
        return self._target(self._filter.state(ownship.t), ownship)

    def _surveyed(self, state: OwnshipState) -> _Place:
        s = self._survey
        return _Place(
            position_ned=state.position_ned + s.position_ned,
            yaw=s.yaw,
            covariance=np.diag([s.position_std**2] * 3 + [s.heading_std**2]),
        )

    def _left(self, state: OwnshipState) -> _Place:
        """Keep where the pad is as the vehicle has come to stand."""
        target = self.at(state)
        if target is None:
            return self._surveyed(state)
        return _Place(position_ned=target.position_ned, yaw=target.yaw, covariance=target.covariance)

    def _begin(self, state: OwnshipState, place: _Place) -> None:
        """Start the filter from a vehicle at rest.

            p = Rz(-psi) (v - m),    dp = -Rz(-psi) dm - z x p dpsi,    dphi_z = -dpsi

        with the vehicle v and the pad m in ned and the pad's heading psi: an error of the heading turns the whole
        picture about the pad, which is no error of where the pad is.
        """
        pad_from_ned = rotation_about_z(-place.yaw)
        position = pad_from_ned @ (state.position_ned - place.position_ned)
        c_from_d = pad_from_ned @ state.ned_from_frd
        errors = np.zeros((9, 9))  # columns: north, east, down, heading of the pad; velocity; tilt
        errors[0:3, 0:3] = -pad_from_ned
        errors[0:3, 3] = (position[1], -position[0], 0.0)
        errors[3:6, 4:7] = np.eye(3)
        errors[6:9, 3] = -c_from_d[2]
        errors[6:9, 7:9] = c_from_d[:2].T
        spread = np.zeros((9, 9))
        spread[:4, :4] = place.covariance
        spread[4:7, 4:7] = self._p.velocity_std**2 * np.eye(3)
        spread[7:9, 7:9] = self._p.tilt_std**2 * np.eye(2)
        initial = ProximityState(
            t=state.t,
            position=position,
            velocity=np.zeros(3),
            quaternion=quaternion_from_rotation(c_from_d),
            rate=state.angular_velocity_frd,
            covariance=errors @ spread @ errors.T,
            mahalanobis=0.0,
            t_vision=-math.inf,
            t_range=-math.inf,
        )
        self._filter, self._flown = ProximityFilter(self._setup, self._noise, initial), True
        self._velocity, self._reckoned = np.zeros(3), state.position_ned.copy()

    def _follow(self, proximity: ProximityFilter, state: OwnshipState, *, jumped: bool) -> None:
        """Let the filter move as the autopilot says that the vehicle moves."""
        last = self._last
        dt = math.inf if last is None else state.t - last.t
        if last is None or jumped or dt > self._p.gap_s:  # velocities before and after cannot be compared
            self._velocity, self._reckoned = state.velocity_ned.copy(), state.position_ned.copy()
            proximity.gyro(GyroReading(t=state.t, rate=state.angular_velocity_frd))
            return
        velocity = state.velocity_ned + self._p.position_gain * (state.position_ned - self._reckoned)
        acceleration = (velocity - self._velocity) / dt
        self._reckoned = self._reckoned + 0.5 * dt * (velocity + self._velocity)
        self._velocity = velocity
        proximity.accelerate(last.t, acceleration @ last.ned_from_frd, dt)
        proximity.gyro(GyroReading(t=state.t, rate=state.angular_velocity_frd))

    def _target(self, state: ProximityState, ownship: OwnshipState) -> CoarseTarget:
        """Take the filter's state into the autopilot's frame: the pad is level, so by the heading alone.

        m = v - Rz(psi) p,    psi = heading of the vehicle in ned minus that in c.
        """
        c_from_d = rotation_from_quaternion(state.quaternion)
        yaw = ownship.yaw - yaw_of(c_from_d)
        ned_from_pad = rotation_about_z(yaw)
        offset = ned_from_pad @ state.position
        jacobian = np.zeros((4, 9))
        jacobian[:3, 0:3] = -ned_from_pad
        turned = np.array([-offset[1], offset[0], 0.0])  # z x offset: what a turn of the pad does to it
        jacobian[:3, 6:9] = np.outer(turned, c_from_d[2])
        jacobian[3, 6:9] = -c_from_d[2]
        return CoarseTarget(
            t=ownship.t,
            position_ned=ownship.position_ned - offset,
            yaw=yaw,
            covariance=jacobian @ state.covariance @ jacobian.T,
            mahalanobis=state.mahalanobis,
            t_range=state.t_range,
            by_ranges=self._by_ranges,
        )


def _moved(place: _Place, reset: OwnshipReset) -> _Place:
    turn = np.eye(4)
    turn[:3, :3] = reset.rotation
    return _Place(
        position_ned=reset.position(place.position_ned),
        yaw=place.yaw + reset.yaw,
        covariance=turn @ place.covariance @ turn.T,
    )
