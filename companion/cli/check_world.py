"""What a simulated world holds ready for a mission, in words; nothing of it concerns a real flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from companion.config import Flight
from companion.config.sections import VehicleSection, VehicleType

if TYPE_CHECKING:
    from sitl_stub.world.world import World


def describe_world(flight: Flight) -> str:
    """Name the world of `companion sim` with its wind, and remark what in it does not fit the mission."""
    world = _world(flight)
    remark = "" if world is None else _absent(flight, world) or _no_dropouts(flight, world) or _faster(flight, world)
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


def _absent(flight: Flight, world: World) -> str:
    """Say that nothing in the world is the mission's target; empty where something is."""
    wanted = flight.pad.name
    held = sorted({target.pad.name for target in world.targets})
    if wanted in held:
        return ""
    only = ", ".join(f'"{name}"' for name in held) or "no target at all"
    return f'REMARK: there is no "{wanted}" in it but {only}: companion sim will not find the target'


def _no_dropouts(flight: Flight, world: World) -> str:
    """Say that the dropouts which the mission asks for cannot be had in this world; empty where they can."""
    length = flight.mission.dropout_s
    if not length or world.camera_faults.blindness.length:
        return ""
    return f"REMARK: it has no dropouts (camera.blind): companion sim will refuse simulation.dropout_s {length:g}"


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
