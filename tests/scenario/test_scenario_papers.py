"""`companion papers` with real flights: the short forms of a table and of the figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from companion.cli.main import main


def test_a_case_is_flown_and_held_against_the_paper(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--table", "3", "--case", "case 2", "--seeds", "1", "--camera", "corners", "--jobs", "1", "--json"]
    code = main(["papers", "patel", *words, "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")])
    rows = {row["metric"]: row for row in json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]}
    assert code == 0
    assert set(rows) == {"position error", "angular error", "success rate"}
    assert rows["success rate"]["successes"] == 1
    assert 0.0 < rows["position error"]["ours"] < 0.2
    assert rows["position error"]["published"] == 0.049
    [kept] = (tmp_path / "store").rglob("*.json")
    path = json.loads(kept.read_text())["path"]
    assert len(path) > 300
    moved = max(row[9] for row in path)
    assert moved == 1.0
    assert path[-1][1:3] == pytest.approx(path[-1][5:7], abs=0.2)  # stands on the landing point


@pytest.mark.parametrize(
    ("figure", "case", "metric", "most"),
    [
        ("8", "with prediction", "RMSE of the predicted path", 0.3),
        ("10", "2 s", "station-keeping position error", 0.4),
        ("11", "0.5 s, p 0.5", "station-keeping position error", 0.05),
    ],
)
def test_what_goes_out_of_sight_is_met_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], figure: str, case: str, metric: str, most: float
) -> None:
    words = ["--figure", figure, "--case", case, "--seeds", "2", "--camera", "corners", "--jobs", "1", "--json"]
    main(["papers", "patel", *words, "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")])
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert next(row for row in rows if row["metric"] == "success rate")["successes"] == 1
    assert 0.0 < next(row for row in rows if row["metric"] == metric)["ours"] < most
    [kept] = (tmp_path / "store").rglob("*.json")
    result = json.loads(kept.read_text())["result"]
    if figure == "8":
        assert len(result["forecast_path"]) > 30  # drawn beside where the target went
