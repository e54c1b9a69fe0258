"""The climb in the simulator, with its wind and the autopilot's wandering velocity."""

import math
from pathlib import Path

import pytest

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight

MISSION = Path(__file__).parents[2] / "missions" / "land_static.yaml"
LIMIT_UP = 1.5  # [m/s] of the configured vehicle


@pytest.mark.parametrize("seed", [4, 31, 39, 75])
def test_the_vehicle_itself_climbs_within_its_limit(seed: int) -> None:
    """Seed 31 climbed at 2.1 m/s when the reference ran ahead of a vehicle that stood on the ground."""
    flight = load_flight(MISSION)
    assert flight.config.vehicle.multicopter.speed_up == LIMIT_UP
    simulated = SimulatedFlight(flight, seed=seed, camera="corners", time_limit_s=16.0)
    fastest, highest = 0.0, -math.inf

    def watch(_progress: object) -> None:
        nonlocal fastest, highest
        vehicle = simulated.simulation.truth().vehicle
        fastest, highest = max(fastest, -vehicle.velocity_ned[2]), max(highest, -vehicle.position_ned[2])

    simulated.run(watch)
    assert highest > 3.0
    assert fastest < LIMIT_UP


@pytest.mark.parametrize("height", [7.0, 10.0])
def test_a_pad_below_a_high_search_is_landed_on(height: float) -> None:
    """Above 6 m the Markov model is not asked: the approach once hovered there until the time was up."""
    heights = [f"steps.0.takeoff.height_m={height}", f"steps.1.search.height_m={height}"]
    flight = load_flight(MISSION, overrides=heights)
    result = SimulatedFlight(flight, seed=11, camera="corners", time_limit_s=120.0).run()
    assert result.success, result.reason
