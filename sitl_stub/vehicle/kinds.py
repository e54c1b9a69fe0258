"""The kinds of vehicles: how each one's file is read, and its body and autopilot are made. The only list of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from sitl_stub.vehicle.autopilot import Autopilot, BootClock
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.config import MULTICOPTER, VehicleConfig, VehicleFile, VehicleFileError, read_document
from sitl_stub.vehicle.faults import Faults
from sitl_stub.vehicle.multicopter import MulticopterAutopilot, MulticopterTelemetry
from sitl_stub.vehicle.rigid_body import RigidBody
from sitl_stub.vehicle.rover.autopilot import RoverAutopilot, RoverTelemetry
from sitl_stub.vehicle.rover.body import RoverBody
from sitl_stub.vehicle.rover.config import ROVER_ACKERMANN, RoverConfig
from sitl_stub.vehicle.spacecraft.autopilot import SpacecraftAutopilot, SpacecraftTelemetry
from sitl_stub.vehicle.spacecraft.body import FreeFlyerBody
from sitl_stub.vehicle.spacecraft.config import SPACECRAFT, FreeFlyerConfig
from sitl_stub.vehicle.telemetry import Telemetry

C = TypeVar("C", bound=VehicleFile)
A = TypeVar("A", bound=Autopilot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind(Generic[C, A]):
    """One kind of vehicle; `C` is what its file says, `A` its autopilot."""

    config: type[C]
    read: Callable[[str, Mapping[str, Any]], C]
    """(name of the file for errors, its content) -> configuration."""
    body: Callable[[C, float], Body]
    """(configuration, heading [rad]) -> body at rest on the ground at the world's origin."""
    autopilot: Callable[[C, Body, Faults, np.random.Generator, np.random.Generator, BootClock], A]
    """(configuration, body, faults, dice of the estimate, dice of its resets, clock) -> autopilot."""
    telemetry: Callable[[A], Telemetry]
    """Makes what turns the autopilot's state into messages."""


KINDS: dict[str, Kind[Any, Any]] = {
    MULTICOPTER: Kind(
        config=VehicleConfig,
        read=VehicleConfig.read,
        body=lambda vehicle, heading: RigidBody(vehicle.body, vehicle.gear, heading=heading),
        autopilot=MulticopterAutopilot,
        telemetry=MulticopterTelemetry,
    ),
    ROVER_ACKERMANN: Kind(
        config=RoverConfig,
        read=RoverConfig.read,
        body=lambda vehicle, heading: RoverBody(vehicle.body, heading=heading),
        autopilot=RoverAutopilot,
        telemetry=RoverTelemetry,
    ),
    SPACECRAFT: Kind(
        config=FreeFlyerConfig,
        read=FreeFlyerConfig.read,
        body=lambda vehicle, heading: FreeFlyerBody(vehicle.body, heading=heading),
        autopilot=SpacecraftAutopilot,
        telemetry=SpacecraftTelemetry,
    ),
}
"""Word of the vehicle file's `kind` -> what it means."""


def load_vehicle(path_or_name: str | Path) -> VehicleFile:
    """Read the file of any vehicle, or of one that comes with the simulator. Raises `VehicleFileError`."""
    where, document = read_document(path_or_name)
    kind = KINDS.get(document.get("kind", MULTICOPTER))
    if kind is None:
        raise VehicleFileError(f"{where}: unknown kind {document['kind']!r}; known: {', '.join(KINDS)}")
    vehicle: VehicleFile = kind.read(where, document)
    return vehicle


def kind_of(vehicle: VehicleFile) -> Kind[Any, Any]:
    """Find the kind of a vehicle that was read."""
    return next(kind for kind in KINDS.values() if isinstance(vehicle, kind.config))
