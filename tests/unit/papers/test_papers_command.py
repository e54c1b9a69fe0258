"""`companion papers` with flights that are made up: choice, refusals, files, exit codes."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from companion.campaign.result import FlightResult, StationKeeping
from companion.campaign.seeds import drawn_seeds
from companion.campaign.spec import Camera
from companion.campaign.versions import current_commit, project_root
from companion.cli import papers as cli
from companion.config import load_flight
from companion.errors import InputError
from companion.papers.choice import campaign_of, choose
from companion.papers.spec import load_paper
from companion.recording import Recorder

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "campaign"))

from campaign_results import made_result

ROOT = project_root()
PATEL = ROOT / "config" / "papers" / "patel.yaml"
FLOWN: list[tuple[str, int, tuple[str, ...], Camera]] = []


def made_flight(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
) -> FlightResult:
    """Land well; seed 13 lands badly."""
    FLOWN.append((mission_path.stem, seed, tuple(overrides), camera))
    if recorder is not None:
        for step in range(100):
            target = {
                "name": "pad",
                "position_ned": [0.1 * step, 0.0, -0.15],
                "yaw": 0.0,
                "velocity_ned": [0.5, 0.0, 0.0],
                "moving": step > 20,
            }
            truth = {
                "t": 0.1 * step,
                "position_ned": [0.1 * step - 0.3, 0.0, -3.0],
                "velocity_ned": [0.0, 0.0, 0.0],
                "quaternion": [1.0, 0.0, 0.0, 0.0],
                "armed": True,
                "feet_in_contact": 0,
                "targets": [target],
            }
            recorder.record("truth", 0.1 * step, truth)
    good = seed != 13
    keeping = StationKeeping(position_mean_m=0.1, position_std_m=0.05, angle_mean_rad=0.004, angle_std_rad=0.004)
    return made_result(
        seed, success=good, position_error_m=0.01 if good else 4.0, station_keeping=keeping, duration_s=90.0
    )


def arguments(tmp_path: Path, *words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    places = ("--store", str(tmp_path / "store"), "--out", str(tmp_path / "out"), "--jobs", "1")
    return parser.parse_args(["patel", *places, *words])


def test_bad_words_are_refused_with_what_is_right(tmp_path: Path) -> None:
    for words, message in (
        (["--table", "7"], "there are 1, 2, 3, 4, 5"),
        (["--table", "4", "--case", "case 8"], "there are case 1, case 2"),
        (["--table", "4", "--runs", "0"], "not a number of flights"),
        (["--table", "4", "--jobs", "0"], "not a number of processes"),
    ):
        FLOWN.clear()
        with pytest.raises(InputError, match=message):
            cli.fly(arguments(tmp_path, *words), made_flight)
        assert FLOWN == []
    with pytest.raises(InputError, match=r"there are .*patel"):
        cli.fly(argparse.Namespace(**{**vars(arguments(tmp_path)), "paper": "newton"}), made_flight)


def test_a_table_is_flown_case_by_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    FLOWN.clear()
    code = cli.fly(
        arguments(tmp_path, "--table", "4", "--seeds", "1,2", "--camera", "corners", "--wind", "5", "--json"),
        made_flight,
    )
    assert code == 0
    assert len(FLOWN) == 14
    assert {stem for stem, *_ in FLOWN} == {"patel_uav_follow"}
    assert {camera for *_, camera in FLOWN} == {"corners"}
    assert all("simulation.wind_mps=5" in overrides for _, _, overrides, _ in FLOWN)
    worlds = {overrides[0] for _, _, overrides, _ in FLOWN}
    assert worlds == {f"simulation.world=patel_uav_{n}" for n in range(1, 8)}
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert len(printed["rows"]) == 7 * 5
    assert {row["table"] for row in printed["rows"]} == {4}
    assert all(row["trials"] == 2 and row["successes"] == 2 for row in printed["rows"])
    assert json.loads((tmp_path / "out" / "rows.json").read_text())["rows"] == printed["rows"]
    assert "case 7" in (tmp_path / "out" / "table_4.txt").read_text(encoding="utf-8")
    for picture in ("paths", "errors", "figures"):
        assert (tmp_path / "out" / f"table_4_{picture}.png").stat().st_size > 10_000


def test_a_figure_without_printed_values_is_flown_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    FLOWN.clear()
    words = ("--figure", "10", "--case", "5 s", "--case", "5 s, no prediction", "--seeds", "1,2", "--json")
    assert cli.fly(arguments(tmp_path, *words), made_flight) == 0
    assert [overrides[2:] for _, _, overrides, _ in FLOWN] == [()] * 2 + [("prediction.method=none",)] * 2
    captured = capsys.readouterr()
    rows = json.loads(captured.out.splitlines()[-1])["rows"]
    assert len(rows) == 2 * 3
    assert {row["figure"] for row in rows} == {10}
    assert all(row["published"] is None and row["better"] is None and row["ours"] is not None for row in rows)
    assert "nothing is published to compare with" in captured.err
    for picture in ("paths", "errors", "figures"):
        assert (tmp_path / "out" / f"figure_10_{picture}.png").stat().st_size > 10_000


def test_a_dropout_is_coasted_through_and_nothing_longer() -> None:
    paper = load_paper(PATEL)
    campaign = campaign_of(paper, choose(paper, figures=[10]), camera="corners", runs=None)
    lengths = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12)
    asked = [case.overrides for case in campaign.cases]
    assert [overrides[:2] for overrides in asked] == 2 * [
        (f"simulation.dropout_s={n}", f"on_target_lost.coast_s={n + 1}") for n in lengths
    ]
    assert [overrides[2:] for overrides in asked] == 11 * [()] + 11 * [("prediction.method=none",)]


def test_it_resumes_and_a_bad_success_rate_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--table", "3", "--case", "case 2", "--json"]
    assert cli.fly(arguments(tmp_path, *words, "--seeds", "1,2"), made_flight) == 0
    FLOWN.clear()
    assert cli.fly(arguments(tmp_path, *words, "--seeds", "1,2,13"), made_flight) == 1
    assert [seed for _, seed, _, _ in FLOWN] == [13]
    rows = {row["metric"]: row for row in json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]}
    assert rows["success rate"]["better"] is False
    assert rows["position error"]["better"] is False


def test_seeds_come_from_the_commit_and_differ_from_case_to_case(tmp_path: Path) -> None:
    FLOWN.clear()
    assert cli.fly(arguments(tmp_path, "--table", "4", "--runs", "3"), made_flight) == 0
    seeds = [seed for _, seed, _, _ in FLOWN]
    assert len(set(seeds)) == 21
    assert tuple(seeds[:3]) == drawn_seeds(current_commit(ROOT).hash, "patel table 4 case 1", 3)
    assert {camera for *_, camera in FLOWN} == {"rendered"}


def test_every_case_of_the_free_flyer_is_in_order() -> None:
    """The top speed is the fastest target's; figure 11 is a grid of nine settings, twice."""
    paper = load_paper(PATEL)
    cases = campaign_of(paper, choose(paper, tables=[5], figures=[11]), camera="corners", runs=None).cases
    flights = [load_flight(case.missions[0], overrides=case.overrides) for case in cases]
    assert {flight.config.vehicle.free_flyer.speed for flight in flights} == {0.1}
    assert {(flight.camera.width, flight.camera.height) for flight in flights} == {(640, 480)}
    assert [flight.mission.world for flight in flights[:4]] == [f"patel_free_flyer_{n}" for n in range(1, 5)]
    settings = [
        (flight.mission.interval_s, flight.mission.corrupted_fraction, flight.config.prediction.method == "none")
        for flight in flights[4:]
    ]
    grid = [(interval, share) for interval in (0.1, 0.5, 1.0) for share in (0.0, 0.25, 0.5)]
    assert settings == [(*each, blind) for blind in (False, True) for each in grid]


def test_every_case_of_the_rover_is_in_order() -> None:
    """A standoff of 1.25 m in all; out of sight for no longer than is allowed, 5 s where the target leaves the view."""
    paper = load_paper(PATEL)
    cases = campaign_of(paper, choose(paper, tables=[1, 2], figures=[8]), camera="corners", runs=None).cases
    assert [case.seeds for case in cases] == [10] * (2 + 6) + [15] * 2
    flights = [load_flight(case.missions[0], overrides=case.overrides) for case in cases]
    assert {flight.plan.ground.standoff_m for flight in flights} == {1.25}
    assert {(flight.camera.width, flight.camera.height) for flight in flights} == {(640, 480)}
    assert [flight.plan.lost.coast_s for flight in flights] == [4.0] * 8 + [5.0] * 2
    assert [flight.mission.world for flight in flights[2:8]] == [f"patel_rover_{n}" for n in range(1, 7)]
    assert [flight.config.prediction.method == "none" for flight in flights[8:]] == [False, True]


def test_every_case_that_is_flown_is_in_order() -> None:
    """Missions, overrides and worlds; in the cases of table 4 the speed limit is the fastest target's speed."""
    paper = load_paper(PATEL)
    chosen = choose(paper, tables=[3, 4], figures=[10])
    campaign = campaign_of(paper, chosen, camera="corners", runs=None)
    assert [case.seeds for case in campaign.cases] == [10] * (9 + 22)
    for case in campaign.cases:
        flight = load_flight(case.missions[0], overrides=case.overrides)
        assert flight.config.vehicle.multicopter.speed_horizontal == 1.0
        assert (flight.camera.width, flight.camera.height) == (640, 480)
        assert [tag.size for tag in flight.pad.tags]
        assert flight.plan.land is not None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("    vehicle: uav\n", "    vehicle: drone\n"), "vehicle"),
        (("missions/papers/patel_uav_fixed.yaml", "missions/papers/patel_uav_fixt.yaml"), "there is no file"),
        (("  - table: 2\n", "  - table: 1\n"), "table 1 stands twice"),
        (("  - table: 2\n", "  - table: 2\n    figure: 3\n"), "neither a table nor a figure, or both"),
        (("      - name: case 2\n", "      - name: case 1\n"), "two cases of one name"),
        (("measures: [station_position_m,", "measures: [station_position,"), "no such figure: station_position;.*"),
        (("station_angle_rad: 0.006", "station_angle: 0.006"), "did you mean station_angle_rad"),
    ],
)
def test_a_wrong_paper_is_refused_with_its_place(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    folder = tmp_path / "config" / "papers"
    folder.mkdir(parents=True)
    (tmp_path / "missions").symlink_to(ROOT / "missions")
    path = folder / "patel.yaml"
    path.write_text(PATEL.read_text(encoding="utf-8"), encoding="utf-8")
    assert load_paper(path).name == "patel"
    path.write_text(PATEL.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_paper(path)
