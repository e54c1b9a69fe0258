"""The rover in the simulator, corners camera, virtual time: it follows, it meets, and it gives way to a pilot."""

from pathlib import Path

from scenario_takeover import assert_left_alone_after_takeover

from companion.campaign.flight import SimulatedFlight
from companion.campaign.result import Outcome
from companion.config import load_flight
from companion.recording.recorder import MemoryRecorder
from sitl_stub.vehicle.modes import Mode

MISSIONS = Path(__file__).parents[2] / "missions"


WORLD = """
version: 1
wind: calm
targets:
  - name: rover
    pad: rover_target
    start: {{north_m: 3.0, east_m: 0.3, heading_deg: {heading}}}
    starts: {{after_s: 6.5}}
    motion: {{kind: straight, speed_mps: {speed}, duration_s: {duration}}}
"""


def in_world(folder, mission: str, *overrides: str, **world: float):
    """Load a mission for a short drive in a world of its own."""
    path = folder / "world.yaml"
    path.write_text(WORLD.format(**world), encoding="utf-8")
    return load_flight(MISSIONS / mission, overrides=[f"simulation.world={path}", *overrides])


def test_it_follows_a_rover_and_stops_with_it(tmp_path) -> None:
    flight = in_world(tmp_path, "rover_follow.yaml", "steps.1.follow.for_s=4", heading=8.0, speed=0.5, duration=7.0)
    recorder = MemoryRecorder()
    result = SimulatedFlight(flight, seed=3, camera="corners", recorder=recorder, time_limit_s=45.0).run()
    assert result.outcome is Outcome.FOLLOWED, result.reason
    assert result.success
    assert result.position_error_m < 0.1
    assert result.angular_error_rad < 0.1
    assert result.station_keeping.position_mean_m < 0.25
    assert result.tracking_gap_s < 1.0
    plans = [record.data["plan"] for record in recorder.recording().messages["plan"]]
    assert len(plans) > 50
    assert all({"objective", "violation", "end", "iterations", "slack"} <= set(plan) for plan in plans)


def test_it_meets_a_rover_that_crosses_without_touching_it(tmp_path) -> None:
    flight = in_world(tmp_path, "rover_lateral.yaml", heading=-60.0, speed=0.25, duration=5.0)
    result = SimulatedFlight(flight, seed=3, camera="corners", time_limit_s=60.0).run()
    assert result.outcome is Outcome.INTERCEPTED, result.reason
    assert result.success
    assert not result.limits_violated


def test_a_pilots_mode_is_nobody_elses_and_the_rover_is_left_alone() -> None:
    simulated = SimulatedFlight(
        load_flight(MISSIONS / "rover_follow.yaml"), seed=3, camera="corners", time_limit_s=12.0
    )
    assert_left_alone_after_takeover(simulated, Mode.MANUAL, at=6.5)


def test_parameters_that_would_drive_it_home_by_itself_are_refused() -> None:
    """Sticks that stop mean Return by PX4's default: at the end of each mission the rover would set off."""
    flight = load_flight(MISSIONS / "rover_follow.yaml")
    simulated = SimulatedFlight(flight, seed=3, camera="corners", time_limit_s=12.0)
    simulated.simulation.autopilot.parameters["NAV_RCL_ACT"] = 2
    result = simulated.run()
    assert result.outcome is Outcome.REFUSED
    assert "NAV_RCL_ACT is 2 (Return)" in result.reason
