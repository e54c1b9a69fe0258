"""The planner's process of `companion fly`: camera, detector, mission, recording and display."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import signal
import socket
import sys
import traceback
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
from rich.console import Console

from companion.camera.opencv import OpenCvCamera, OpenCvCameraParameters
from companion.camera.source import CameraSource
from companion.campaign.result import Outcome
from companion.cli.camera_wait import wait_for_camera
from companion.cli.live import BackgroundDisplay, LiveLine
from companion.cli.main import NO_VEHICLE, PLANNER_DIED, guarded
from companion.cli.outcome import exit_code, tell
from companion.clock import ElapsedClock
from companion.config import Flight, dump, fingerprint
from companion.documents import read_text
from companion.messages.decision import Switch
from companion.messages.ownship import FlightMode
from companion.ranging.source import RangingSource, open_ranging
from companion.recording import RECORDING_NAME, SUMMARY_NAME, McapRecorder, to_plain, write_json
from companion.runtime.channel import GuardianPort
from companion.runtime.planner import Planner
from companion.runtime.planner_loop import PlannerLoop, PlannerLoopParameters
from companion.runtime.ports import MissionState
from companion.runtime.telemetry import TickStatistics
from companion.runtime.wiring import build_planner
from companion.runtime.workers import DetectorProcess

_NICE = 5  # below the guardian: planning and detection, which inherits it, never take its core from it


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerSetup:
    """What the planner's process is started with."""

    flight: Flight
    folder: Path  # for the recording
    clock_start: float  # of the guardian's clock
    auto_engage: bool
    as_json: bool
    quiet: bool


def planner_main(setup: PlannerSetup, end: socket.socket) -> None:
    """Be the planner's process: end with its exit code.

    Args:
        setup: of the flight.
        end: of the socket to the guardian's process.
    """
    os.nice(_NICE)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the guardian's process stops in good order, and ends this one
    code = PLANNER_DIED
    try:
        code = guarded(lambda: _run(setup, GuardianPort(end)))
    except BaseException:  # whatever it is: told, and the process ends
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    # At once: multiprocessing would wait for the detector's process, and at that moment its executor has already
    # lost the queue that could tell it to end (CPython 3.11). The detector ends with this process.
    os._exit(code)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What remains of a flight."""

    planner: Planner
    history: list[Switch]
    duration: float  # [s] until the mission's end
    wall: float  # [s] with starting and stopping
    ticks: TickStatistics | None  # of the guardian; None: it never flew


def _run(setup: PlannerSetup, guardian: GuardianPort) -> int:
    cv2.setNumThreads(1)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # our words about a missing camera say more
    console = Console(stderr=setup.as_json)
    clock = ElapsedClock(setup.clock_start)
    camera = wait_for_camera(
        lambda: _camera(setup.flight, clock),
        clock=clock,
        ended=lambda: _has_ended(guardian),
        say=lambda text: None if setup.quiet else print(text, file=sys.stderr, flush=True),
    )
    if camera is None:
        return NO_VEHICLE
    try:
        return _run_with(camera, setup, guardian, clock, console)
    finally:
        camera.stop()


def _run_with(
    camera: CameraSource, setup: PlannerSetup, guardian: GuardianPort, clock: ElapsedClock, console: Console
) -> int:
    """Record and fly; give the exit code."""
    recorder = McapRecorder(setup.folder / RECORDING_NAME, _metadata(setup.flight), background=True)
    try:
        with LiveLine(console, clock, quiet=setup.quiet, pace=False) as line:
            flown = asyncio.run(_fly(setup, guardian, camera, recorder, clock, BackgroundDisplay(line)))
        if flown.ticks is None:  # the guardian's process has ended before the flight, and says why
            return NO_VEHICLE
        result = _result(setup.flight, flown, flown.ticks)
        recorder.record("result", flown.wall, {key: value for key, value in result.items() if key != "wall_s"})
    finally:
        recorder.close()
    write_json(setup.folder / SUMMARY_NAME, result)
    more = _more(flown, flown.ticks, recorder, setup.folder)
    tell(console, setup.flight.mission.name, result, more, quiet=setup.quiet, as_json=setup.as_json)
    return exit_code(result["success"], flown.planner.mission)


def _metadata(flight: Flight) -> dict[str, dict[str, str]]:
    return {
        "run": {"mission": flight.mission.name, "config_sha256": fingerprint(flight.config)},
        "mission": {"yaml": read_text(flight.mission.source)},
        "configuration": {"yaml": dump(flight.config)},
    }


class _Watcher:
    """Keeps the history of modes, and passes on what is to be shown."""

    def __init__(self, planner: Planner, display: BackgroundDisplay) -> None:
        self._planner = planner
        self._display = display
        self.history: list[Switch] = []

    def tick(self, t: float) -> None:
        """Look at what the step has decided."""
        snapshot = self._planner.snapshot
        self._display.show(t, self._planner.mission, snapshot)
        for text in () if snapshot is None else snapshot.remarks:
            self._display.note(t, text)
        if snapshot is None or snapshot.decision is None or snapshot.decision.t != t:
            return
        if snapshot.decision.switched is not None:
            self.history.append(snapshot.decision.switched)

    def note(self, t: float, text: str) -> None:
        """Pass on a remark."""
        self._display.note(t, text)


async def _fly(
    setup: PlannerSetup,
    guardian: GuardianPort,
    camera: CameraSource,
    recorder: McapRecorder,
    clock: ElapsedClock,
    display: BackgroundDisplay,
) -> Flown:
    """Start the detector, then plan until the guardian's process ends it."""
    flight = setup.flight
    planner = build_planner(flight, recorder, auto_engage=setup.auto_engage, clock=clock)
    watcher = _Watcher(planner, display)
    try:
        async with (
            _running_detector(flight) as detector,
            _running_ranging(flight, clock) as ranging,
        ):
            loop = PlannerLoop(
                planner=planner,
                guardian=guardian,
                camera=camera,
                detector=detector,
                clock=clock,
                parameters=PlannerLoopParameters(),
                observer=watcher,
                frames_to=recorder if flight.config.recording.frames else None,
                ranging=ranging,
            )
            gc.collect()
            gc.freeze()  # what has been built lives to the end: long collections would hold up steps
            mission = await loop.run()
    finally:
        display.close()
    ticks = loop.statistics
    if ticks is not None:
        ticks = replace(ticks, frames=loop.frames)
    return Flown(planner=planner, history=watcher.history, duration=mission.t, wall=clock.now(), ticks=ticks)


def _has_ended(guardian: GuardianPort) -> bool:
    """Whether the guardian's process has ended; before our first word it sends nothing that could be missed."""
    guardian.receive()
    return guardian.closed


def _camera(flight: Flight, clock: ElapsedClock) -> OpenCvCamera:
    section = flight.config.camera
    parameters = OpenCvCameraParameters(
        source=section.source, latency_s=section.latency_s, width=flight.camera.width, height=flight.camera.height
    )
    return OpenCvCamera(parameters, clock)


@contextlib.asynccontextmanager
async def _running_detector(flight: Flight) -> AsyncIterator[DetectorProcess]:
    detector = DetectorProcess(flight.pad, flight.camera, flight.config.perception)
    try:
        await detector.start()
        yield detector
    finally:
        detector.close()


@contextlib.asynccontextmanager
async def _running_ranging(flight: Flight, clock: ElapsedClock) -> AsyncIterator[RangingSource | None]:
    """Open the ranging input; None where none is configured."""
    source = None if flight.anchors is None else await open_ranging(flight.config.ranging, flight.anchors, clock)
    try:
        yield source
    finally:
        if source is not None:
            await source.close()


def _result(flight: Flight, flown: Flown, ticks: TickStatistics) -> dict[str, Any]:
    """Put the result together, by the companion's own word: there is no truth to judge by."""
    mission, plan = flown.planner.mission, flight.plan
    success = mission.state is (MissionState.LANDED if plan.land is not None else MissionState.HELD)
    outcome = Outcome.FAILED
    if mission.state is MissionState.LANDED:
        outcome = Outcome.LANDED
    elif mission.state is MissionState.HELD:
        follows = plan.land is None and plan.follow is not None
        outcome = Outcome.FOLLOWED if follows else Outcome.HELD
        if plan.ground is not None:
            outcome = Outcome.FOLLOWED if plan.ground.keeps_station else Outcome.INTERCEPTED
    elif mission.state is MissionState.ABORTED:
        outcome = Outcome.ABORTED
    elif mission.state in (MissionState.REFUSED, MissionState.WRONG_VEHICLE):
        outcome = Outcome.REFUSED
    return {
        "outcome": outcome.value,
        "success": success,
        "reason": mission.reason,
        "position_error_m": None,
        "along_error_m": None,
        "cross_error_m": None,
        "angular_error_rad": None,
        "station_keeping": None,
        "duration_s": flown.duration,
        "touchdown_speed_mps": None,
        "mode_history": to_plain(flown.history),
        "limits_violated": [],
        "wall_s": flown.wall,
        "seed": None,
        "ticks": to_plain(ticks),
    }


def _more(flown: Flown, ticks: TickStatistics, recorder: McapRecorder, folder: Path) -> list[tuple[str, str]]:
    rows = [
        ("ticks", f"{ticks.ticks}, {ticks.missed} missed, at most {1e3 * ticks.late_max_s:.1f} ms late"),
        ("frames searched", str(ticks.frames)),
    ]
    snapshot = flown.planner.snapshot
    if snapshot is not None and snapshot.vehicle.connected:
        vehicle = snapshot.vehicle
        rows.append(("autopilot", f"{vehicle.mode.value}, {'armed' if vehicle.armed else 'disarmed'}"))
        if vehicle.armed and vehicle.mode in (FlightMode.OFFBOARD, FlightMode.ACRO):
            rows.append(("WARNING", "the autopilot has not confirmed another mode: its failsafe takes over now"))
    rows.append(("recording", str(folder / RECORDING_NAME)))
    state = recorder.state
    if state.problem is not None:
        rows.append(("WARNING", f"recording: {state.problem} ({state.dropped} messages lost)"))
    return rows
