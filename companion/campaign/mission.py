"""Any mission in the simulator: a flight through an autopilot, or a docking."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from companion.campaign.docking import run_docking
from companion.campaign.flight import run_flight
from companion.campaign.result import FlightResult
from companion.campaign.spec import Camera
from companion.mission.docking import names_docking
from companion.recording import Recorder


def run_mission(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
) -> FlightResult:
    """Fly a mission once, as `RunFlight` says; a docking has no use for `camera`.

    Raises:
        InputError: with every problem of every file.
    """
    if names_docking(mission_path):
        return run_docking(mission_path, seed=seed, overrides=overrides, recorder=recorder)
    return run_flight(mission_path, seed=seed, camera=camera, overrides=overrides, recorder=recorder)
