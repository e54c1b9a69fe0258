"""A target that is not there: the mission ends by the autopilot, as its file says."""

from pathlib import Path

import pytest

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.messages.ownship import FlightMode
from companion.runtime.ports import MissionState

ROOT = Path(__file__).parents[2]
PAD = """
version: 1
name: a pad that is not in the world
family: 36h11
size_m: [0.8, 0.8]
tags:
  - {id: 100, size_m: 0.5, x_m: 0.0, y_m: 0.0}
"""


@pytest.mark.parametrize(("then", "mode"), [("hold", FlightMode.AUTO_LOITER), ("return", FlightMode.AUTO_RTL)])
def test_a_target_not_found_ends_in_the_mode_that_the_mission_names(
    tmp_path: Path, then: str, mode: FlightMode
) -> None:
    pad = tmp_path / "pad.yaml"
    pad.write_text(PAD)
    mission = tmp_path / "mission.yaml"
    mission.write_text(
        f"version: 1\nname: not found\nconfig: {ROOT}/config/x500_sim.yaml\ntarget: {{pad: {pad}}}\n"
        f"on_target_lost: {{then: {then}}}\n"
        "steps:\n  - takeoff\n  - search: {radius_m: 2.0, timeout_s: 5.0}\n  - land\n"
    )
    modes: list[FlightMode] = []
    flight = SimulatedFlight(load_flight(mission), seed=3, camera="corners", time_limit_s=25.0)
    flight.run(lambda p: modes.append(p.snapshot.vehicle.mode) if p.snapshot is not None else None)
    assert flight.pipeline.mission.state is MissionState.ABORTED
    assert "not found" in flight.pipeline.mission.reason
    assert modes[-1] is mode
    assert modes.count(FlightMode.OFFBOARD) > 200
