"""`companion papers` with a real flight: the short form of a table."""

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
