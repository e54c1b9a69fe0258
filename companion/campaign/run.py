"""One run of a campaign: fly, and keep what the table needs."""

from __future__ import annotations

import hashlib
import re
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np

from companion.campaign.consistency import NeesSeries, nees_of
from companion.campaign.metadata import mission_metadata
from companion.campaign.named_files import named_files
from companion.campaign.path import DockingPath, FlightPath, PathRecorder, path_from_json
from companion.campaign.result import FlightResult
from companion.campaign.spec import Camera, CaseKind
from companion.errors import InputError, Problem, RecordingError
from companion.recording import RECORDING_NAME, SUMMARY_NAME, McapRecorder, Recorder, read_recording, write_json


class RunFlight(Protocol):
    """Flies one mission in the simulator: `companion.campaign.mission.run_mission`."""

    def __call__(
        self, mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
    ) -> FlightResult:
        """Fly.

        Args:
            mission_path: the mission.
            seed: of the simulation.
            camera: pictures, or tag corners directly.
            overrides: texts `a.b=value`.
            recorder: takes the recording, and is closed at the end; None: nothing is kept.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One flight to be made."""

    case: str
    kind: CaseKind
    mission: Path
    seed: int
    camera: Camera
    overrides: tuple[str, ...]
    record_dir: Path | None
    keep_path: bool = False  # keep the thinned-out path with the result; flights without recordings only

    @property
    def file_name(self) -> str:
        """Where its record is kept, below the directory of the code's fingerprint."""
        settings = "\n".join((self.case, self.kind.value, self.mission.as_posix(), self.camera, *self.overrides))
        settings += "\npath" if self.keep_path else ""
        settings += named_files(self.mission, self.overrides)
        digest = hashlib.sha256(settings.encode()).hexdigest()[:8]
        case = re.sub(r"[^a-z0-9]+", "_", self.case.lower()).strip("_")
        return f"{case}/{self.mission.stem}-{self.camera}-{digest}-{self.seed}.json"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunRecord:
    """What is kept of one run."""

    mission: str
    seed: int
    result: FlightResult | None = None  # None: the run crashed
    identical: bool | None = None  # repeat: both recordings are equal
    nees: NeesSeries | None = None  # consistency
    path: FlightPath | DockingPath | None = None  # where the task asked for it
    crash: str | None = None  # traceback
    problems: tuple[Problem, ...] = ()  # the input was wrong: nothing was flown

    @property
    def success(self) -> bool:
        """Whether the flight reached its goal; where a repetition was asked, whether it repeated itself."""
        if self.identical is not None:
            return self.identical
        return self.result is not None and self.result.success

    @property
    def reason(self) -> str:
        """Why it did not, or how well it did."""
        if self.result is None:
            return (self.crash or "no result").strip().splitlines()[-1]
        return "two recordings of the same seed differ" if self.identical is False else self.result.reason

    def as_json(self) -> dict[str, Any]:
        """Give plain values, of a run that did not crash."""
        return {
            "mission": self.mission,
            "seed": self.seed,
            "result": None if self.result is None else self.result.as_json(),
            "identical": self.identical,
            "nees": None if self.nees is None else [self.nees.epoch.tolist(), self.nees.nees.tolist()],
            "path": None if self.path is None else self.path.as_json(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> RunRecord:
        """Read what `as_json` gave.

        Raises:
            KeyError, TypeError, ValueError: it is something else.
        """
        nees, path = data["nees"], data["path"]
        return cls(
            mission=data["mission"],
            seed=data["seed"],
            result=FlightResult.from_json(data["result"]),
            identical=data["identical"],
            nees=None if nees is None else NeesSeries(epoch=np.array(nees[0]), nees=np.array(nees[1])),
            path=None if path is None else path_from_json(path),
        )


def perform(task: Task, run_flight: RunFlight) -> RunRecord:
    """Make one run; a crash becomes part of its record, so that the others go on."""
    cv2.setNumThreads(1)
    mission = task.mission.stem
    try:
        if task.kind is CaseKind.FLIGHTS:
            result, path = _fly(task, run_flight)
            return RunRecord(mission=mission, seed=task.seed, result=result, path=path)
        with tempfile.TemporaryDirectory(prefix="campaign-") as name:
            return _compare(task, run_flight, Path(name))
    except InputError as error:
        return RunRecord(mission=mission, seed=task.seed, problems=error.problems)
    except Exception:
        return RunRecord(mission=mission, seed=task.seed, crash=traceback.format_exc())


def _compare(task: Task, run_flight: RunFlight, folder: Path) -> RunRecord:
    first = task.record_dir or folder / "first"
    record = RunRecord(mission=task.mission.stem, seed=task.seed, result=_fly_recorded(task, run_flight, first))
    if task.kind is CaseKind.CONSISTENCY:
        return replace(record, nees=nees_of(read_recording(first / RECORDING_NAME)))
    _fly_recorded(task, run_flight, folder / "second")
    return replace(record, identical=_contents(first) == _contents(folder / "second"))


def _fly(task: Task, run_flight: RunFlight) -> tuple[FlightResult, FlightPath | DockingPath | None]:
    if task.record_dir is not None:
        return _fly_recorded(task, run_flight, task.record_dir), None
    if not task.keep_path:
        return _call(task, run_flight, None), None
    recorder = PathRecorder()
    return _call(task, run_flight, recorder), recorder.path


def _fly_recorded(task: Task, run_flight: RunFlight, folder: Path) -> FlightResult:
    metadata = mission_metadata(task.mission, seed=task.seed, camera=task.camera, overrides=task.overrides)
    recorder = McapRecorder(folder / RECORDING_NAME, metadata)
    try:
        result = _call(task, run_flight, recorder)
    finally:
        recorder.close()
    state = recorder.state
    if state.problem is not None:
        raise RecordingError(f"{state.problem} ({state.dropped} messages lost)")
    write_json(folder / SUMMARY_NAME, result.as_json())
    return result


def _call(task: Task, run_flight: RunFlight, recorder: Recorder | None) -> FlightResult:
    return run_flight(task.mission, seed=task.seed, camera=task.camera, overrides=task.overrides, recorder=recorder)


def _contents(folder: Path) -> bytes:
    return hashlib.sha256((folder / RECORDING_NAME).read_bytes()).digest()
