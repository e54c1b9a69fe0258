"""What a recording says of the flight it holds: enough to fly it again. Nothing of it comes from a clock."""

from __future__ import annotations

import importlib.metadata

from companion.config import Flight, dump, fingerprint
from companion.documents import read_text


def flight_metadata(flight: Flight, *, seed: int, camera: str) -> dict[str, dict[str, str]]:
    """Give the metadata blocks of a simulated flight's recording.

    Args:
        flight: the checked mission with its configuration.
        seed: of the simulation.
        camera: "rendered" or "corners".
    """
    return {
        "run": {
            "companion_version": importlib.metadata.version("companion"),
            "mission": flight.mission.name,
            "world": flight.mission.world,
            "seed": str(seed),
            "camera": camera,
            "config_sha256": fingerprint(flight.config),
        },
        "mission": {"yaml": read_text(flight.mission.source)},
        "configuration": {"yaml": dump(flight.config)},
    }
