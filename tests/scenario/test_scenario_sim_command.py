"""`companion sim` as its users see it: result, exit code, recording."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from companion.cli.main import main
from companion.recording import read_recording

ROOT = Path(__file__).resolve().parents[2]
LAND_STATIC = str(ROOT / "missions" / "land_static.yaml")
FIELDS = {
    "outcome": str,
    "success": bool,
    "reason": str,
    "position_error_m": float,
    "angular_error_rad": float,
    "station_keeping": (dict, type(None)),
    "duration_s": float,
    "touchdown_speed_mps": float,
    "mode_history": list,
    "limits_violated": list,
    "wall_s": float,
    "seed": int,
}


def sim(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, object], str]:
    """Run `companion sim --json`; give the exit code, the result and what was said beside it."""
    code = main(["sim", LAND_STATIC, "--camera", "corners", "--json", *words])
    said = capsys.readouterr()
    return code, json.loads(said.out.splitlines()[-1]), said.err


def test_lands_and_says_how(capsys: pytest.CaptureFixture[str]) -> None:
    code, result, said = sim(capsys, "--seed", "2")
    assert code == 0
    assert result["outcome"] == "landed"
    assert result["success"] is True
    assert result["seed"] == 2
    assert result["wind_mps"] == 3.0  # of the mission's world
    assert 0.0 <= result["position_error_m"] < 0.3  # type: ignore[operator]
    for name, kind in FIELDS.items():
        assert isinstance(result[name], kind), name  # type: ignore[arg-type]
    for switch in result["mode_history"]:  # type: ignore[attr-defined]
        assert math.isfinite(switch["t"])
        assert switch["mode"]
        assert switch["reason"]
    assert "touchdown" in said
    assert "position error" in said
    assert re.search(r"wind +3 m/s", said)


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("first", "second"):
        sim(capsys, "--seed", "5", "--record", str(tmp_path / name))
    first, second = ((tmp_path / name / "flight.mcap").read_bytes() for name in ("first", "second"))
    assert first == second
    assert {path.name for path in (tmp_path / "first").iterdir()} == {
        "flight.mcap",
        "flight.png",
        "flight.html",
        "summary.json",
    }
    assert (tmp_path / "first" / "flight.png").read_bytes() == (tmp_path / "second" / "flight.png").read_bytes()
    summary = json.loads((tmp_path / "first" / "summary.json").read_text())
    recording = read_recording(tmp_path / "first" / "flight.mcap")
    recorded = dict(recording.messages["result"][-1].data)
    assert summary.pop("wall_s") > 0.0
    assert recorded == summary
    assert recording.metadata["run"]["seed"] == "5"


def test_another_seed_gives_another_flight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the ground already: other noise."""
    seen = []
    for seed in ("5", "6"):
        folder = tmp_path / seed
        sim(capsys, "--seed", seed, "--fault", "refuse_arming=gps", "--record", str(folder))
        messages = read_recording(folder / "flight.mcap").messages["ownship"]
        seen.append([message.data["position_ned"] for message in messages])
    assert seen[0] != seen[1]


def test_a_refusal_to_arm_shows_every_reason(capsys: pytest.CaptureFixture[str]) -> None:
    code, result, said = sim(capsys, "--fault", "refuse_arming=gps")
    assert code == 1
    assert result["outcome"] == "refused"
    assert result["success"] is False
    for text in ("GPS fix too low", "event 29146769", "unhealthy: GPS", "answer to the arm command"):
        assert text in str(result["reason"])
        assert text in said


def test_no_heartbeat(capsys: pytest.CaptureFixture[str]) -> None:
    code, result, _ = sim(capsys, "--fault", "no_heartbeat")
    assert code == 3
    assert result["success"] is False
    assert "no heartbeat within 10 s" in str(result["reason"])
    assert result["mode_history"] == []
    assert 10.0 <= result["duration_s"] < 10.5  # type: ignore[operator]


def test_a_plane_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    code, result, _ = sim(capsys, "--fault", "vehicle_type=fixed_wing", "--realtime")
    assert code == 3
    assert result["outcome"] == "refused"
    assert "fixed wing" in str(result["reason"])
    assert result["wall_s"] >= 0.9  # type: ignore[operator]  # paced: it looks on for a second


def test_an_impatient_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--set", "engagement.vehicle_timeout_s=1.5", "--set", "simulation.wind_mps=6")
    code, result, _ = sim(capsys, "--fault", "no_heartbeat", *words)
    assert code == 3
    assert result["wind_mps"] == 6.0  # the mission's, instead of its world's
    assert "no heartbeat within 1.5 s" in str(result["reason"])


def test_quiet_says_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", LAND_STATIC, "--camera", "corners", "--quiet", "--fault", "vehicle_type=rover"]) == 3
    said = capsys.readouterr()
    assert said.err == ""
    assert len(said.out.splitlines()) == 1
    assert said.out.startswith("refused: ")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--fault", "gremlins"], "unknown fault 'gremlins'; known: no_heartbeat"),
        (["--set", "steps.0.takeoff.height_m=-4"], "height_m"),
        (["--set", "nothing=4"], "no such key"),
        (["--set", "simulation.world=atlantis"], "atlantis"),
        (["--config", "missing.yaml"], "missing.yaml"),
    ],
)
def test_bad_input_starts_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    folder = tmp_path / "recording"
    assert main(["sim", LAND_STATIC, "--camera", "corners", "--record", str(folder), *words]) == 2
    said = capsys.readouterr()
    assert text in said.err
    assert said.out == ""
    assert not folder.exists()


@pytest.mark.parametrize("seed", ["-1", "one", "1.5", ""])
def test_a_seed_is_a_whole_number(capsys: pytest.CaptureFixture[str], seed: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(["sim", LAND_STATIC, f"--seed={seed}"])
    assert end.value.code == 2
    assert "--seed" in capsys.readouterr().err


def test_a_recording_that_cannot_be_written_is_told_before_the_flight(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = tmp_path / "a file"
    taken.write_text("")
    assert main(["sim", LAND_STATIC, "--camera", "corners", "--record", str(taken)]) == 2
    said = capsys.readouterr()
    assert "a file" in said.err
    assert "takeoff" not in said.out
