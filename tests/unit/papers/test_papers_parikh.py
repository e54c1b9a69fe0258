"""`companion papers parikh` with dockings that are made up: pairs, failures, pictures; and the estimator's cost."""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from companion.campaign.result import DockingFigures, FlightResult, Outcome
from companion.campaign.run import RunRecord
from companion.campaign.spec import Camera
from companion.campaign.versions import project_root
from companion.cli import papers as cli
from companion.config import load_flight
from companion.config.docking import load_docking
from companion.errors import InputError
from companion.messages.docking import DockingMode, DockingSwitch
from companion.papers.choice import campaign_of, choose
from companion.papers.computer import ratio_sentence, rows_on_computer
from companion.papers.estimator_cost import count_operations
from companion.papers.findings import findings_of
from companion.papers.pairs import savings_of
from companion.papers.spec import load_paper
from companion.recording import Recorder
from companion.runtime.docking.wiring import proximity_setup

ROOT = project_root()
PAPER = ROOT / "config" / "papers" / "parikh.yaml"
SAVED = {"fixed": (1.0, 1.0), "markov": (0.9, 0.8), "optimal": (0.8, 0.7)}  # time and impulse, shares of fixed


def made_docking(seed: int, policy: str = "fixed", *, success: bool = True) -> FlightResult:
    """Dock in 100 s and more; another policy needs the same share of it on every seed."""
    time, impulse = SAVED[policy]
    duration = time * (100.0 + seed)
    return FlightResult(
        outcome=Outcome.DOCKED if success else Outcome.FAILED,
        success=success,
        reason="" if success else "a miss beside the docking face",
        position_error_m=0.003,
        angular_error_rad=0.004,
        station_keeping=None,
        duration_s=duration,
        touchdown_speed_mps=0.01,
        mode_history=tuple(
            DockingSwitch(t=share * duration, mode=mode, reason="made up")
            for share, mode in ((0.01, DockingMode.APPROACH), (0.5, DockingMode.REORIENT), (0.8, DockingMode.DOCK))
        ),
        limits_violated=(),
        tracking_gap_s=None,
        wall_s=1.0,
        seed=seed,
        docking=DockingFigures(
            policy=policy,
            impulse_ns=impulse * (0.3 + 0.01 * seed),
            lateral_speed_mps=0.001,
            reorient_range_m=0.7,
            align_range_m=None,
            attempts=1,
            outliers=10,
            outliers_rejected=10,
            ranges=100,
            ranges_rejected=0,
        ),
    )


def made_flight(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
) -> FlightResult:
    """Fly straight to the port; seed 13 misses."""
    policy = next((text.split("=")[1] for text in overrides if "policy" in text), "fixed")
    result = made_docking(seed, policy, success=seed != 13)
    if recorder is not None:
        for step in range(40):
            share = step / 39
            position = [share, 1.0 + 0.9 * share, share]
            data = {"position": position, "quaternion": [1.0, 0.0, 0.0, 0.0], "impulse_ns": 0.3 * share}
            recorder.record("truth", share * result.duration_s, data)
    return result


def arguments(tmp_path: Path, *words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    places = ("--store", str(tmp_path / "store"), "--out", str(tmp_path / "out"), "--jobs", "1")
    return parser.parse_args(["parikh", *places, *words])


def records(policy: str, seeds: Sequence[int], missed: Sequence[int] = ()) -> list[RunRecord]:
    made = [made_docking(seed, policy, success=seed not in missed) for seed in seeds]
    return [RunRecord(mission="m", seed=result.seed, result=result) for result in made]


def test_table_two_is_flown_drawn_and_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.fly(arguments(tmp_path, "--table", "2", "--seeds", "1,2,13", "--json"), made_flight)
    captured = capsys.readouterr()
    printed = json.loads(captured.out.splitlines()[-1])
    assert code == 0
    rows = {(row["case"], row["metric"]): row for row in printed["rows"]}
    assert rows["fixed", "success rate"]["ours"] == pytest.approx(2 / 3)
    assert rows["markov", "total impulse"]["published"] == 9.2679
    assert rows["markov", "total impulse"]["better"] is None  # another vehicle's: only ratios say something
    paired = {(saving["case"], saving["metric"]): saving for saving in printed["paired"]}
    assert paired["markov", "docking time"]["ours"] == pytest.approx(0.1)
    assert paired["markov", "docking time"]["published"] == pytest.approx(0.0957, abs=1e-4)
    assert paired["markov", "total impulse"]["published"] == pytest.approx(0.1407, abs=1e-4)
    assert {saving["pairs"] for saving in printed["paired"]} == {2}  # seed 13 docks with none
    assert "markov against fixed, docking time: 10.0% less" in captured.err
    text = (tmp_path / "out" / "table_2.txt").read_text(encoding="utf-8")
    assert "3 failed:" in text
    assert "optimal, seed 13: a miss beside the docking face" in text
    for picture in ("trajectories", "switching", "figures"):
        assert (tmp_path / "out" / f"table_2_{picture}.png").stat().st_size > 10_000


def test_figures_of_a_tables_flights_fly_nothing_more(tmp_path: Path) -> None:
    words = ("--table", "2", "--figure", "5", "--figure", "6", "--case", "fixed", "--seeds", "1")
    assert cli.fly(arguments(tmp_path, *words), made_flight) == 0
    assert len(list((tmp_path / "store").rglob("*.json"))) == 1
    drawn = sorted(path.name for path in (tmp_path / "out").glob("figure*.png"))
    assert drawn == ["figure_5_trajectories.png", "figure_6_switching.png"]


def test_starts_of_figure_eight_are_drawn_together(tmp_path: Path) -> None:
    assert cli.fly(arguments(tmp_path, "--figure", "8", "--seeds", "1"), made_flight) == 0
    assert (tmp_path / "out" / "figure_8_trajectories.png").stat().st_size > 10_000


def test_table_one_counts_the_operations_and_flies_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.fly(arguments(tmp_path, "--table", "1", "--json"), made_flight) == 0
    captured = capsys.readouterr()
    rows = {(r["case"], r["unit"]): r for r in json.loads(captured.out.splitlines()[-1])["rows"]}
    assert rows["tandem", "FLOP"]["ours"] < 0.5 * rows["compounded", "FLOP"]["ours"]
    assert rows["tandem", "ms"]["ours"] > 0.0
    assert "operations, tandem / compounded" in captured.err
    assert not (tmp_path / "store").exists()


def test_operations_are_counted_the_same_each_time_and_grow_with_the_states() -> None:
    setup = proximity_setup(load_docking(ROOT / "missions" / "papers" / "parikh_docking.yaml"))
    tandem = count_operations(setup, "tandem")
    assert tandem == count_operations(setup, "tandem")
    assert 1000 < tandem < count_operations(setup, "compounded")


def test_a_case_of_the_computer_must_name_a_structure() -> None:
    (part,) = choose(load_paper(PAPER), tables=[1])
    case = part.exhibit.cases[0]
    with pytest.raises(InputError, match="one of compounded, tandem"):
        rows_on_computer(part.exhibit, type(case)(name="square root", what="x", mission=case.mission))
    assert ratio_sentence(()) == ""


def test_a_saving_is_the_ratio_of_the_means_over_common_seeds_only() -> None:
    (part,) = choose(load_paper(PAPER), tables=[2])
    flown = {"fixed": records("fixed", range(1, 30)), "markov": records("markov", range(11, 40), missed=(12, 13))}
    savings = {saving.metric: saving for saving in savings_of(part.exhibit, flown)}
    assert {saving.pairs for saving in savings.values()} == {17}
    impulse = savings["total impulse"]
    assert impulse.ours == pytest.approx(0.2)
    assert impulse.low == pytest.approx(0.2)  # the same share on every seed: nothing is left to chance
    assert impulse.high == pytest.approx(0.2)


def test_the_interval_of_a_saving_shrinks_with_pairs_and_knows_nothing_of_what_pairs_share() -> None:
    (part,) = choose(load_paper(PAPER), tables=[2], cases=["fixed", "markov"])
    rng = np.random.default_rng(1)
    widths = []
    for count in (20, 320):
        seeds = range(1, count + 1)  # the times themselves differ by far more than their shares
        noisy = [
            dataclasses.replace(r, result=dataclasses.replace(r.result, duration_s=r.result.duration_s + noise))
            for r, noise in zip(records("markov", seeds), rng.normal(0.0, 2.0, count), strict=True)
        ]
        saving, _ = savings_of(part.exhibit, {"fixed": records("fixed", seeds), "markov": noisy})
        assert saving.low is not None
        assert saving.high is not None
        assert saving.ours is not None
        assert saving.low < saving.ours < saving.high
        assert abs(saving.ours - 0.1) < saving.high - saving.low
        widths.append(saving.high - saving.low)
    assert 0.005 < widths[0] < 0.03
    assert widths[1] < 0.4 * widths[0]


def test_unpaired_cases_are_not_compared() -> None:
    (part,) = choose(load_paper(PAPER), figures=[8])
    flown = {case.name: records("fixed", (1, 2)) for case in part.cases}
    found = findings_of(part, flown)
    assert found.savings == ()
    assert found.failures == ("no failures",)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("    flights_of: 2\n", "    flights_of: 7\n"), "there is no such table"),
        (("    vehicle: cubesat\n    flights_of: 2\n", "    vehicle: cubesat\n"), "give a case, or flights_of"),
        (("not_compared: [impulse_ns]", "not_compared: [impulse]"), "no such figure: impulse"),
    ],
)
def test_a_wrong_paper_is_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    folder = tmp_path / "config" / "papers"
    folder.mkdir(parents=True)
    for name in ("missions", "config/policies"):
        (tmp_path / name).symlink_to(ROOT / name)
    text = PAPER.read_text(encoding="utf-8")
    assert change[0] in text
    (folder / "parikh.yaml").write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_paper(folder / "parikh.yaml")


def test_every_case_that_is_flown_is_in_order() -> None:
    paper = load_paper(PAPER)
    campaign = campaign_of(paper, choose(paper), camera="corners", runs=None)
    assert [case.seeds for case in campaign.cases] == [500] * 3 + [5] * 8 + [5] * 2 + [5] * 6
    for case in campaign.cases[:11]:
        docking = load_docking(case.missions[0], overrides=case.overrides)
        assert docking.mission.world in ("docking", "docking_hull")
    landings = [load_flight(case.missions[0], overrides=case.overrides) for case in campaign.cases[11:]]
    assert all(flight.plan.transit is not None for flight in landings)
    assert [flight.plan.transit.by_ranges for flight in landings if flight.plan.transit] == [False, True] + 3 * [
        False
    ] + 3 * [True]
    policies = [
        (flight.plan.land.policy.value, flight.plan.land.deviate_at_m) for flight in landings if flight.plan.land
    ]
    assert policies[2:5] == policies[5:] == [("fixed", 3.0), ("fixed", 1.5), ("markov", 3.0)]
