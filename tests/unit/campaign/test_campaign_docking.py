"""Simulated dockings: what counts, what is kept, and that the same seed gives the same docking."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.campaign.docking import SimulatedDocking, run_docking
from companion.campaign.mission import run_mission
from companion.campaign.path import DockingPath, FlightPath, PathRecorder, path_from_json
from companion.campaign.result import FlightResult, Outcome
from companion.campaign.run import RunRecord
from companion.campaign.runner import Options, tasks_of
from companion.campaign.seeds import SeedChoice
from companion.campaign.versions import project_root
from companion.config.docking import load_docking
from companion.errors import InputError
from companion.papers.choice import campaign_of, choose
from companion.papers.spec import load_paper
from companion.recording import McapRecorder
from sitl_stub.cubesat.contact import COLLISION, DOCKING_FACE, Contact

ROOT = project_root()
MISSION = ROOT / "missions" / "papers" / "parikh_docking.yaml"
SHORT = ("steps.0.dock.timeout_s=6",)  # it gives up before anything can touch


class Touching:
    """The simulation, but for a contact that comes at a given time."""

    def __init__(self, inner: Any, contact: Contact, at: float) -> None:
        self._inner, self._contact, self._at = inner, contact, at

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    @property
    def ended(self) -> bool:
        return bool(self._inner.t >= self._at)

    @property
    def truth(self) -> Any:
        truth = self._inner.truth
        return dataclasses.replace(truth, contact=self._contact) if self.ended else truth


def touched(**changed: Any) -> FlightResult:
    """Score a run that touches the target after 2 s, well unless told otherwise."""
    contact = Contact(
        t=2.0,
        kind=DOCKING_FACE,
        position_error=(0.003, 0.0, 0.004),
        attitude_error=0.01,
        closing_speed=0.009,
        lateral_speed=0.001,
        docked=True,
    )
    contact = dataclasses.replace(contact, **changed)
    simulated = SimulatedDocking(load_docking(MISSION), seed=1)
    simulated.simulation = Touching(simulated.simulation, contact, 2.0)  # type: ignore[assignment]
    return simulated.run()


def test_a_good_contact_is_a_docking() -> None:
    result = touched()
    assert result.outcome is Outcome.DOCKED
    assert result.success
    assert result.duration_s == 2.0
    assert result.position_error_m == pytest.approx(0.005)
    assert result.touchdown_speed_mps == 0.009
    assert result.docking is not None
    assert (result.docking.lateral_speed_mps, result.docking.attempts) == (0.001, 1)
    assert result.mode_history[-1].mode.value == "docked"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"docked": False, "position_error": (0.03, 0.0, 0.04)}, "a miss on the docking face at 2.0 s: 50.0 mm"),
        ({"docked": False, "kind": COLLISION}, "a miss beside the docking face"),
        ({"docked": False, "closing_speed": 0.03}, "closing 30.0 mm/s"),
    ],
)
def test_misses_and_collisions_are_failures(changed: dict[str, Any], words: str) -> None:
    result = touched(**changed)
    assert result.outcome is Outcome.FAILED
    assert not result.success
    assert words in result.reason


def test_a_docking_that_runs_out_of_time_is_none() -> None:
    result = run_docking(MISSION, seed=1, overrides=SHORT)
    assert result.outcome is Outcome.HELD
    assert not result.success
    assert result.position_error_m is None


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    contents = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        recorder = McapRecorder(tmp_path / name / "flight.mcap", {})
        run_docking(MISSION, seed=seed, overrides=SHORT, recorder=recorder)
        contents.append((tmp_path / name / "flight.mcap").read_bytes())
    assert contents[0] == contents[1]
    assert contents[0] != contents[2]


def test_any_mission_is_flown_by_what_it_is() -> None:
    recorder = PathRecorder()
    result = run_mission(MISSION, seed=2, camera="corners", overrides=SHORT, recorder=recorder)
    assert result.docking is not None
    assert isinstance(recorder.path, DockingPath)
    assert FlightResult.from_json(json.loads(json.dumps(result.as_json()))) == result
    with pytest.raises(InputError, match="no such key"):
        run_mission(MISSION, seed=2, camera="corners", overrides=["simulation.wind_mps=3"], recorder=None)
    with pytest.raises(InputError, match=r"limits\.height_m"):
        run_mission(
            ROOT / "missions" / "land_static.yaml",
            seed=2,
            camera="corners",
            overrides=["limits.height_m=900"],
            recorder=None,
        )


def test_a_path_of_either_kind_comes_back_as_itself() -> None:
    docking = DockingPath(
        t=np.array([0.0, 0.5]),
        position=np.array([[0.0, 1.0, 0.0], [0.01, 1.0, 0.0]]),
        quaternion=np.array([[1.0, 0.0, 0.0, 0.0]] * 2),
        impulse=np.array([0.0, 0.01]),
    )
    back = path_from_json(json.loads(json.dumps(docking.as_json())))
    assert isinstance(back, DockingPath)
    assert np.array_equal(back.position, docking.position)
    assert np.array_equal(back.impulse, docking.impulse)
    flight = path_from_json([[0.0] * 10])
    assert isinstance(flight, FlightPath)
    assert isinstance(path_from_json([]), FlightPath)
    with pytest.raises(ValueError, match="reshape"):
        path_from_json([[1.0, 2.0]])


def test_a_record_of_a_docking_comes_back_as_itself() -> None:
    recorder = PathRecorder()
    result = run_docking(MISSION, seed=2, overrides=SHORT, recorder=recorder)
    record = RunRecord(mission="parikh_docking", seed=2, result=result, path=recorder.path)
    back = RunRecord.from_json(json.loads(json.dumps(record.as_json())))
    assert back.result == result
    assert isinstance(back.path, DockingPath)
    assert len(back.path.t) == len(recorder.path.t)


def test_policies_are_flown_with_the_same_seeds() -> None:
    paper = load_paper(ROOT / "config" / "papers" / "parikh.yaml")
    chosen = choose(paper, tables=[2], figures=[5, 6])
    campaign = campaign_of(paper, chosen, camera="corners", runs=4)
    assert len(campaign.cases) == 3  # figures 5 and 6 show the flights of table 2
    tasks = tasks_of(campaign, SeedChoice(given=None, count=None), "ab" * 20, Options())
    by_case = {case.name: [task.seed for task in tasks if task.case == case.name] for case in campaign.cases}
    assert len({tuple(seeds) for seeds in by_case.values()}) == 1
    assert len(set(next(iter(by_case.values())))) == 4


def test_the_start_can_be_moved_but_not_into_the_target() -> None:
    moved = SimulatedDocking(load_docking(MISSION, overrides=["simulation.start_m=[0.5, 0.4, 0.6]"]), seed=1)
    usual = SimulatedDocking(load_docking(MISSION), seed=1)
    offset = np.array(moved.simulation.truth.position) - np.array(usual.simulation.truth.position)
    assert offset == pytest.approx([0.5, -0.6, 0.6])
    with pytest.raises(InputError, match="starts inside or beside the target"):
        SimulatedDocking(load_docking(MISSION, overrides=["simulation.start_m=[1.0, 1.9, 1.0]"]), seed=1)


def test_a_world_that_is_not_the_one_surveyed_is_refused(tmp_path: Path) -> None:
    text = (ROOT / "sitl_stub" / "cubesat" / "worlds" / "docking.yaml").read_text(encoding="utf-8")
    world = tmp_path / "five.yaml"
    world.write_text(text.replace("\ntarget:", "  - {position_m: [0.0, 0.0, 2.0]}\n\ntarget:", 1), encoding="utf-8")
    with pytest.raises(InputError, match="has 5 anchors, but 4 are known"):
        run_docking(MISSION, seed=1, overrides=[f"simulation.world={world}"])
