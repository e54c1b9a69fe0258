"""`companion check` tells what the simulated world holds: its wind, and a target that cannot be kept up with."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.campaign.metadata import flight_metadata
from companion.cli import main as cli
from companion.config import load_flight

MISSION = str(Path(__file__).parents[3] / "missions" / "land_moving.yaml")


def world_line(capsys: pytest.CaptureFixture[str], *overrides: str) -> str:
    assert cli.main(["check", MISSION, *(word for text in overrides for word in ("--set", text))]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("world")]
    return line


def test_the_wind_is_told_the_worlds_or_the_missions(capsys) -> None:
    assert world_line(capsys) == "world    moving_pad (only for companion sim); wind 3 m/s"
    assert world_line(capsys, "simulation.wind_mps=6").endswith("; wind 6 m/s")
    assert world_line(capsys, "simulation.wind_mps=0").endswith("; wind none")


@pytest.mark.parametrize(("limit", "remarked"), [(0.4, True), (0.5, False)])
def test_a_target_faster_than_the_limit_is_remarked_and_no_error(capsys, limit: float, remarked: bool) -> None:
    line = world_line(capsys, f"limits.speed_mps={limit}")
    assert ("at up to 0.5 m/s, faster than the limit of 0.4 m/s" in line) is remarked


def test_a_world_without_the_missions_target_is_remarked(capsys) -> None:
    line = world_line(capsys, "simulation.world=rover_follow")
    assert 'there is no "landing pad 0.8 m" in it but "rover target, six boards"' in line
    assert "REMARK" not in world_line(capsys)


def test_a_world_without_dropouts_is_remarked_where_the_mission_asks_for_some(capsys) -> None:
    assert "no dropouts (camera.blind)" in world_line(capsys, "simulation.dropout_s=3")
    assert "REMARK" not in world_line(capsys, "simulation.dropout_s=0")


def test_a_recording_names_the_missions_wind() -> None:
    flight = load_flight(MISSION, overrides=["simulation.wind_mps=6"])
    assert flight_metadata(flight, seed=1, camera="corners")["run"]["wind"] == "6 m/s"
    assert "wind" not in flight_metadata(load_flight(MISSION), seed=1, camera="corners")["run"]
