"""CubeSats and worlds without errors, and a controller that sees the truth, for the tests of the docking simulator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from sitl_stub.cubesat.as_built import PlacedTarget
from sitl_stub.cubesat.rotation import matrix_of
from sitl_stub.cubesat.simulation import CubesatSimulation, CubesatTruth
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld
from sitl_stub.vehicle.attitude_control import conjugate, multiply

VEHICLE = CubesatVehicle.load()
DOCKING = DockingWorld.load("docking")
SURVEYED = DockingWorld.load("docking_surveyed")
NONE = (0.0,) * 10


def as_designed(vehicle: CubesatVehicle = VEHICLE) -> CubesatVehicle:
    """Build the vehicle exactly as its file says."""
    exact = replace(vehicle.as_built, thrust_std=0.0, direction_std=0.0, mass_std=0.0, mass_centre_std=0.0)
    return replace(vehicle, as_built=exact)


def calm(world: DockingWorld = DOCKING, **start: object) -> DockingWorld:
    """Start the chaser exactly where the file says, or as `start` says, with nothing that pushes it."""
    quiet = {"position_std": 0.0, "attitude_std": 0.0, "residual_acceleration": 0.0}
    return replace(world, chaser=replace(world.chaser, **{**quiet, **start}))


def without_noise(vehicle: CubesatVehicle = VEHICLE) -> CubesatVehicle:
    """Give the vehicle with sensors that measure the truth."""
    return replace(
        vehicle,
        gyro=replace(vehicle.gyro, noise_density=0.0),
        radio=replace(vehicle.radio, noise_std=0.0),
        camera=replace(vehicle.camera, noise_std=0.0, pixel_step=0.0),
    )


def only(number: int, on_time: float) -> list[float]:
    """Give the on-times with which one nozzle opens."""
    return [on_time if number == k else 0.0 for k in range(10)]


class TruthController:
    """Proportional-derivative control on the true state along a path of two legs, with least squares over nozzles.

    First leg: to a place 0.3 m before the docked one, at 2 cm/s, turning to the docking attitude at 0.1 rad/s;
    second leg: straight in at 1 cm/s.
    """

    PERIOD, STAND_OFF = 0.1, 0.3
    SPEEDS, ACCELERATION, TURN_RATE = (0.02, 0.01), 0.004, 0.1
    BANDWIDTH, ATTITUDE_BANDWIDTH, DAMPING = 0.35, 0.5, 1.0

    def __init__(self, vehicle: CubesatVehicle, start: CubesatTruth, target: PlacedTarget, docked: Sequence[float]):
        normal = np.array(matrix_of(target.quaternion))[:, 2]
        end = np.array(docked)
        gate = end + self.STAND_OFF * normal
        self._legs = ((np.array(start.position), gate), (gate, end - 0.02 * normal))
        self._aim, self._start = target.quaternion, start.quaternion
        self._mass, self._inertia = vehicle.body.mass, np.array(vehicle.body.inertia)
        self._least, self._arm = vehicle.propulsion.on_time_min, 0.5 * vehicle.body.side
        self._wrench = wrench_per_second(vehicle)
        self._owed = np.zeros(len(vehicle.propulsion.nozzles))
        turn = multiply(conjugate(self._start), self._aim)
        self._angle = 2.0 * math.atan2(math.hypot(*turn[1:]), turn[0])
        self._axis = np.array(turn[1:]) / math.hypot(*turn[1:])

    def on_times(self, truth: CubesatTruth) -> list[float]:
        """Give the openings of the control period that begins now."""
        place, velocity, acceleration = self._reference(truth.t)
        error, drift = place - np.array(truth.position), velocity - np.array(truth.velocity)
        push = acceleration + self.BANDWIDTH**2 * error + 2.0 * self.DAMPING * self.BANDWIDTH * drift
        force = self._mass * np.array(matrix_of(truth.quaternion)).T @ np.clip(push, -0.012, 0.012)
        rate, wanted, attitude = np.array(truth.rate), *self._attitude(truth.t)
        off = np.array(multiply(conjugate(truth.quaternion), attitude))
        turn = self.ATTITUDE_BANDWIDTH**2 * 2.0 * off[1:] * np.sign(off[0])
        turn = turn + 2.0 * self.DAMPING * self.ATTITUDE_BANDWIDTH * (wanted - rate)
        impulse = self.PERIOD * np.concatenate([force, self._inertia @ turn / self._arm])
        times = nnls(self._wrench, impulse)[0]
        times *= min(1.0, self.PERIOD / max(times.max(), 1e-9))
        self._owed = self._owed + times  # openings too short to make add up until they are not
        opened = np.where(self._owed >= self._least, np.minimum(self._owed, self.PERIOD), 0.0)
        self._owed = np.minimum(self._owed - opened, self.PERIOD)
        return [float(t) for t in opened]

    def _reference(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        (a, b), (_, c) = self._legs
        first = self._duration(math.dist(a, b), self.SPEEDS[0])
        begin, end, speed, since = (a, b, self.SPEEDS[0], t) if t < first else (b, c, self.SPEEDS[1], t - first)
        length = math.dist(begin, end)
        ramp, total = speed / self.ACCELERATION, self._duration(length, speed)
        way = (end - begin) / length
        if since < ramp:
            return (
                begin + way * 0.5 * self.ACCELERATION * since**2,
                way * self.ACCELERATION * since,
                way * self.ACCELERATION,
            )
        if since < total - ramp:
            return begin + way * speed * (since - 0.5 * ramp), way * speed, 0.0 * way
        left = max(0.0, total - since)
        slowing = self.ACCELERATION if left > 0.0 else 0.0
        return end - way * 0.5 * self.ACCELERATION * left**2, way * self.ACCELERATION * left, -way * slowing

    def _duration(self, length: float, speed: float) -> float:
        return length / speed + speed / self.ACCELERATION

    def _attitude(self, t: float) -> tuple[np.ndarray, tuple[float, float, float, float]]:
        angle = min(self._angle, self.TURN_RATE * t)
        rate = self._axis * (self.TURN_RATE if angle < self._angle else 0.0)
        x, y, z = (math.sin(0.5 * angle) * self._axis).tolist()
        return rate, multiply(self._start, (math.cos(0.5 * angle), x, y, z))


def wrench_per_second(vehicle: CubesatVehicle) -> np.ndarray:
    """Give force [N] and torque over half a side [N] of each nozzle as designed: (6, 10)."""
    rows = []
    for nozzle in vehicle.propulsion.nozzles:
        force = vehicle.propulsion.thrust * np.array(nozzle.direction)
        rows.append(np.concatenate([force, np.cross(nozzle.position, force) / (0.5 * vehicle.body.side)]))
    return np.array(rows).T


def fly(vehicle: CubesatVehicle, world: DockingWorld, seed: int, limit: float = 300.0) -> CubesatSimulation:
    """Fly one docking with the controller that sees the truth."""
    simulation = CubesatSimulation(vehicle, world, seed)
    controller = TruthController(vehicle, simulation.truth, simulation.target, simulation.docked_place)
    period = 0
    while not simulation.ended and simulation.t < limit:
        period += 1
        simulation.command(simulation.t, controller.on_times(simulation.truth))
        simulation.advance(period / 10)
        simulation.readings()
    return simulation
