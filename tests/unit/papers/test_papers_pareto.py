"""The studies beyond the paper: what no other policy beats, points that are one, rows, and what the files say."""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from test_papers_parikh import made_docking, made_flight

from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord
from companion.campaign.spec import Camera
from companion.campaign.versions import project_root
from companion.cli import papers as cli
from companion.config.docking import load_docking
from companion.errors import InputError
from companion.papers.choice import campaign_of, choose
from companion.papers.findings import findings_of
from companion.papers.metrics import DOCKING_TIME, IMPULSE
from companion.papers.pareto_plots import Estimate, Point, front_of, points_of
from companion.papers.spec import load_paper
from companion.recording import Recorder

ROOT = project_root()
PAPER = ROOT / "config" / "papers" / "parikh.yaml"


def trading_flight(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
) -> FlightResult:
    """A careful one takes longer and misses less; as careful as 3 or less is all the same."""
    said = dict(text.split("=", 1) for text in overrides)
    careful = max(3.0, float(said.get("steps.0.dock.careful", 300.0)))
    result = made_docking(seed, "fixed", success=seed % 10 >= 30.0 / careful - 1.0)
    return replace(result, duration_s=100.0 + 0.1 * careful + 0.01 * seed)


def fly(tmp_path: Path, *words: str) -> int:
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    places = ("--store", str(tmp_path / "store"), "--out", str(tmp_path / "out"), "--jobs", "1")
    return cli.fly(parser.parse_args(["parikh", *places, *words]), trading_flight)


def point(name: str, x: float, y: float) -> Point:
    return Point(
        names=(name,),
        series="",
        figures={metric: Estimate(value=value, low=value, high=value) for metric, value in (("x", x), ("y", y))},
    )


def test_the_front_holds_what_nothing_beats() -> None:
    dice = random.Random(1)
    points = [point(str(n), dice.random(), dice.random()) for n in range(60)]
    front = front_of(points, ("x", "y"))
    assert 1 < len(front) < 30

    def as_good(one: Point, other: Point) -> bool:
        return all(one.figures[name].value <= other.figures[name].value for name in ("x", "y"))

    for each in points:
        rivals = [other for other in points if other is not each and as_good(other, each)]
        assert (each in front) == (not rivals)
    twins = [point("a", 1.0, 1.0), point("b", 1.0, 1.0)]
    assert front_of(twins, ("x", "y")) == tuple(twins)  # neither is better


def test_a_study_is_flown_on_the_same_seeds_and_its_points_tell_what_is_traded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--study", "carefulness", "--seeds", "1..10", "--json")
    assert fly(tmp_path, *words) == 0
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    rows = {(row["case"], row["metric"]): row for row in printed["rows"]}
    assert {row["study"] for row in printed["rows"]} == {"carefulness"}
    assert rows["careful 3", "success rate"]["successes"] == 1
    assert rows["careful 100", "success rate"]["successes"] == 10
    assert rows["careful 30", DOCKING_TIME]["ours"] < rows["careful 100", DOCKING_TIME]["ours"]
    assert {saving["against"] for saving in printed["paired"]} == {"fixed"}
    assert [path.name for path in (tmp_path / "out").glob("*.png")] == ["study_carefulness_pareto.png"]
    assert "careful 0.3, seed 1: a miss" in (tmp_path / "out" / "study_carefulness.txt").read_text(encoding="utf-8")


def test_policies_that_come_to_the_same_are_one_point() -> None:

    (part,) = choose(load_paper(PAPER), studies=["carefulness"])
    records = {
        case.name: [
            RunRecord(
                mission="made up",
                seed=seed,
                result=trading_flight(Path(), seed=seed, camera="corners", overrides=case.overrides, recorder=None),
            )
            for seed in range(1, 21)
        ]
        for case in part.cases
    }
    points = {p.label: p for p in points_of(part, findings_of(part, records).rows)}
    assert list(points) == ["fixed", "markov", "λ 0.3 to 3", "λ 10", "λ 30", "λ 100"]
    assert points["λ 0.3 to 3"].figures["misses"].value == pytest.approx(0.9)
    assert points["λ 10"].figures["misses"].low < 0.2 < points["λ 10"].figures["misses"].high
    none_docked = {name: [replace(r, result=None) for r in own] for name, own in records.items()}
    assert points_of(part, findings_of(part, none_docked).rows) == ()


def test_studies_are_flown_only_where_asked_for() -> None:
    paper = load_paper(PAPER)
    assert all(part.exhibit.study is None for part in choose(paper))
    assert [part.exhibit.label for part in choose(paper, studies=["impulse"])] == ["study impulse"]
    with pytest.raises(InputError, match="there are carefulness, impulse"):
        choose(paper, studies=["mass"])


def test_every_study_is_in_order() -> None:
    """Every lambda of the harder world's table is a case; the tables of the weights come of the same flights."""
    paper = load_paper(PAPER)
    campaign = campaign_of(paper, choose(paper, studies=["carefulness", "impulse"]), camera="corners", runs=None)
    dockings = {case.name: load_docking(case.missions[0], overrides=case.overrides) for case in campaign.cases}
    hard = [docking for name, docking in dockings.items() if "careful " in name]
    assert {docking.mission.world for docking in hard} == {"docking_hard"}
    table = hard[0].table
    assert table is not None
    assert table.provenance.world == "docking_hard"
    assert [docking.mission.step.careful for docking in hard] == [policy.carefulness for policy in table.policies]
    weighed = {name: docking.table for name, docking in dockings.items() if "weight " in name}
    for name, each in weighed.items():
        assert each is not None
        assert each.provenance.weights.impulse_weight == float(name.rpartition(" ")[2])
    assert len({each.provenance.seeds for each in weighed.values() if each}) == 1


def test_a_table_that_is_not_there_is_refused_in_place(tmp_path: Path) -> None:
    folder = tmp_path / "config" / "papers"
    folder.mkdir(parents=True)
    for name in ("missions", "config/policies"):
        (tmp_path / name).symlink_to(ROOT / name)
    text = PAPER.read_text(encoding="utf-8").replace("docking_weight_3.yaml", "docking_weight_4.yaml")
    (folder / "parikh.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"docking_weight_4\.yaml.*\n?.*companion study policy"):
        load_paper(folder / "parikh.yaml")


def test_without_misses_only_time_and_impulse_are_traded(tmp_path: Path) -> None:
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    places = ("--store", str(tmp_path / "store"), "--out", str(tmp_path / "out"), "--jobs", "1")
    words = ("--study", "impulse", "--seeds", "1,2", "--case", "fixed", "--case", "markov")
    assert cli.fly(parser.parse_args(["parikh", *places, *words]), made_flight) == 0
    text = (tmp_path / "out" / "study_impulse.txt").read_text(encoding="utf-8")
    assert f"markov against fixed, {IMPULSE}: 20.0% less" in text
    assert (tmp_path / "out" / "study_impulse_pareto.png").stat().st_size > 10_000
