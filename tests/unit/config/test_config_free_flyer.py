"""A free-flyer's configuration and missions: what fits to what, and what preflight asks for."""

from pathlib import Path

import pytest

from companion.config import load_config, load_flight
from companion.config.vehicle import autopilot_rules, body_height, floats, link_parameters, on_ground
from companion.errors import InputError
from companion.preflight.autopilot_parameters import judge_parameters
from companion.preflight.finding import Verdict

ROOT = Path(__file__).parents[3]
STATION, DOCK = ROOT / "missions" / "free_flyer_station.yaml", ROOT / "missions" / "papers" / "patel_free_flyer.yaml"
FREE_FLYER, ROVER = ROOT / "config" / "free_flyer_sim.yaml", ROOT / "config" / "rover_sim.yaml"


def problems(mission=STATION, config=None, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        load_flight(mission, config_path=config, overrides=overrides)
    return "\n".join(map(str, caught.value.problems))


def test_what_follows_from_the_type() -> None:
    config = load_config(FREE_FLYER)
    assert on_ground(config)
    assert floats(config)
    assert not floats(load_config(ROVER))
    assert link_parameters(config).vehicle_types == (45,)
    assert body_height(config) == 0.25


def test_limits_tighten_it() -> None:
    flight = load_flight(STATION, overrides=["limits.speed_mps=0.05", "limits.acceleration_mps2=0.1"])
    flyer = flight.config.vehicle.free_flyer
    assert (flyer.speed, flyer.acceleration) == (0.05, 0.1)
    assert "limits.speed_mps" in problems(STATION, None, "limits.speed_mps=0.5")


@pytest.mark.parametrize("standoff", [0.0, 0.3])
def test_a_place_inside_the_target_is_refused(standoff) -> None:
    told = problems(STATION, None, f"steps.1.follow.standoff_m={standoff}")
    assert "steps.1.follow.standoff_m" in told
    assert "from the middle of the vehicle" in told


def test_a_dock_has_its_boards_beside_the_place() -> None:
    assert load_flight(DOCK).plan.ground.standoff_m == 0.0
    assert "from the middle of the vehicle" in problems(DOCK, None, "vehicle.free_flyer.footprint_radius=0.7")


def test_it_cannot_leave_the_ground() -> None:
    assert "a free-flyer cannot leave the ground" in problems(ROOT / "missions" / "land_static.yaml", FREE_FLYER)


def test_preflight_asks_for_what_flying_by_thrust_rests_on() -> None:
    config = load_config(FREE_FLYER)
    rules = autopilot_rules(config)
    fine = dict.fromkeys(rules, 0.0) | {
        "COM_OF_LOSS_T": 1.0,
        "NAV_RCL_ACT": 1,
        "CA_AIRFRAME": 14,
        "SC_YAW_P": config.vehicle.free_flyer.control.heading_gain,
    }
    assert all(finding.verdict is Verdict.FINE for finding in judge_parameters(rules, fine))
    bad_values = (("SPC_POS_P", 0.2), ("CA_METHOD", 2), ("CA_ROTOR3_KM", 0.05), ("SC_YAW_P", 1.0), ("NAV_RCL_ACT", 2))
    for name, value in bad_values:
        (bad,) = [f for f in judge_parameters(rules, fine | {name: value}) if f.verdict is not Verdict.FINE]
        assert bad.check == name
        assert bad.wanted
