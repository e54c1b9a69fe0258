"""`companion study anchors`: what it reads, prints and writes, and what it refuses."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from companion.cli.main import main
from companion.ranging.survey_file import load_survey

ROOT = Path(__file__).resolve().parents[3]
WORLD = str(ROOT / "sitl_stub/cubesat/worlds/docking.yaml")
WAY = ["--port", str(ROOT / "config/docks/cubesat_port.yaml"), "--start", "0", "1", "0"]
SMALL = ["--grid", "5", "--slice", "0.5"]
BUNCHED = """\
version: 1
name: four in a corner
frame: {frame}
anchors:
  - {{id: 4, position_m: [1.0, -0.2, 0.5]}}
  - {{id: 5, position_m: [1.0, 0.2, 0.3]}}
  - {{id: 6, position_m: [1.0, 0.2, -0.1]}}
  - {{id: 7, position_m: [0.7, -0.2, 0.5]}}
"""
LINE = """\
version: 1
name: on a line
frame: mothership
anchors:
  - {id: 1, position_m: [0, 0, 0]}
  - {id: 2, position_m: [1, 0, 0]}
  - {id: 3, position_m: [2, 0, 0]}
"""


def study(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert main(["study", "anchors", *words, "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["study", "anchors", *words]) == 2
    return capsys.readouterr().err


def test_a_world_by_name_or_file_and_a_mission_are_the_same_set_up(capsys) -> None:
    found = [
        study(capsys, word, *SMALL, "--no-search")
        for word in ("docking", WORLD, str(ROOT / "missions/dock_cubesat.yaml"))
    ]
    assert found[0]["map"] == found[1]["map"]
    assert found[0]["map"]["worst"]["std_m"] == pytest.approx(found[2]["map"]["worst"]["std_m"], rel=1e-6)
    assert found[0]["corridors"]["start"]["reorient_range_m"] == pytest.approx(0.693, abs=1e-3)
    assert "mirror image" in found[0]["remarks"][0]
    assert found[0]["proposal"] is None


def test_the_proposal_is_written_as_a_survey_and_the_map_as_a_table(capsys, tmp_path) -> None:
    given, survey, out = tmp_path / "given.yaml", tmp_path / "better.yaml", tmp_path / "out"
    given.write_text(BUNCHED.format(frame="mothership"))
    box = ["--box", "-1", "1", "-0.2", "0.2", "-0.5", "0.5"]
    words = [str(given), *WAY, *SMALL, *box, "--survey", str(survey)]
    found = study(capsys, *words, "--out", str(out))
    proposal = found["proposal"]
    assert not proposal["kept"]
    assert proposal["improvement_percent"] > 20.0
    assert proposal["map"]["worst"]["std_m"] < found["map"]["worst"]["std_m"]
    assert load_survey(survey).positions.tolist() == proposal["anchors"]
    assert [anchor.id for anchor in load_survey(survey).anchors] == [4, 5, 6, 7]
    rows = list(csv.DictReader((out / "map.csv").read_text().splitlines()))
    assert len(rows) == found["map"]["starts"]
    assert max(float(row["std_m"]) for row in rows) == pytest.approx(found["map"]["worst"]["std_m"], rel=1e-5)
    assert json.loads((out / "study.json").read_text()) == found
    assert (out / "anchors.png").stat().st_size > 10_000
    assert "the file exists" in refusal(capsys, *words)
    assert main(["study", "anchors", *words, "--force"]) == 0
    again = capsys.readouterr().out
    assert f"written: {survey}" in again
    assert load_survey(survey).positions.tolist() == proposal["anchors"]  # the same search, the same places
    assert "proposal  over starts and ways" in again


def test_good_anchors_are_kept_and_nothing_is_written(capsys, tmp_path) -> None:
    pad, survey = str(ROOT / "config/anchors/pad_four.yaml"), tmp_path / "nothing.yaml"
    words = ["--region", "-8", "8", "-8", "8", "--slice", "-1", "-3", "-6", "--grid", "7", "--survey", str(survey)]
    assert main(["study", "anchors", pad, *words]) == 1
    said = capsys.readouterr().out
    assert "none: no better places" in said
    assert "ranges 20 mm at 50 Hz" in said
    assert "change them by --range-std, --range-rate" in said
    assert not survey.exists()


def test_the_anchors_of_a_pad_alone(capsys, tmp_path) -> None:
    given = tmp_path / "pad.yaml"
    given.write_text(BUNCHED.format(frame="pad"))
    box = ["--box", "-3", "3", "-3", "3", "-1.2", "-0.1"]
    found = study(capsys, str(given), "--grid", "5", "--slice", "-3", "-6", "--count", "5", *box)
    assert found["acceleration_noise"] == 0.2  # a multirotor's
    assert found["map"]["best"]["range_m"] is None
    assert found["corridors"] == {}
    anchors = found["proposal"]["anchors"]
    assert len(anchors) == 5
    assert all(abs(abs(x) - 3.0) < 1e-3 or abs(abs(y) - 3.0) < 1e-3 for x, y, _ in anchors)  # not above the pad


def test_a_survey_with_a_port_and_a_start_has_a_way(capsys) -> None:
    words = [str(ROOT / "config/anchors/cubesat_mothership.yaml"), *WAY, *SMALL, "--no-search"]
    found, own = study(capsys, *words), study(capsys, "docking", *SMALL, "--no-search")
    assert found["corridors"]["start"]["worst"] == own["corridors"]["start"]["worst"]


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["nowhere"], "no docking world 'nowhere'"),
        (["nowhere.yaml"], "nowhere.yaml"),
        ([str(ROOT / "missions/land_static.yaml")], "give a docking mission"),
        ([str(ROOT / "sitl_stub/world/worlds/calm_pad.yaml")], "give a docking mission"),
        ([WORLD, "--count", "2"], "3 to 8"),
        ([WORLD, "--count", "9"], "3 to 8"),
        ([WORLD, "--grid", "1"], "3 to 201"),
        ([WORLD, "--region", "1", "0", "0", "1"], "X0 < X1"),
        ([WORLD, "--start", "1", "1.95", "1"], "inside or beside the target"),
        ([WORLD, "--start", "0", "0", "0"], "outside of the mother-ship"),
        ([WORLD, "--start", "0", "-1", "-0.5"], "in sight of the port"),
        ([WORLD, "--region", "-0.5", "0.5", "-0.1", "0.1", "--slice", "0"], "give another region"),
        ([WORLD, *SMALL, "--faces", "top"], "x-,x+"),
        ([WORLD, *SMALL, "--box", "0", "0", "0", "0", "0", "1"], "two of its sides"),
        ([WORLD, *SMALL, "--count", "8", "--spacing", "1.5"], "use fewer anchors"),
        ([WORLD, "--no-search", "--survey", "x.yaml"], "proposes nothing"),
        ([WORLD, "--start", "nan", "0", "0"], "--start nan 0 0: not a finite number"),
        ([WORLD, "--box", "0", "1", "0", "1", "0", "inf"], "--box 0 1 0 1 0 inf: not a finite number"),
        ([WORLD, "--survey", "nowhere/x.yaml"], "there is no folder nowhere; make it"),
        ([WORLD, "--survey", str(ROOT)], "this is a directory"),
        ([WORLD, "--out", WORLD], "this is a file; give a folder"),
        ([WORLD, *WAY[:2]], "names its own port"),
    ],
)
def test_bad_input_is_refused_with_what_would_be_right(words: list[str], part: str, capsys) -> None:
    assert part in refusal(capsys, *words)


def test_anchors_on_a_line_are_refused(capsys, tmp_path) -> None:
    path = tmp_path / "line.yaml"
    path.write_text(LINE)
    assert "all anchors lie on one line" in refusal(capsys, str(path))
    path.write_text(LINE.rsplit("\n", 2)[0] + "\n")
    assert "two anchors" in refusal(capsys, str(path))
    path.write_text("version: 1\nname: none\nframe: mothership\nanchors: []\n")
    assert "anchors" in refusal(capsys, str(path))


def test_anchors_that_determine_nothing_where_starts_are_are_told(capsys, tmp_path) -> None:
    path = tmp_path / "flat.yaml"
    path.write_text(LINE.replace("mothership", "pad").replace("[1, 0, 0]", "[1, 1, 0]"))  # a plane, and starts in it
    words = ["--region", "-1", "1", "-1", "1", "--slice", "0", "--grid", "4", "--count", "4"]
    found = study(capsys, str(path), *words, "--box", "-2", "2", "-2", "2", "-2", "0", "--out", str(tmp_path / "out"))
    assert found["map"]["undetermined"] == found["map"]["starts"] > 8
    assert found["map"]["worst"]["std_m"] is None
    assert found["proposal"]["given"]["rms_m"] is None
    assert found["proposal"]["improvement_percent"] == 100.0
    assert found["proposal"]["map"]["undetermined"] == 0


def test_the_help_names_the_study(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", "--help"])
    assert ended.value.code == 0
    assert "anchors" in capsys.readouterr().out
