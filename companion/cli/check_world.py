"""What a simulated world holds ready for a mission, in words; nothing of it concerns a real flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from companion.config import Flight
from companion.config.sections import VehicleSection, VehicleType

if TYPE_CHECKING:
    from sitl_stub.world.world import World


def describe_world(flight: Flight) -> str:
    """Name the world of `companion sim` with its wind, and remark where its target outruns the speed limit."""
    world = _world(flight)
    remark = "" if world is None else _faster(flight, world)
    wind = _wind(flight, world)
    said = f"{flight.mission.world} (only for companion sim)" + (f"; wind {wind}" if wind else "")
    return f"{said}; {remark}" if remark else said


def _world(flight: Flight) -> World | None:
    """Load the mission's world; None where no simulator is installed."""
    try:
        from sitl_stub.world.world import World
    except ImportError:
        return None
    return World.load(flight.mission.world)


def _wind(flight: Flight, world: World | None) -> str:
    """Say what wind blows in the simulation: the mission's, else the world's; empty where no simulator is installed."""
    if world is None:
        return ""
    own = flight.mission.wind_mps
    if own is not None:
        return f"{own:g} m/s" if own > 0.0 else "none"
    mean = world.wind.mean
    if mean.high <= 0.0:
        return "none"
    return f"{mean.high:g} m/s" if mean.low == mean.high else f"{mean.low:g} to {mean.high:g} m/s"


def _faster(flight: Flight, world: World) -> str:
    """Say that the world's fastest target of the mission's kind cannot be kept up with; empty where it can."""
    speed = max(
        (target.motion.speed.high for target in world.targets if target.pad.name == flight.pad.name), default=0.0
    )
    limit = _speed_limit(flight.config.vehicle)
    if speed <= limit:
        return ""
    return (
        f"REMARK: its target drives at up to {speed:g} m/s, faster than the limit of {limit:g} m/s lets the vehicle be"
    )


def _speed_limit(vehicle: VehicleSection) -> float:
    """Give the greatest speed [m/s] over the ground."""
    if vehicle.type is VehicleType.ROVER:
        return vehicle.rover.speed_forward
    if vehicle.type is VehicleType.FREE_FLYER:
        return vehicle.free_flyer.speed
    return vehicle.multicopter.speed_horizontal
