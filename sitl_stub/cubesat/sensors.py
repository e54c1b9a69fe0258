"""Gyroscope, ranging radio and camera: each takes its reading from the true motion, with dice of its own.

A sensor draws the same dice whatever it sees, so that one that is lost or hidden does not shift its later readings.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from sitl_stub.cubesat.as_built import PlacedTarget, scattered
from sitl_stub.cubesat.readings import GyroReading, MarkerReading, RangeOutlier, RangeReading, Reading
from sitl_stub.cubesat.rotation import Matrix, dot, matrix_of, minus, plus, turned, turned_back
from sitl_stub.cubesat.vehicle import CameraFile, GyroFile, RadioFile
from sitl_stub.cubesat.world import FaultsFile
from sitl_stub.truth import Quaternion, Vector


class Motion(Protocol):
    """What a sensor can see of the body."""

    quaternion: Quaternion
    """c_from_d"""
    rate: Vector
    """[rad/s], in d."""

    @property
    def position(self) -> Vector:
        """Centre of the cube [m], in c."""


class Sensor(Protocol):
    """One sensor."""

    rate: float
    """Readings per second."""
    latency: float
    """[s]"""

    def take(self, t: float, body: Motion) -> Reading | None:
        """Take the reading of `t` [s]; None: there is none."""


class Gyro:
    """White noise, and a constant bias."""

    def __init__(self, parameters: GyroFile, dice: np.random.Generator) -> None:
        self.rate, self.latency = parameters.rate, parameters.latency
        self.bias = scattered(dice, parameters.bias_std)
        """[rad/s], in d."""
        self._std = parameters.noise_std
        self._dice = dice

    def take(self, t: float, body: Motion) -> GyroReading:
        """See `Sensor.take`."""
        return GyroReading(t=t, rate=plus(plus(body.rate, self.bias), scattered(self._dice, self._std)))


class Radio:
    """Ranges to the anchors in turn: white noise, reflections that are too long, times without any."""

    def __init__(
        self,
        parameters: RadioFile,
        faults: FaultsFile,
        anchors: tuple[Vector, ...],
        dice: np.random.Generator,
        faults_dice: np.random.Generator,
    ) -> None:
        self.rate, self.latency = parameters.rate, parameters.latency
        self.outliers: list[RangeOutlier] = []
        self._position, self._std = parameters.position, parameters.noise_std
        self._faults, self._anchors = faults, anchors
        self._dice, self._faults_dice = dice, faults_dice
        self._turn = 0
        self._lost_from = self._next_loss(0.0)

    def _next_loss(self, t: float) -> float:
        interval = self._faults.dropout_interval
        return t + float(self._faults_dice.exponential(interval)) if interval > 0.0 else math.inf

    def _lost(self, t: float) -> bool:
        if t >= self._lost_from + self._faults.dropout:
            self._lost_from = self._next_loss(t)
        return t >= self._lost_from

    def take(self, t: float, body: Motion) -> RangeReading | None:
        """See `Sensor.take`."""
        faults, anchor = self._faults, self._turn
        self._turn = (anchor + 1) % len(self._anchors)
        noise = self._std * float(self._dice.standard_normal())
        reflected = float(self._dice.random()) < faults.outlier_share
        excess = faults.outlier.draw(self._dice)
        if self._lost(t):
            return None
        antenna = plus(body.position, turned(matrix_of(body.quaternion), self._position))
        distance = math.dist(antenna, self._anchors[anchor]) + noise
        if reflected:
            self.outliers.append(RangeOutlier(t=t, anchor=anchor, excess=excess))
            distance += excess
        return RangeReading(t=t, anchor=anchor, range=max(0.0, distance))


class Camera:
    """Places of the target's markers in the camera's frame (Parikh et al., section III).

    A marker is projected by a pinhole to its place in the picture, found there to a fraction of a pixel, and turned
    back into a vector of its true depth; then white noise is added to each component.
    """

    def __init__(
        self,
        parameters: CameraFile,
        faults: FaultsFile,
        target: PlacedTarget,
        markers: tuple[Vector, ...],
        half_side: float,
        dice: np.random.Generator,
        faults_dice: np.random.Generator,
    ) -> None:
        self.rate, self.latency = parameters.rate, parameters.latency
        self._parameters = parameters
        self._lost_share = faults.lost_pictures
        self._dice, self._faults_dice = dice, faults_dice
        rows: Matrix = matrix_of(target.quaternion)
        self._normal = turned(rows, (0.0, 0.0, 1.0))
        self._face = plus(target.position, self._normal, half_side)
        self._markers = tuple(plus(target.position, turned(rows, marker)) for marker in markers)
        self._cosine = math.cos(parameters.half_angle)
        self._facing = math.cos(parameters.face_turned_max)

    def take(self, t: float, body: Motion) -> MarkerReading | None:
        """See `Sensor.take`; None as well where no marker is in sight."""
        noise = (self._parameters.noise_std * self._dice.standard_normal(3 * len(self._markers))).tolist()
        if float(self._faults_dice.random()) < self._lost_share:
            return None
        seen = self.in_sight(body.position, body.quaternion)
        if not seen:
            return None
        return MarkerReading(
            t=t,
            markers=tuple(number for number, _ in seen),
            positions=tuple(
                plus(self._by_picture(place), (noise[3 * number], noise[3 * number + 1], noise[3 * number + 2]))
                for number, place in seen
            ),
        )

    def in_sight(self, position: Vector, quaternion: Quaternion) -> list[tuple[int, Vector]]:
        """Give number and place (in cam [m], exact) of each marker in sight.

        The docking face's centre must be inside the cone of sight, not too near nor too far, the face turned to the
        camera; and each marker must be inside the cone itself.
        """
        parameters = self._parameters
        rows = matrix_of(quaternion)
        eye = plus(position, turned(rows, parameters.position))
        sight = minus(self._face, eye)
        distance = math.hypot(*sight)
        if not parameters.near < distance <= parameters.far:
            return []
        if -dot(self._normal, sight) < self._facing * distance:
            return []
        if not self._in_cone(self._in_cam(rows, sight)):
            return []
        places = ((number, self._in_cam(rows, minus(marker, eye))) for number, marker in enumerate(self._markers))
        return [(number, place) for number, place in places if self._in_cone(place)]

    def _in_cam(self, c_from_d: Matrix, vector: Vector) -> Vector:
        return turned_back(self._parameters.d_from_cam, turned_back(c_from_d, vector))

    def _in_cone(self, place: Vector) -> bool:
        return place[2] >= self._cosine * math.hypot(*place)

    def _by_picture(self, place: Vector) -> Vector:
        """To the picture and back."""
        step = self._parameters.pixel_step
        if step == 0.0:
            return place
        x, y, depth = place
        pixels = self._parameters.focal_length / depth
        column, row = round(x * pixels / step) * step, round(y * pixels / step) * step
        return (column / pixels, row / pixels, depth)
