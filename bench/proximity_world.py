"""A chaser that docks, and what its sensors read: a small truth for the proximity filter's benchmarks and tests.

The chaser flies along the line from its start to a place in front of the target at 0.02 m/s, turns to the docking
attitude at 0.1 rad/s on its way, and drifts on. Its acceleration is the commanded one plus white noise of the
filter's own densities, or (`nozzle_errors`) the scenario's errors that stay the same during a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.geometry.arrays import Array
from companion.geometry.rotations import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    vector_from_rotation,
)
from companion.geometry.transform import RigidTransform
from companion.messages.proximity import FeatureReading, GyroReading, NozzlePulses, ProximityState, RangeReading

_X = np.array([1.0, 0.0, 0.0])
_Z = np.array([0.0, 0.0, 1.0])
DOCKING = rotation_from_vector(0.5 * math.pi * _X) @ rotation_from_vector(0.5 * math.pi * _Z)  # c_from_t
SETUP = ProximitySetup(
    anchors=np.array([[1.0, -0.2, 0.5], [1.0, 0.2, -0.5], [-1.0, 0.2, -0.5], [-1.0, -0.2, 0.5]]),
    lever_arm=np.array([0.05, 0.05, 0.0]),
    markers=np.array(
        [
            [0.035, 0.035, 0.05],
            [-0.035, 0.035, 0.05],
            [-0.035, -0.035, 0.05],
            [0.035, -0.035, 0.05],
            [0.012, 0.0, 0.05],
            [0.0, -0.008, 0.05],
        ]
    ),
    c_from_t=RigidTransform(rotation=DOCKING, translation=np.array([1.0, 2.0, 1.0])),
    d_from_cam=RigidTransform(rotation=np.diag([1.0, -1.0, -1.0]), translation=np.array([0.0, 0.0, -0.05])),
    mass=2.0,
    control_period=0.1,
)
POSITION_STD, VELOCITY_STD, ATTITUDE_STD = 0.05, 0.002, math.radians(1.0)
START_COVARIANCE = np.diag([POSITION_STD**2] * 3 + [VELOCITY_STD**2] * 3 + [ATTITUDE_STD**2] * 3)
SPEED, TURN_RATE, ACCELERATION = 0.02, 0.1, 0.008
RATE_OF_GYRO, RATE_OF_RANGES, RATE_OF_PICTURES = 100, 50, 20  # [1/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """How a run goes."""

    duration: float = 60.0  # [s]
    begin: tuple[float, float, float] = (0.2, 1.1, 0.2)  # [m] in c
    ends: tuple[float, float, float] = (1.0, 1.7, 1.0)  # [m] in c: in front of the docking face
    turn_from: float = 8.0  # [s]
    vision_from: float = 35.0  # [s]; math.inf: never
    outliers: float = 0.05  # share of the ranges that are too long by 0.15 to 1.0 m
    nozzle_errors: bool = False  # the scenario's, the same during the whole run, instead of white noise
    moving: bool = True


@dataclass(slots=True)
class Truth:
    t: float
    position: Array
    velocity: Array
    c_from_d: Array

    def errors_of(self, state: ProximityState) -> Array:
        """(9,): position, velocity, attitude error in d."""
        attitude = vector_from_rotation(rotation_from_quaternion(state.quaternion).T @ self.c_from_d)
        return np.concatenate([self.position - state.position, self.velocity - state.velocity, attitude])


@dataclass(slots=True)
class Arrival:
    """A reading on its way."""

    t: float  # [s] when it arrives
    reading: GyroReading | RangeReading | FeatureReading | NozzlePulses
    outlier: bool = False


Run = tuple[ProximityState, list[Truth], list[Arrival]]


def build(seed: int, world: World | None = None, parameters: ProximityParameters | None = None) -> Run:
    """Initial estimate, the truth at 100 Hz, and the readings in order of arrival."""
    world = world or World()
    parameters = parameters or ProximityParameters()
    rng = np.random.default_rng(seed)
    errors = np.sqrt(np.diag(START_COVARIANCE)) * rng.standard_normal(9)
    truth = Truth(0.0, np.array(world.begin), np.zeros(3), rotation_from_vector(0.035 * rng.standard_normal(3)))
    if not world.moving:
        truth = Truth(0.0, np.array(world.ends), np.zeros(3), DOCKING)
    initial = ProximityState(
        t=0.0,
        position=truth.position - errors[:3],
        velocity=truth.velocity - errors[3:6],
        quaternion=quaternion_from_rotation(truth.c_from_d @ rotation_from_vector(-errors[6:])),
        rate=np.zeros(3),
        covariance=START_COVARIANCE,
        mahalanobis=0.0,
        t_vision=-math.inf,
        t_range=-math.inf,
    )
    truths, arrivals = _fly(world, parameters, truth, rng)
    arrivals.sort(key=lambda arrival: arrival.t)
    return initial, truths, arrivals


def feed(
    run: Run,
    parameters: ProximityParameters,
    every: float,
    hear: Callable[[Arrival, object], None] | None = None,
) -> tuple[list[Truth], list[ProximityState], ProximityFilter]:
    """Give a run's readings to a filter as they arrive; the truth and the estimate at epochs `every` [s] apart."""
    initial, truths, arrivals = run
    estimator = ProximityFilter(SETUP, parameters, initial)
    states, seen = [], []
    pace = round(every * RATE_OF_GYRO)
    k = 0
    for truth in truths[pace::pace]:
        while k < len(arrivals) and arrivals[k].t <= truth.t + 1e-9:
            verdict = give(estimator, arrivals[k].reading)
            if hear is not None:
                hear(arrivals[k], verdict)
            k += 1
        states.append(estimator.state(truth.t))
        seen.append(truth)
    return seen, states, estimator


def give(estimator: ProximityFilter, reading: GyroReading | RangeReading | FeatureReading | NozzlePulses) -> object:
    if isinstance(reading, GyroReading):
        return estimator.gyro(reading)
    if isinstance(reading, RangeReading):
        return estimator.range(reading)
    if isinstance(reading, FeatureReading):
        return estimator.features(reading)
    return estimator.command(reading)


def _fly(
    world: World, parameters: ProximityParameters, truth: Truth, rng: np.random.Generator
) -> tuple[list[Truth], list[Arrival]]:
    dt = 1.0 / RATE_OF_GYRO
    line = np.array(world.ends) - np.array(world.begin)
    line /= np.linalg.norm(line)
    turn = vector_from_rotation(truth.c_from_d.T @ DOCKING)
    rate = np.zeros(3)
    wrong = _nozzle_errors(rng) if world.nozzle_errors else None
    truths, arrivals = [], []
    force = np.zeros(3)
    for k in range(round(world.duration * RATE_OF_GYRO) + 1):
        t = k * dt
        truths.append(replace(truth))
        if k % 10 == 0:
            force = truth.c_from_d.T @ (SETUP.mass * line * _wanted(world, t))
            pulses = NozzlePulses(t=t, on_times=(), force=force, torque=np.zeros(3))
            arrivals.append(Arrival(t, pulses))
        target_rate = _turning(world, t, turn)
        arrivals += _read(world, parameters, truth, rate, k, rng)
        acceleration = truth.c_from_d @ force / SETUP.mass
        density = parameters.acceleration_noise
        if wrong is None:
            model = parameters.force_error * math.sqrt(2.0 * parameters.force_error_time)
            density = math.hypot(density, model * float(np.linalg.norm(acceleration)))
            noise = density / math.sqrt(dt) * rng.standard_normal(3)
        else:
            matrix, residual = wrong
            noise = truth.c_from_d @ (matrix @ force) / SETUP.mass + residual
        felt = acceleration + noise
        truth = Truth(
            t + dt,
            truth.position + dt * truth.velocity + 0.5 * dt * dt * felt,
            truth.velocity + dt * felt,
            truth.c_from_d @ rotation_from_vector(0.5 * dt * (rate + target_rate)),
        )
        rate = target_rate
    return truths, arrivals


def _wanted(world: World, t: float) -> float:
    """Commanded acceleration [m/s^2] along the line: up to the speed, and down again before the end."""
    if not world.moving:
        return 0.0
    burn = SPEED / ACCELERATION
    length = float(np.linalg.norm(np.array(world.ends) - np.array(world.begin)))
    stop = length / SPEED
    return ACCELERATION * (float(0.5 <= t < 0.5 + burn) - float(stop <= t < stop + burn))


def _turning(world: World, t: float, turn: Array) -> Array:
    """Turn rate [rad/s] in d: 0.1 rad/s about the axis of the whole turn, one second to get there and to leave."""
    angle = float(np.linalg.norm(turn))
    if not world.moving or angle < 1e-6:
        return np.zeros(3)
    since = t + 1.0 / RATE_OF_GYRO - world.turn_from
    whole = angle / TURN_RATE
    share = max(0.0, min(1.0, since, whole + 1.0 - since))
    return share * TURN_RATE * turn / angle


def _nozzle_errors(rng: np.random.Generator) -> tuple[Array, Array]:
    """Share of the force that is wrong, as a matrix (five per cent, one degree, two of mass), and a residual."""
    matrix = 0.02 * rng.standard_normal() * np.eye(3) + np.diag(0.03 * rng.standard_normal(3))
    matrix += 0.01 * rng.standard_normal((3, 3))
    direction = rng.standard_normal(3)
    return matrix, 2e-5 * direction / np.linalg.norm(direction)


def _read(
    world: World, parameters: ProximityParameters, truth: Truth, rate: Array, k: int, rng: np.random.Generator
) -> list[Arrival]:
    t = truth.t
    noise = parameters.gyro_noise * math.sqrt(RATE_OF_GYRO) * rng.standard_normal(3)
    arrivals = [Arrival(t, GyroReading(t=t, rate=rate + noise))]
    if k % (RATE_OF_GYRO // RATE_OF_RANGES) == 1:
        number = k // (RATE_OF_GYRO // RATE_OF_RANGES) % len(SETUP.anchors)
        radio = truth.position + truth.c_from_d @ SETUP.lever_arm
        measured = np.linalg.norm(radio - SETUP.anchors[number]) + parameters.range_std * rng.standard_normal()
        outlier = rng.random() < world.outliers
        measured += rng.uniform(0.15, 1.0) if outlier else 0.0
        arrivals.append(Arrival(t + 0.005, RangeReading(t=t, anchor=number, range=float(measured)), bool(outlier)))
    if k % (RATE_OF_GYRO // RATE_OF_PICTURES) == 2 and t >= world.vision_from:
        in_d = (SETUP.markers_in_c - truth.position) @ truth.c_from_d
        in_cam = SETUP.d_from_cam.inverse().apply(in_d)
        in_cam += parameters.feature_std * rng.standard_normal(in_cam.shape)
        arrivals.append(Arrival(t + 0.05, FeatureReading(t=t, markers=tuple(range(len(in_cam))), positions=in_cam)))
    return arrivals
