"""What follows from the type of the vehicle."""

from __future__ import annotations

from dataclasses import replace

from companion.config.sections import VehicleType
from companion.config.tree import Config
from companion.link.autopilot_link import LinkParameters
from companion.preflight.autopilot_parameters import Rules
from companion.vehicles.rover import ROVER_MAV_TYPES


def on_ground(config: Config) -> bool:
    """Whether the vehicle drives."""
    return config.vehicle.type is VehicleType.ROVER


def autopilot_rules(config: Config) -> Rules:
    """Give what the autopilot's parameters must be before it is armed."""
    if on_ground(config):
        return config.preflight.rover.rules(config.vehicle.rover.drive)
    return config.preflight.autopilot.rules


def link_parameters(config: Config) -> LinkParameters:
    """Give the link's parameters, with the MAV_TYPEs that the vehicle's type may report."""
    link = config.link.mavlink
    if not on_ground(config) or link.vehicle_types != LinkParameters().vehicle_types:
        return link
    return replace(
        link, vehicle_types=tuple(sorted(ROVER_MAV_TYPES)), vehicle_wanted="a ground rover with PX4 is needed"
    )


def body_height(config: Config) -> float:
    """Height [m] of the body origin above the feet, or above the ground."""
    if on_ground(config):
        return config.vehicle.rover.body_height
    return config.vehicle.multicopter.gear_height
