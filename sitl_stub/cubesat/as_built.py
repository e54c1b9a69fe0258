"""The vehicle and the world as they really are: what the files say, and what the dice add."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl_stub.cubesat.nozzles import BuiltNozzle
from sitl_stub.cubesat.rotation import Matrix, cross, from_rotation_vector, matrix_of, minus, normalised, plus, turned
from sitl_stub.cubesat.vehicle import CubesatVehicle, NozzleFile
from sitl_stub.cubesat.world import DockingWorld
from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.attitude_control import multiply

_LEAST = 0.05
"""Drawn thrust and mass keep at least this share of the designed one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltVehicle:
    """One drawn vehicle."""

    mass: float
    """[kg]"""
    inertia: Matrix
    """About the true centre of mass [kg m^2], in d."""
    mass_centre: Vector
    """[m], in d, from the centre of the cube."""
    nozzles: tuple[BuiltNozzle, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedTarget:
    """Where the target really stands."""

    position: Vector
    """Centre [m], in c."""
    quaternion: Quaternion
    """c_from_t"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where the chaser really starts, at rest, and what pushes it."""

    position: Vector
    """Centre of the cube [m], in c."""
    quaternion: Quaternion
    """c_from_d"""
    residual_acceleration: Vector
    """[m/s^2], in c."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialEstimate:
    """What the chaser is told about its start, with the standard deviation of each axis."""

    position: Vector
    """Centre of the cube [m], in c."""
    velocity: Vector
    """[m/s], in c."""
    quaternion: Quaternion
    """c_from_d; truth = this * error, the error turning about axes of d."""
    position_std: float
    velocity_std: float
    attitude_std: float
    """[rad]"""


def scattered(dice: np.random.Generator, std: float) -> Vector:
    """Draw three normal numbers."""
    x, y, z = dice.standard_normal(3).tolist()
    return (x * std, y * std, z * std)


def build_vehicle(vehicle: CubesatVehicle, dice: np.random.Generator) -> BuiltVehicle:
    """Draw mass, centre of mass and nozzles."""
    as_built, body = vehicle.as_built, vehicle.body
    factor = max(_LEAST, 1.0 + as_built.mass_std * float(dice.standard_normal()))
    mass_centre = scattered(dice, as_built.mass_centre_std)
    (a, b, c), (d, e, f), (g, h, i) = body.inertia
    k = factor
    return BuiltVehicle(
        mass=factor * body.mass,
        inertia=((k * a, k * b, k * c), (k * d, k * e, k * f), (k * g, k * h, k * i)),
        mass_centre=mass_centre,
        nozzles=tuple(_build_nozzle(nozzle, vehicle, mass_centre, dice) for nozzle in vehicle.propulsion.nozzles),
    )


def _build_nozzle(
    nozzle: NozzleFile, vehicle: CubesatVehicle, mass_centre: Vector, dice: np.random.Generator
) -> BuiltNozzle:
    as_built = vehicle.as_built
    share = max(_LEAST, 1.0 + as_built.thrust_std * float(dice.standard_normal()))
    tilt = scattered(dice, as_built.direction_std)
    thrust = share * vehicle.propulsion.thrust
    # the part of the tilt along the nozzle turns nothing: two axes are left
    direction = turned(matrix_of(from_rotation_vector(tilt)), nozzle.direction)
    force = (thrust * direction[0], thrust * direction[1], thrust * direction[2])
    return BuiltNozzle(thrust=thrust, force=force, torque=cross(minus(nozzle.position, mass_centre), force))


def place_anchors(world: DockingWorld, dice: np.random.Generator) -> tuple[Vector, ...]:
    """Draw where the anchors really stand [m], in c."""
    return tuple(plus(anchor, scattered(dice, world.survey.anchor_std)) for anchor in world.anchors)


def place_target(world: DockingWorld, dice: np.random.Generator) -> PlacedTarget:
    """Draw where the target really stands."""
    survey, target = world.survey, world.target
    position = plus(target.position, scattered(dice, survey.target_position_std))
    turn = from_rotation_vector(scattered(dice, survey.target_attitude_std))
    return PlacedTarget(position=position, quaternion=normalised(multiply(target.quaternion, turn)))


def draw_start(world: DockingWorld, dice: np.random.Generator) -> Start:
    """Draw the true start and the residual acceleration."""
    chaser = world.chaser
    position = plus(chaser.position, scattered(dice, chaser.position_std))
    turn = from_rotation_vector(scattered(dice, chaser.attitude_std))
    direction = dice.standard_normal(3)
    x, y, z = (chaser.residual_acceleration * direction / np.linalg.norm(direction)).tolist()
    return Start(
        position=position,
        quaternion=normalised(multiply(chaser.quaternion, turn)),
        residual_acceleration=(x, y, z),
    )


def draw_initial_estimate(world: DockingWorld, start: Start, dice: np.random.Generator) -> InitialEstimate:
    """Draw what the chaser is told."""
    spread = world.initial_estimate
    error = from_rotation_vector(scattered(dice, spread.attitude_std))
    return InitialEstimate(
        position=plus(start.position, scattered(dice, spread.position_std)),
        velocity=scattered(dice, spread.velocity_std),
        quaternion=normalised(multiply(start.quaternion, error)),
        position_std=spread.position_std,
        velocity_std=spread.velocity_std,
        attitude_std=spread.attitude_std,
    )
