"""A rover's configuration and missions: what fits to what, and what preflight asks for."""

from pathlib import Path

import pytest

from companion.config import load_config, load_flight
from companion.config.sections import VehicleType
from companion.config.vehicle import autopilot_rules, body_height, link_parameters, on_ground
from companion.errors import InputError
from companion.guidance.plan import FollowUntil
from companion.preflight.autopilot_parameters import judge_parameters
from companion.preflight.finding import Verdict

ROOT = Path(__file__).parents[3]
FOLLOW, LATERAL = ROOT / "missions" / "rover_follow.yaml", ROOT / "missions" / "rover_lateral.yaml"
ROVER, X500 = ROOT / "config" / "rover_sim.yaml", ROOT / "config" / "x500_sim.yaml"


def problems(mission=FOLLOW, config=None, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        load_flight(mission, config_path=config, overrides=overrides)
    return "\n".join(map(str, caught.value.problems))


def test_the_missions_say_what_is_to_be_done() -> None:
    follow, lateral = load_flight(FOLLOW).plan.ground, load_flight(LATERAL).plan.ground
    assert follow.keeps_station
    assert (follow.standoff_m, follow.until, follow.for_s) == (1.25, FollowUntil.TARGET_STOPPED, 20.0)
    assert not lateral.keeps_station
    assert load_flight(LATERAL).config.vehicle.rover.speed_forward == 0.8


def test_a_mission_fits_to_its_kind_of_vehicle_and_target() -> None:
    assert "a multicopter does not keep a standoff" in problems(FOLLOW, X500)
    assert "a rover cannot leave the ground" in problems(ROOT / "missions" / "land_static.yaml", ROVER)
    pad = ROOT / "config" / "pads" / "landing_pad_0p8.yaml"
    assert "a pad that lies flat" in problems(FOLLOW, None, f"target.pad={pad}")
    body = ROOT / "config" / "pads" / "rover_target.yaml"
    assert "upright boards" in problems(ROOT / "missions" / "land_static.yaml", None, f"target.pad={body}")


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ("[takeoff, intercept, hold]", "the vehicle stays on the ground"),
        ("[intercept, {follow: {standoff_m: 1.0}}]", "intercept and follow"),
        ("[{follow: {standoff_m: 1.0, height_m: 2.0}}]", "a height on the ground"),
        ("[intercept, land]", "the vehicle stays on the ground"),
        ("[{follow: {standoff_m: 0.1}}]", "from the middle of the vehicle"),
        ("[search, {follow: {}}]", "the first step is search"),
        ("[{follow: {standoff_m: 1.0, match_heading: false}}]", "always turns with the target"),
        ("[{search: {radius_m: 3.0}}, intercept]", "steps.0.search.radius_m: has no effect on the ground"),
        ("[{search: {height_m: 4.0}}, intercept]", "has no effect on the ground"),
    ],
)
def test_steps_that_a_rover_cannot_do_are_told(tmp_path, steps, expected) -> None:
    text = FOLLOW.read_text(encoding="utf-8").split("steps:")[0].replace("../", f"{ROOT}/")
    path = tmp_path / "m.yaml"
    path.write_text(f"{text}steps: {steps}\n", encoding="utf-8")
    assert expected in problems(path)


@pytest.mark.parametrize("key", ["speed_up_mps=0.5", "speed_down_mps=0.5", "height_m=2"])
def test_limits_of_the_air_are_refused_on_the_ground(key) -> None:
    assert "has no effect on the ground" in problems(FOLLOW, None, f"limits.{key}")
    load_flight(FOLLOW, overrides=[f"limits.{key.partition('=')[0]}="])  # left out again


def test_a_speed_at_which_a_rover_stands_is_refused() -> None:
    assert "a rover stands at 0.02 m/s" in problems(FOLLOW, None, "limits.speed_mps=0.02")


def test_a_mission_on_the_ground_is_a_free_flyers_and_a_rovers() -> None:
    floating, station = ROOT / "config" / "free_flyer_sim.yaml", ROOT / "missions" / "free_flyer_station.yaml"
    assert load_flight(FOLLOW, config_path=floating).config.vehicle.type is VehicleType.FREE_FLYER
    assert load_flight(station, config_path=ROVER).config.vehicle.type is VehicleType.ROVER
    assert "a multicopter does not keep a standoff" in problems(station, X500)


def test_limits_tighten_the_rover() -> None:
    flight = load_flight(FOLLOW, overrides=["limits.speed_mps=0.4", "limits.acceleration_mps2=0.5"])
    rover = flight.config.vehicle.rover
    assert (rover.speed_forward, rover.speed_reverse, rover.acceleration) == (0.4, 0.4, 0.5)
    assert "limits.speed_mps" in problems(FOLLOW, None, "limits.speed_mps=9")


def test_preflight_asks_for_the_drive_train_of_the_configuration() -> None:
    config = load_config(ROVER)
    rules = autopilot_rules(config)
    fine = dict.fromkeys(rules, 0.0) | {
        "COM_RC_IN_MODE": 7,
        "COM_RC_LOSS_T": 0.5,
        "NAV_RCL_ACT": 1,
        "GF_ACTION": 2,
        "RA_WHEEL_BASE": 0.36,
        "RA_MAX_STR_ANG": 0.4887,
        "RO_MAX_THR_SPEED": 3.0,
        "RO_YAW_RATE_LIM": 120.0,
        "RO_YAW_RATE_P": 0.25,
    }
    assert all(finding.verdict is Verdict.FINE for finding in judge_parameters(rules, fine))
    for name, value in (("NAV_RCL_ACT", 2), ("COM_RC_IN_MODE", 0), ("RA_WHEEL_BASE", 0.3), ("RO_YAW_EXPO", 0.5)):
        (bad,) = [f for f in judge_parameters(rules, fine | {name: value}) if f.verdict is not Verdict.FINE]
        assert bad.check == name
        assert bad.wanted


def test_what_follows_from_the_type() -> None:
    rover, x500 = load_config(ROVER), load_config(X500)
    assert on_ground(rover)
    assert not on_ground(x500)
    assert link_parameters(rover).vehicle_types == (10,)
    assert link_parameters(x500) == x500.link.mavlink
    assert body_height(rover) == 0.12
