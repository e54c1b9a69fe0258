from pathlib import Path

import pytest

from companion.errors import InputError
from companion.guidance.plan import FollowUntil as PlanUntil
from companion.mission import (
    AfterSearch,
    Envelope,
    Follow,
    FollowUntil,
    Hold,
    Land,
    Mission,
    Search,
    Takeoff,
    check_envelope,
    flight_plan,
    load_mission,
    mission_from,
    open_mission,
)
from companion.mission.docking import names_docking

MISSIONS = sorted(path for path in (Path(__file__).parents[3] / "missions").glob("*.yaml") if not names_docking(path))
HEAD = "version: 1\nname: test\nconfig: ../config/c.yaml\ntarget: {pad: pads/p.yaml}\n"


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "missions"
    folder.mkdir()

    def write_mission(text: str) -> str:
        (folder / "m.yaml").write_text(HEAD + text)
        return "missions/m.yaml"

    return write_mission


def lines_of(path: str, *overrides: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load_mission(path, overrides)
    return [str(problem) for problem in caught.value.problems]


def test_the_shortest_mission_has_five_lines(write) -> None:
    mission = load_mission(write("steps: [takeoff, land]\n"))
    assert mission.steps == (Takeoff(), Land())
    assert (mission.name, mission.world) == ("test", "static_pad")


@pytest.mark.parametrize(
    "steps",
    [
        "steps:\n  - takeoff\n  - land\n",
        "steps:\n  - takeoff:\n  - land:\n",
        "steps:\n  - takeoff: {}\n  - land: {}\n",
        "steps:\n- takeoff: {height_m: 4}\n- land: {max_attempts: 3}\n",
    ],
)
def test_a_step_with_defaults_may_be_written_in_any_way(write, steps: str) -> None:
    assert load_mission(write(steps)).steps == (Takeoff(), Land())


def test_paths_count_from_the_file_and_from_set_from_the_current_directory(write) -> None:
    path = write("steps: [takeoff, land]\nsimulation: {world: worlds/w.yaml}\n")
    mission = load_mission(path)
    assert (mission.config, mission.pad) == (Path("config/c.yaml"), Path("missions/pads/p.yaml"))
    assert mission.world == "missions/worlds/w.yaml"
    changed = load_mission(path, ["config=other.yaml", "simulation.world=random_pad"])
    assert (changed.config, changed.pad, changed.world) == (Path("other.yaml"), mission.pad, "random_pad")


def test_overrides_reach_into_steps_even_where_they_are_written_short(write) -> None:
    path = write("steps: [takeoff, search, land]\n")
    mission = load_mission(path, ["steps.0.takeoff.height_m=2.5", "steps.2.land.max_attempts=1"])
    assert mission.steps == (Takeoff(height_m=2.5), Search(), Land(max_attempts=1))
    assert load_mission(path, ["steps.2=hold"]).steps[-1] == Hold()


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ("steps: [land]", "5:9: steps.0: the first step is land; begin with `- takeoff"),
        ("steps: []", "found an empty list; it must be a list"),
        ("steps:", "found nothing; it must be a list"),
        ("stepps: [takeoff]", "5:1: stepps: no such key; did you mean steps?"),
        ("steps: [takeoff, hover]", '5:18: steps.1: no such step "hover"; a step is one of takeoff, transit, search'),
        ("steps: [takeof, land]", "did you mean takeoff?"),
        ("steps:\n - takeoff:\n   height_m: 3\n - land", "indent height_m further, below takeoff"),
        ("steps: [takeoff, {}]", "an empty step"),
        ("steps: [takeoff, {search: , land: }]", "begin each step on its own line"),
        ("steps: [takeoff, land, hold]", "5:18: steps.1.land: land is followed by hold; land must be the last step"),
        ("steps: [takeoff, hold, land]", "hold must be the last step"),
        ("steps: [takeoff, follow, search, land]", "put search before follow"),
        ("steps: [takeoff, search, takeoff, land]", "a second takeoff"),
        ("steps: [takeoff, search]", "the mission ends with search"),
        ("steps: [takeoff]", "the mission ends with takeoff"),
        ("steps: [takeoff, {follow: {until: time}}]", "until: time without a time"),
        ("steps: [takeoff, {follow: {for_s: 200}}]", "for_s (200 s) is longer than at_most_s (180 s)"),
        ("steps: [takeoff, {follow: {until: stopped}}]", "it must be target_stopped or time"),
        ("steps: [takeoff, {land: {max_attempts: 0}}]", "a whole number at least 1 and at most 20"),
        ("steps: [{takeoff: {height_m: -4}}, land]", "found -4; it must be a number greater than 0 and at most 120"),
        ("steps: [{takeoff: 4}, land]", "found 4; it must be a mapping with the key height_m"),
        ("steps: takeoff", 'found the text "takeoff"; it must be a list'),
    ],
)
def test_wrong_steps_are_explained(write, steps: str, expected: str) -> None:
    found = lines_of(write(steps + "\n"))
    assert len(found) == 1, found
    assert expected in found[0]
    assert found[0].startswith("missions/m.yaml:")


def test_wrong_steps_and_wrong_values_are_reported_together(write) -> None:
    found = lines_of(write("steps: [takeoff, fly, {land: {max_atempts: 3}}]\nlimits: {speed_mps: .nan}\n"))
    assert len(found) == 3


def test_follow_ends_with_time_where_a_time_is_given() -> None:
    assert Follow().ends is FollowUntil.TARGET_STOPPED
    assert Follow(for_s=60.0).ends is FollowUntil.TIME
    assert Follow(for_s=60.0, until=FollowUntil.TARGET_STOPPED).ends is FollowUntil.TARGET_STOPPED


ENVELOPE = Envelope(speed_mps=3.0, height_m=14.0, radius_m=49.0)


def envelope_lines(path: str) -> list[str]:
    document = open_mission(path)
    return [str(problem) for problem in check_envelope(document, mission_from(document), ENVELOPE)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("steps: [takeoff, land]\nlimits: {speed_mps: 4}", "limits.speed_mps: 4 is more than the configuration allows"),
        ("steps: [{takeoff: {height_m: 15}}, land]", "15 m is above the ceiling of 14 m"),
        ("steps: [{takeoff: {height_m: 5}}, land]\nlimits: {height_m: 4.5}", "5 m is above the ceiling of 4.5 m"),
        ("steps: [takeoff, {follow: {height_m: 20}}]", "20 m is above the ceiling of 14 m"),
        ("steps: [takeoff, {search: {radius_m: 50}}, land]", "50 m leaves the fence, whose radius is 49 m"),
        ("steps: [takeoff, search, land]\nlimits: {radius_m: 8}", "10 m leaves the fence, whose radius is 8 m"),
    ],
)
def test_a_mission_can_only_tighten(write, text: str, expected: str) -> None:
    (line,) = envelope_lines(write(text + "\n"))
    assert expected in line


def test_a_mission_inside_the_envelope_has_no_problem(write) -> None:
    path = write(
        "steps: [takeoff, search, follow, land]\nlimits: {speed_mps: 3, height_m: 14, closing_speed_mps: 99}\n"
    )
    assert envelope_lines(path) == []


def test_flight_plan_of_a_full_mission(write) -> None:
    text = """\
steps:
  - takeoff: {height_m: 5}
  - search: {height_m: 6, radius_m: 7, timeout_s: 8}
  - follow: {height_m: 2, for_s: 30, match_heading: false}
  - land: {max_attempts: 4}
on_target_lost: {coast_s: 1, hold_s: 2, search_s: 3, then: return}
"""
    mission = load_mission(write(text))
    plan = flight_plan(mission)
    assert plan.takeoff_height_m == 5.0
    assert (plan.search.height_m, plan.search.radius_m, plan.search.timeout_s) == (6.0, 7.0, 8.0)
    assert plan.follow is not None
    assert (plan.follow.height_m, plan.follow.until, plan.follow.for_s) == (2.0, PlanUntil.TIME, 30.0)
    assert not plan.follow.match_heading
    assert plan.land is not None
    assert plan.land.max_attempts == 4
    assert (plan.lost.coast_s, plan.lost.hold_s, plan.lost.search_s) == (1.0, 2.0, 3.0)
    assert mission.on_target_lost.then is AfterSearch.RETURN


def test_flight_plan_of_a_hold(write) -> None:
    plan = flight_plan(load_mission(write("steps: [{takeoff: {height_m: 7}}, {hold: {for_s: 12}}]\n")))
    assert (plan.follow, plan.land, plan.hold_s, plan.search.height_m) == (None, None, 12.0, 7.0)


@pytest.mark.parametrize("path", MISSIONS, ids=lambda p: p.stem)
def test_every_mission_of_the_project_loads(path: Path) -> None:
    assert isinstance(load_mission(path), Mission)
    assert path.read_text().startswith("# yaml-language-server: $schema=../config/schema/mission.schema.json\n")


def test_a_landing_by_the_autopilot_is_planned_as_such(write) -> None:
    plan = flight_plan(load_mission(write("output: landing_target\nsteps: [takeoff, land]\n")))
    assert plan.land is not None
    assert plan.land.by_autopilot
    assert not flight_plan(load_mission(write("steps: [takeoff, land]\n"))).land.by_autopilot


def test_a_landing_by_the_autopilot_needs_a_landing(write) -> None:
    (line,) = lines_of(write("output: landing_target\nsteps: [takeoff, hold]\n"))
    assert "landing_target without a landing" in line


def test_what_the_autopilot_would_not_keep_is_refused(write) -> None:
    lines = lines_of(
        write("output: landing_target\nsteps:\n  - takeoff\n  - land: {descent_mps: 0.4, cone_half_angle_deg: 9}\n")
    )
    assert len(lines) == 2
    assert all("has no effect" in line for line in lines)
