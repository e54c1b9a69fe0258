"""One docking in virtual time: the true motion of the chaser, its sensors, and the contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sitl_stub.cubesat.as_built import (
    BuiltVehicle,
    InitialEstimate,
    PlacedTarget,
    build_vehicle,
    draw_initial_estimate,
    draw_start,
    place_anchors,
    place_target,
)
from sitl_stub.cubesat.body import FreeBody
from sitl_stub.cubesat.contact import Contact, ContactWatch, Pose
from sitl_stub.cubesat.nozzles import SAME_TIME, Nozzles
from sitl_stub.cubesat.readings import Mailbox, RangeOutlier, Reading
from sitl_stub.cubesat.sensors import Camera, Gyro, Radio, Sensor
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld
from sitl_stub.truth import Quaternion, Vector

STEPS_PER_SECOND = 100
"""The integration ends a step at each hundredth of a second, at each edge of a valve and at each reading."""
_STREAMS = (
    "vehicle",
    "anchors",
    "target",
    "start",
    "initial_estimate",
    "gyro",
    "radio",
    "radio_faults",
    "camera",
    "camera_faults",
)
"""Dice of their own, in the order in which they are spawned from the seed: new ones go to the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CubesatTruth:
    """True state at one instant."""

    t: float
    """[s]"""
    position: Vector
    """Centre of the cube [m], in c."""
    velocity: Vector
    """[m/s], in c."""
    quaternion: Quaternion
    """c_from_d"""
    rate: Vector
    """Of d against c [rad/s], in d."""
    impulse_ns: float
    """Sum over the nozzles of true thrust times open time so far, until the contact [N s]."""
    openings: int
    """How often a valve has opened."""
    contact: Contact | None
    """How the chaser touched the target; None: it has not."""


class CubesatSimulation:
    """The truth of one run; `vehicle` and `world` are what the chaser is told, `seed` says how the truth differs.

    A run ends with a contact: the chaser stays where it touched, docked or not, its valves shut; the sensors go on.

    Attributes:
        t: simulation time [s], from 0.
        built: the vehicle as built.
        anchors: where the anchors really stand [m], in c.
        target: where the target really stands.
    """

    def __init__(self, vehicle: CubesatVehicle, world: DockingWorld, seed: int) -> None:
        spawned = np.random.SeedSequence(seed).spawn(len(_STREAMS))
        dice = {name: np.random.default_rng(sequence) for name, sequence in zip(_STREAMS, spawned, strict=True)}
        self.t = 0.0
        self.built: BuiltVehicle = build_vehicle(vehicle, dice["vehicle"])
        self.anchors: tuple[Vector, ...] = place_anchors(world, dice["anchors"])
        self.target: PlacedTarget = place_target(world, dice["target"])
        start = draw_start(world, dice["start"])
        self._initial_estimate = draw_initial_estimate(world, start, dice["initial_estimate"])
        self._body = FreeBody(
            mass=self.built.mass,
            inertia=self.built.inertia,
            mass_centre=self.built.mass_centre,
            position=start.position,
            quaternion=start.quaternion,
            residual_acceleration=start.residual_acceleration,
        )
        self._nozzles = Nozzles(vehicle.propulsion, self.built.nozzles)
        self._watch = ContactWatch(self.target, world.target.side, vehicle.body.side, world.docked)
        self._radio = Radio(vehicle.radio, world.faults, self.anchors, dice["radio"], dice["radio_faults"])
        camera = Camera(
            vehicle.camera,
            world.faults,
            self.target,
            world.target.markers,
            0.5 * world.target.side,
            dice["camera"],
            dice["camera_faults"],
        )
        switches: list[tuple[bool, Sensor]] = [
            (vehicle.gyro.enabled, Gyro(vehicle.gyro, dice["gyro"])),
            (vehicle.radio.enabled, self._radio),
            (vehicle.camera.enabled, camera),
        ]
        self._sensors = [(number, sensor) for number, (enabled, sensor) in enumerate(switches) if enabled]
        self._taken = [0] * len(switches)
        self._next_reading = self._earliest_reading()
        self._mailbox = Mailbox()
        self._step = 0
        self._impulse = 0.0
        self._contact: Contact | None = None
        self._near: Pose | None = None

    @property
    def truth(self) -> CubesatTruth:
        """The true state now."""
        body = self._body
        return CubesatTruth(
            t=self.t,
            position=body.position,
            velocity=body.velocity,
            quaternion=body.quaternion,
            rate=body.rate,
            impulse_ns=self._impulse,
            openings=self._nozzles.openings,
            contact=self._contact,
        )

    @property
    def ended(self) -> bool:
        """Whether the chaser has touched the target."""
        return self._contact is not None

    @property
    def docked_place(self) -> Vector:
        """True place of the centre of the chaser's cube when it has docked [m], in c."""
        return self._watch.docked_place

    @property
    def outliers(self) -> tuple[RangeOutlier, ...]:
        """The ranges so far that a reflection made too long; for scoring, never for the chaser."""
        return tuple(self._radio.outliers)

    def initial_estimate(self) -> InitialEstimate:
        """Give what the chaser is told about its start."""
        return self._initial_estimate

    def command(self, t: float, on_times: Sequence[float]) -> None:
        """Take the openings of the control period that begins now, at `t` [s]; after a contact they do nothing.

        Args:
            t: the simulation's time, a control period or more after the last command.
            on_times: of each nozzle [s], in the vehicle file's order, 0 to the control period; an opening shorter than
                the least on-time is not made.

        Raises:
            ValueError: a number of nozzles, an on-time or a time that cannot be.
        """
        if abs(t - self.t) > SAME_TIME:
            raise ValueError(f"command for {t:.6f} s at {self.t:.6f} s: commands begin at the simulation's time")
        if self._contact is None:
            self._nozzles.command(self.t, on_times)
            self._nozzles.switch(self.t)

    def advance(self, until: float) -> None:
        """Go on to the time `until` [s]; raises ValueError where that is over."""
        if until < self.t - SAME_TIME:
            raise ValueError(f"cannot advance to {until:.6f} s: it is {self.t:.6f} s already")
        while self.t < until - SAME_TIME:
            tick = (self._step + 1) / STEPS_PER_SECOND
            t = min(until, tick, self._nozzles.next_edge, self._next_reading)
            if self._contact is None:
                self._move(t)
            self.t = t
            if t >= tick - SAME_TIME:
                self._step += 1
            if t >= self._nozzles.next_edge - SAME_TIME:
                self._nozzles.switch(t)
            if t >= self._next_reading - SAME_TIME:
                self._take_readings(t)

    def readings(self) -> tuple[Reading, ...]:
        """Take the readings that have been delivered since the last call, in the order of delivery."""
        return self._mailbox.collect(self.t)

    def _move(self, t: float) -> None:
        body, nozzles = self._body, self._nozzles
        body.step(t - self.t, nozzles.force, nozzles.torque)
        until = t
        position = body.position
        if self._watch.near(position):
            pose = Pose(t=t, position=position, velocity=body.velocity, quaternion=body.quaternion, rate=body.rate)
            touched = self._watch.look(self._near or pose, pose)
            self._near = pose
            if touched is not None:
                self._contact, pose = touched
                until = pose.t
                body.hold(pose.position, pose.quaternion)
        else:
            self._near = None
        self._impulse += nozzles.thrust * (until - self.t)
        if self._contact is not None:
            nozzles.stop()

    def _take_readings(self, t: float) -> None:
        for number, sensor in self._sensors:
            if (self._taken[number] + 1) / sensor.rate <= t + SAME_TIME:
                self._taken[number] += 1
                reading = sensor.take(t, self._body)
                if reading is not None:
                    self._mailbox.post(t + sensor.latency, number, reading)
        self._next_reading = self._earliest_reading()

    def _earliest_reading(self) -> float:
        times = ((self._taken[number] + 1) / sensor.rate for number, sensor in self._sensors)
        return min(times, default=math.inf)
