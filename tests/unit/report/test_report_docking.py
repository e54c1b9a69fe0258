"""The picture and the page of a docking, from a recording of one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from companion.campaign.docking import run_docking
from companion.campaign.versions import project_root
from companion.recording import MemoryRecorder, Recording
from companion.report import draw_flight, write_page
from companion.report.docking_series import docking_of
from companion.report.series import flight_of
from companion.report.solids import cone_points, cube_corners

MISSION = project_root() / "missions" / "papers" / "parikh_docking.yaml"


@pytest.fixture(scope="module")
def recording() -> Recording:
    recorder = MemoryRecorder({"run": {"mission": "test", "seed": "2"}})
    run_docking(MISSION, seed=2, overrides=["steps.0.dock.timeout_s=20"], recorder=recorder)
    return recorder.recording()


def test_a_recording_comes_apart_into_true_errors(recording: Recording) -> None:
    run = docking_of(recording)
    assert run is not None
    assert flight_of(recording) is None
    first = recording.of("proximity")[0].data["position"]
    assert run.estimate.position_error[0] == pytest.approx(np.array(first) - run.truth.position[0])
    assert run.range[0] == pytest.approx(np.linalg.norm(run.truth.position[0] - [1.0, 1.9, 1.0]))
    assert run.attitude[0] == pytest.approx(2.0 * np.pi / 3.0, abs=0.2)
    assert run.estimate.position_std[0] == pytest.approx(0.05, rel=0.01)
    assert [span.mode for span in run.modes] == ["wait", "approach", "hold"]
    assert run.modes[1].end == run.modes[2].start
    assert not run.seen[1].any()


def test_the_port_is_seen_while_pictures_are_new(recording: Recording) -> None:
    picture = recording.of("gyro")[0]
    seen = tuple(dataclasses.replace(picture, t=t) for t in (5.0, 5.05, 5.1))
    run = docking_of(dataclasses.replace(recording, messages={**recording.messages, "features": seen}))
    assert run is not None
    t, found = run.seen
    assert t[found > 0.5][[0, -1]] == pytest.approx([5.0, 5.2])


def test_a_picture_and_a_page_are_written_and_repeat_themselves(recording: Recording, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        draw_flight(recording, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    write_page(recording, tmp_path / "flight.html")
    page = (tmp_path / "flight.html").read_text(encoding="utf-8")
    assert "Held: given up: it holds, clear of the target" in page
    assert "impulse of all nozzles" in page
    assert "policy" in page


def test_one_that_ends_early_is_drawn_as_far_as_it_goes(recording: Recording, tmp_path: Path) -> None:
    early = {name: records[: len(records) // 3] for name, records in recording.messages.items() if name != "result"}
    early["scene"] = recording.messages["scene"]
    draw_flight(dataclasses.replace(recording, messages=early, complete=False), tmp_path / "early.png")
    assert (tmp_path / "early.png").stat().st_size > 10_000


def test_cubes_and_cones_have_their_sizes() -> None:
    corners = cube_corners(np.array([1.0, 2.0, 3.0]), np.eye(3), 0.2)
    assert corners.min(axis=0) == pytest.approx([0.9, 1.9, 2.9])
    assert corners.max(axis=0) == pytest.approx([1.1, 2.1, 3.1])
    down = np.diag([1.0, -1.0, -1.0])
    points = cone_points(np.zeros(3), down, np.radians(30.0), 0.5)
    away = points[1:] - points[0]
    assert points[1:, 2] == pytest.approx(-0.5)
    assert np.arccos(-away[:, 2] / np.linalg.norm(away, axis=1)) == pytest.approx(np.radians(30.0))
