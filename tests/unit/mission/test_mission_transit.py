"""A mission to a pad out of sight: what belongs together, and what is said where it does not."""

from pathlib import Path

import pytest

from companion.config import load_flight
from companion.errors import InputError
from companion.guidance.plan import SwitchingPolicy, TransitPlan
from companion.mission import flight_plan, load_mission

ROOT = Path(__file__).parents[3]
SURVEYED = "surveyed: {north_m: 18, east_m: -5, heading_deg: 40}"


def written(tmp_path: Path, steps: str, *, surveyed: str = f", {SURVEYED}", config: str = "x500_sim") -> Path:
    path = tmp_path / "m.yaml"
    path.write_text(
        f"version: 1\nname: far\nconfig: {ROOT}/config/{config}.yaml\n"
        f"target: {{pad: {ROOT}/config/pads/landing_pad_0p8.yaml{surveyed}}}\nsteps: {steps}\n"
    )
    return path


def test_the_guidance_gets_the_way_and_the_policy(tmp_path: Path) -> None:
    steps = "[takeoff, transit: {by: odometry, height_m: 5}, land: {policy: fixed, deviate_at_m: 2}]"
    plan = flight_plan(load_mission(written(tmp_path, steps)))
    assert plan.transit == TransitPlan(height_m=5.0, by_ranges=False)
    assert plan.land is not None
    assert (plan.land.policy, plan.land.deviate_at_m) == (SwitchingPolicy.FIXED, 2.0)
    assert flight_plan(load_mission(written(tmp_path, "[takeoff, land]", surveyed=""))).transit is None


@pytest.mark.parametrize(
    ("steps", "surveyed", "said"),
    [
        ("[takeoff, transit, land]", "", "transit without target.surveyed"),
        ("[takeoff, land]", f", {SURVEYED}", "no effect without the step transit"),
        ("[transit, takeoff, land]", f", {SURVEYED}", "the first step is transit"),
        ("[takeoff, search, transit, land]", f", {SURVEYED}", "put transit before search"),
        ("[takeoff, transit]", f", {SURVEYED}", "the mission ends with transit"),
        ("[takeoff, transit, land: {deviate_at_m: 2}]", f", {SURVEYED}", "write `policy: fixed`"),
        ("[takeoff, transit, land: {policy: optimal}]", f", {SURVEYED}", "only for dockings"),
        ("[search, transit, intercept]", f", {SURVEYED}", "transit in a mission on the ground"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path: Path, steps: str, surveyed: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_mission(written(tmp_path, steps, surveyed=surveyed))


def test_ranges_need_an_input_and_a_survey_in_the_pads_frame(tmp_path: Path) -> None:
    mission = written(tmp_path, "[takeoff, transit, land]")
    with pytest.raises(InputError, match="no ranging input"):
        load_flight(mission)
    mission = written(tmp_path, "[takeoff, transit, land]", config="x500_uwb_sim")
    assert load_flight(mission).anchors is not None
    with pytest.raises(InputError, match="frame: pad"):
        load_flight(mission, overrides=[f"ranging.survey={ROOT}/config/anchors/cubesat_mothership.yaml"])


def test_the_way_stays_inside_the_fence(tmp_path: Path) -> None:
    far = ", surveyed: {north_m: 60, east_m: 0, heading_deg: 0}"
    with pytest.raises(InputError, match="outside the fence"):
        load_flight(written(tmp_path, "[takeoff, transit: {by: odometry}, land]", surveyed=far))
    mission = written(tmp_path, "[takeoff, transit: {by: odometry, height_m: 100}, land]")
    with pytest.raises(InputError, match="above the ceiling"):
        load_flight(mission)
