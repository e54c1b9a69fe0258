"""What a recording says of the flight it holds: enough to fly it again. Nothing of it comes from a clock."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from pathlib import Path

from companion.campaign.spec import Camera
from companion.config import Flight, dump, fingerprint, load_flight
from companion.config.docking import Docking, load_docking
from companion.documents import read_text
from companion.mission.docking import names_docking


def flight_metadata(flight: Flight, *, seed: int, camera: str) -> dict[str, dict[str, str]]:
    """Give the metadata blocks of a simulated flight's recording.

    Args:
        flight: the checked mission with its configuration.
        seed: of the simulation.
        camera: "rendered" or "corners".
    """
    wind = flight.mission.wind_mps
    blows = {} if wind is None else {"wind": f"{wind:g} m/s"}
    ground = flight.plan.ground
    behind = {"standoff_m": f"{ground.standoff_m:g}"} if ground is not None and ground.standoff_m else {}
    return _metadata(flight, seed=seed, camera={"camera": camera, **blows, **behind})


def docking_metadata(docking: Docking, *, seed: int) -> dict[str, dict[str, str]]:
    """Give the metadata blocks of a simulated docking's recording; see `flight_metadata`."""
    return _metadata(docking, seed=seed, camera={})


def mission_metadata(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str]
) -> dict[str, dict[str, str]]:
    """Give the metadata blocks of the recording of a mission in the simulator.

    Raises:
        InputError: with every problem of every file.
    """
    if names_docking(mission_path):
        return docking_metadata(load_docking(mission_path, overrides=overrides), seed=seed)
    return flight_metadata(load_flight(mission_path, overrides=overrides), seed=seed, camera=camera)


def _metadata(flown: Flight | Docking, *, seed: int, camera: dict[str, str]) -> dict[str, dict[str, str]]:
    return {
        "run": {
            "companion_version": importlib.metadata.version("companion"),
            "mission": flown.mission.name,
            "world": flown.mission.world,
            "seed": str(seed),
            **camera,
            "config_sha256": fingerprint(flown.config),
        },
        "mission": {"yaml": read_text(flown.mission.source)},
        "configuration": {"yaml": dump(flown.config)},
    }
