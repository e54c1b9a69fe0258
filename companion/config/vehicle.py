"""What follows from the type of the vehicle."""

from __future__ import annotations

from dataclasses import replace

from companion.config.sections import VehicleType
from companion.config.tree import Config
from companion.link.parameters import LinkParameters
from companion.preflight.autopilot_parameters import Rules
from companion.vehicles.free_flyer import FREE_FLYER_MAV_TYPES
from companion.vehicles.rover import ROVER_MAV_TYPES

_WANTED = {
    VehicleType.ROVER: (ROVER_MAV_TYPES, "a ground rover with PX4 is needed"),
    VehicleType.FREE_FLYER: (FREE_FLYER_MAV_TYPES, "a spacecraft (MAV_TYPE 45) with PX4 is needed"),
}


def on_ground(config: Config) -> bool:
    """Whether the vehicle stays on the ground: it drives, or floats over a floor."""
    return config.vehicle.type is not VehicleType.MULTICOPTER


def floats(config: Config) -> bool:
    """Whether the vehicle is a free-flyer."""
    return config.vehicle.type is VehicleType.FREE_FLYER


def autopilot_rules(config: Config) -> Rules:
    """Give what the autopilot's parameters must be before it is armed."""
    if floats(config):
        return config.preflight.free_flyer.rules(config.vehicle.free_flyer.control)
    if on_ground(config):
        return config.preflight.rover.rules(config.vehicle.rover.drive)
    return config.preflight.autopilot.rules


def link_parameters(config: Config) -> LinkParameters:
    """Give the link's parameters, with the MAV_TYPEs that the vehicle's type may report."""
    link = config.link.mavlink
    if not on_ground(config) or link.vehicle_types != LinkParameters().vehicle_types:
        return link
    types, wanted = _WANTED[config.vehicle.type]
    return replace(link, vehicle_types=tuple(sorted(types)), vehicle_wanted=wanted)


def body_height(config: Config) -> float:
    """Height [m] of the body origin above the feet, or above the ground."""
    if floats(config):
        return config.vehicle.free_flyer.body_height
    if on_ground(config):
        return config.vehicle.rover.body_height
    return config.vehicle.multicopter.gear_height
