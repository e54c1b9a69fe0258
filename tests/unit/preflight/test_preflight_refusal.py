"""Rule 4 in a whole flight: an autopilot with an unsafe parameter is not armed."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.runtime.ports import MissionState

MISSION = Path(__file__).parents[3] / "missions" / "land_static.yaml"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("COM_RC_OVERRIDE.bits_set=2", "COM_RC_OVERRIDE is 1, wanted: bit 1 set"),
        ("COM_OF_LOSS_T={least: 0.3, most: 0.5}", "COM_OF_LOSS_T is 1, wanted: 0.3 to 0.5"),
        ("GF_ACTION.values=[3]", "GF_ACTION is 2 (Hold), wanted: 3 (Return)"),
    ],
)
def test_the_mission_is_refused_with_name_value_and_wanted_value(change: str, words: str) -> None:
    flight = load_flight(MISSION, overrides=[f"preflight.autopilot.{change}"])
    simulated = SimulatedFlight(flight, seed=1, camera="corners", time_limit_s=8.0)
    simulated.run()
    mission = simulated.pipeline.mission
    assert mission.state is MissionState.REFUSED
    assert words in mission.reason
    truth = simulated.simulation.truth()
    assert not truth.vehicle.armed
    assert truth.vehicle.feet_in_contact == 4
