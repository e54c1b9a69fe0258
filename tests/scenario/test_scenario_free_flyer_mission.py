"""The free-flyer's missions in the simulator, corners camera, virtual time: it meets a target on its way and stays."""

from pathlib import Path

import pytest
from scenario_takeover import assert_left_alone_after_takeover

from companion.campaign.flight import SimulatedFlight
from companion.campaign.result import Outcome
from companion.config import load_flight
from companion.recording import MemoryRecorder
from sitl_stub.vehicle.modes import Mode

DOCK = Path(__file__).parents[2] / "missions" / "papers" / "patel_free_flyer.yaml"
WORLD = """
version: 1
wind: calm
targets:
  - name: free-flyer
    pad: free_flyer_dock
    start: {{north_m: 0.8, east_m: 0.4, heading_deg: -90}}
    starts: {{after_s: 11.0}}
    motion: {{kind: random, speed_mps: {speed}, turn_rate_radps: [-1.0, 1.0], period_s: 0.1, duration_s: 10}}
"""


@pytest.mark.parametrize(
    ("speed", "kept_within", "ends_within"),
    [
        pytest.param("0.1", 0.06, 0.02, id="as fast as itself: what is lost is not made up"),
        pytest.param("[0.0, 0.1]", 0.02, 0.015, id="slower, its speed drawn ten times a second"),
    ],
)
def test_it_meets_a_target_on_its_way_and_stays_with_it_until_it_has_stopped(
    tmp_path, speed: str, kept_within: float, ends_within: float
) -> None:
    """Patel et al., table 5, cases 2 and 4; limits violated would say that it was faster than allowed."""
    path = tmp_path / "world.yaml"
    path.write_text(WORLD.format(speed=speed), encoding="utf-8")
    flight = load_flight(DOCK, overrides=[f"simulation.world={path}", "steps.1.follow.for_s=5"])
    result = SimulatedFlight(flight, seed=3, camera="corners", time_limit_s=45.0).run()
    assert result.outcome is Outcome.FOLLOWED, result.reason
    assert result.success
    assert not result.limits_violated
    assert result.position_error_m < ends_within
    assert result.angular_error_rad < 0.02
    assert result.station_keeping.position_mean_m < kept_within
    assert result.station_keeping.angle_mean_rad < 0.15
    assert result.tracking_gap_s < 1.0


def test_the_same_seed_is_the_same_flight() -> None:
    first, second = MemoryRecorder(), MemoryRecorder()
    for recorder in (first, second):
        SimulatedFlight(load_flight(DOCK), seed=1, camera="corners", time_limit_s=4.0, recorder=recorder).run()
    for channel in ("truth", "thrust"):
        records = [[record.data for record in each.recording().messages[channel]] for each in (first, second)]
        assert len(records[0]) > 10
        assert records[0] == records[1]


def test_a_pilots_mode_is_nobody_elses_and_the_vehicle_is_left_alone() -> None:
    simulated = SimulatedFlight(load_flight(DOCK), seed=3, camera="corners", time_limit_s=8.0)
    assert_left_alone_after_takeover(simulated, Mode.AUTO_LOITER, at=6.5)


def test_a_hold_that_would_drive_to_the_origin_is_refused() -> None:
    """With its gain at PX4's default a spacecraft's Hold, where each mission ends, goes to the origin of its frame."""
    simulated = SimulatedFlight(load_flight(DOCK), seed=3, camera="corners", time_limit_s=8.0)
    simulated.simulation.autopilot.parameters["SPC_POS_P"] = 0.2
    result = simulated.run()
    assert result.outcome is Outcome.REFUSED
    assert "SPC_POS_P is 0.2" in result.reason
