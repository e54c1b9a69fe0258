"""Docking missions on the command line: sim, check, and what fly says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from companion.campaign.docking import SimulatedDocking
from companion.campaign.versions import project_root
from companion.cli import main as cli
from companion.cli.outcome import figures
from companion.cli.sim_docking import progress_line
from companion.config.docking import load_docking
from companion.errors import InputError

ROOT = project_root()
MISSION = str(ROOT / "missions" / "papers" / "parikh_docking.yaml")
LANDING = str(ROOT / "missions" / "land_static.yaml")
CUBESAT = str(ROOT / "config" / "cubesat_sim.yaml")
X500 = str(ROOT / "config" / "x500_sim.yaml")


def test_a_docking_is_simulated_recorded_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["sim", MISSION, "--seed", "3", "--json", "--record", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    printed = json.loads(captured.out.splitlines()[-1])
    assert printed["outcome"] == "docked"
    assert printed["docking"]["policy"] == "markov"
    assert printed["position_error_m"] < 0.015
    for words in (
        "approach",
        "reorient",
        "turned at (r2)",
        "impulse",
        "ranges rejected",
        "picture",
        "switched on: it waits until",
    ):
        assert words in captured.err
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "flight.html",
        "flight.mcap",
        "flight.png",
        "summary.json",
    ]
    assert json.loads((tmp_path / "summary.json").read_text())["docking"] == printed["docking"]
    assert "closing speed" in (tmp_path / "flight.html").read_text(encoding="utf-8")


def test_one_that_gives_up_ends_with_its_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["sim", MISSION, "--quiet", "--set", "steps.0.dock.timeout_s=3"]) == 1
    assert capsys.readouterr().out == "held: given up: it holds, clear of the target\n"


def test_the_progress_line_says_where_it_stands() -> None:
    docking = load_docking(MISSION)
    simulated = SimulatedDocking(docking, seed=1)
    step = simulated.pipeline.step(0.0, [])
    line = progress_line(step, docking.port.docked_position, None)
    away = np.linalg.norm(step.state.position - docking.port.docked_position)
    assert line == f"    0.0 s  wait         {away:.3f} m to go  position +- 50.0 mm"
    assert progress_line(step, docking.port.docked_position, 40.0).endswith("40.0 x real time")


def test_the_figures_of_a_docking_without_contact_leave_out_what_needs_one() -> None:
    result = SimulatedDocking(load_docking(MISSION, overrides=["steps.0.dock.timeout_s=2"]), seed=1).run().as_json()
    names = [name for name, _ in figures(result)]
    assert "closing speed" not in names
    assert names[:2] == ["reason", "policy"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--camera", "corners"], "--camera: a docking's camera gives the port's markers"),
        (["--fault", "refuse_arming=gps"], "--fault: a docking spacecraft has no autopilot"),
        (["--config", X500], "describes no docking spacecraft: it has no key spacecraft"),
        (["--set", "simulation.world=moon"], "no docking world 'moon': give a file that ends in .yaml, or one of"),
        (["--set", "steps.0.dock.policy=best"], 'found the text "best"; it must be one of fixed, markov, optimal'),
        (["--set", "target.dock=nope.yaml"], "target.dock: nope.yaml: no such file"),
        (["--set", "steps.0.dock.careful=30"], "only with policy: optimal, and the policy is markov; leave it out"),
        (
            ["--set", "steps.0.dock.align_range_m=0.2"],
            "only with policy: fixed, and the policy is markov; leave it out",
        ),
        (
            ["--set", "steps.0.dock.policy=fixed", "--set", "steps.0.dock.align_range_m=0.8"],
            "0.8 m is not below reorient_range_m (0.8 m)",
        ),
        (["--set", "limits.speed_mps=0.1"], "0.1 is more than the configuration allows, which is 0.02"),
        (["--set", "limits.closing_speed_mps=0.1"], "0.1 is more than the configuration allows, which is 0.01"),
        (["--set", "spacecraft.control.thrust=-1"], "spacecraft.control.thrust"),
        (["--set", "simulation.start_m=[1, 1.9, 1]"], "starts inside or beside the target"),
        (["--set", "wind=1"], "no such key"),
    ],
)
def test_bad_input_is_refused_with_what_is_right(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["sim", MISSION, *words]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""


def test_values_of_the_files_policy_stay_where_another_policy_is_set_for_comparison(tmp_path: Path) -> None:
    text = Path(MISSION).read_text(encoding="utf-8").replace("../../config", str(ROOT / "config"))
    mission = tmp_path / "m.yaml"
    mission.write_text(text.replace("policy: markov", "policy: optimal, careful: 30"))
    assert load_docking(mission).mission.step.careful == 30.0
    assert load_docking(mission, overrides=["steps.0.dock.policy=fixed"]).mission.step.careful == 30.0
    mission.write_text(text.replace("policy: markov", "policy: fixed, careful: 30"))
    with pytest.raises(InputError, match="careful has an effect only with policy: optimal"):
        load_docking(mission)


@pytest.mark.parametrize("verb", ["sim", "check", "fly"])
def test_a_flight_with_a_spacecrafts_configuration_is_refused(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([verb, LANDING, "--config", CUBESAT]) == 2
    assert "this is the configuration of a docking spacecraft, which has no autopilot" in capsys.readouterr().err


def test_markers_on_a_line_and_wrong_configurations_are_told_where_they_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    port = yaml.safe_load((ROOT / "config" / "docks" / "cubesat_port.yaml").read_text(encoding="utf-8"))
    port["markers_m"] = [[0.01 * k, 0.0, 0.05] for k in range(4)]
    (tmp_path / "port.yaml").write_text(yaml.safe_dump(port))
    mission = yaml.safe_load(Path(MISSION).read_text(encoding="utf-8"))
    mission |= {"config": X500, "target": {"dock": "port.yaml"}}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(mission))
    assert cli.main(["check", str(tmp_path / "m.yaml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert any("all markers lie on one line" in line for line in lines)
    assert any(": config: " in line and "describes no docking spacecraft" in line for line in lines)


def test_check_says_what_will_be_flown_and_what_the_anchors_do_not_tell(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", MISSION]) == 0
    shown = capsys.readouterr().out
    assert "dock, switching by the Markov model; 3 attempts and 300 s at most" in shown
    assert "all anchors lie in one plane" in shown
    assert "1.68 m and 120 deg to go" in shown
    assert shown.endswith("all in order\n")
    assert cli.main(["check", MISSION, "--set", "steps.0.dock.policy=fixed", "--set", "limits.speed_mps=0.01"]) == 0
    shown = capsys.readouterr().out
    assert "switching at 0.8 and 0.3 m" in shown
    assert "approach 0.01 m/s" in shown


def test_check_prints_plain_values_and_the_effective_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", MISSION, "--json"]) == 0
    good = json.loads(capsys.readouterr().out)
    assert (good["ok"], good["policy"], good["world"]) == (True, "markov", "docking")
    assert len(good["remarks"]) == 1
    assert cli.main(["check", MISSION, "--json", "--set", "steps.0.dock.careful=-1"]) == 2
    assert json.loads(capsys.readouterr().out)["problems"][0]["key"] == "steps.0.dock.careful"
    assert cli.main(["check", MISSION, "--dump", "--set", "limits.speed_mps=0.01"]) == 0
    assert yaml.safe_load(capsys.readouterr().out)["guidance"]["motion"]["approach_speed"] == 0.01


def test_an_impossible_spacecraft_is_an_error_of_its_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["check", MISSION, "--set", "spacecraft.control.nozzle_places=[[0.05, 0, 0]]"]
    assert cli.main([*words, "--set", "spacecraft.control.nozzle_directions=[[1, 0, 0]]"]) == 2
    assert "cubesat_sim.yaml: " in capsys.readouterr().err


def test_fly_refuses_before_anything_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["fly", MISSION, "--record", str(tmp_path / "r")]) == 2
    captured = capsys.readouterr()
    assert "cannot be flown on hardware yet: there is no driver that opens nozzles" in captured.err
    assert not (tmp_path / "r").exists()
    assert cli.main(["doctor", "--mission", MISSION]) == 2
    assert "cannot be flown on hardware yet" in capsys.readouterr().err
