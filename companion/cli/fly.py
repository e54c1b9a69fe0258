"""`companion fly`: a mission on a real or simulated PX4, in real time."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import json
import os
import signal
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
from rich.console import Console

from companion.camera.opencv import OpenCvCamera, OpenCvCameraParameters
from companion.camera.source import CameraSource
from companion.campaign.result import Outcome
from companion.cli.live import BackgroundDisplay, LiveLine
from companion.cli.outcome import exit_code, one_line, print_json, show_result
from companion.cli.overrides import add_overrides
from companion.clock import ElapsedClock, unix_time
from companion.config import Flight, dump, fingerprint, load_flight
from companion.documents import read_text
from companion.link.connect import open_transport
from companion.link.endpoints import parse_endpoint
from companion.link.ground_station import GroundStationSender, parse_ground_station
from companion.messages.decision import Switch
from companion.messages.ownship import FlightMode
from companion.recording import RECORDING_NAME, SUMMARY_NAME, McapRecorder, to_plain, write_json
from companion.runtime.flight import FlightLoop, FlightParameters, TickStatistics
from companion.runtime.pipeline import Pipeline
from companion.runtime.ports import MissionState
from companion.runtime.service import ServiceNotifier
from companion.runtime.wiring import build_pipeline, build_signing
from companion.runtime.workers import DetectorProcess


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion fly`."""
    parser.add_argument("mission", metavar="MISSION.yaml", help="the mission file")
    parser.add_argument("--config", metavar="FILE", help="a configuration instead of the one that the mission names")
    parser.add_argument(
        "--connect", metavar="URL", help="link to the autopilot, instead of link.url: udp://…, tcp://…, serial://…"
    )
    parser.add_argument(
        "--camera-source", metavar="SOURCE", help="index, device, file or URL, instead of camera.source"
    )
    add_overrides(parser)
    parser.add_argument(
        "--record",
        metavar="DIR",
        type=Path,
        help=f"leave {RECORDING_NAME} and {SUMMARY_NAME} here (default: a folder named by the time, below "
        "recording.directory)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object, as the last line")
    parser.add_argument("--quiet", action="store_true", help="no progress and no table, only one line with the result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What remains of a flight."""

    pipeline: Pipeline
    history: list[Switch]
    duration: float  # [s] until the mission's end
    wall: float  # [s] with starting and stopping
    ticks: TickStatistics


def run(args: argparse.Namespace) -> int:
    """Fly; see the exit codes."""
    cv2.setNumThreads(1)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # our words about a missing camera say more
    console = Console(stderr=args.json)
    flight = load_flight(args.mission, config_path=args.config, overrides=_overrides(args))
    folder = args.record or flight.config.recording.directory / datetime.now(UTC).strftime("%Y-%m-%d_%H-%M-%S")
    recorder = McapRecorder(folder / RECORDING_NAME, _metadata(flight), background=True)
    notifier = ServiceNotifier.from_environment()
    try:
        with LiveLine(console, ElapsedClock(), quiet=args.quiet, pace=False) as line:
            flown = asyncio.run(_fly(flight, recorder, notifier, BackgroundDisplay(line)))
        result = _result(flight, flown)
        recorder.record("result", flown.wall, {key: value for key, value in result.items() if key != "wall_s"})
    finally:
        recorder.close()
        notifier.close()
    write_json(folder / SUMMARY_NAME, result)
    _tell(args, console, flight, result, _more(flown, recorder, folder))
    return exit_code(result["success"], flown.pipeline.mission)


def _overrides(args: argparse.Namespace) -> list[str]:
    overrides: list[str] = list(args.overrides)
    if args.connect is not None:
        overrides.append(f"link.url={json.dumps(str(parse_endpoint(args.connect)))}")
    if args.camera_source is not None:
        overrides.append(f"camera.source={json.dumps(args.camera_source)}")
    return overrides


def _metadata(flight: Flight) -> dict[str, dict[str, str]]:
    return {
        "run": {"mission": flight.mission.name, "config_sha256": fingerprint(flight.config)},
        "mission": {"yaml": read_text(flight.mission.source)},
        "configuration": {"yaml": dump(flight.config)},
    }


class _Watcher:
    """Keeps the history of modes, and passes on what is to be shown."""

    def __init__(self, pipeline: Pipeline, display: BackgroundDisplay, notifier: ServiceNotifier) -> None:
        self._pipeline = pipeline
        self._display = display
        self._notifier = notifier
        self._said = pipeline.mission
        self.history: list[Switch] = []

    def tick(self, t: float) -> None:
        """Look at what the step has decided."""
        mission, snapshot = self._pipeline.mission, self._pipeline.snapshot
        self._display.show(t, mission, snapshot)
        if mission is not self._said:
            self._said = mission
            self._notifier.status(f"{mission.mode.value}: {mission.reason}")
        for text in () if snapshot is None else snapshot.remarks:
            self._display.note(t, text)
        if snapshot is None or snapshot.decision is None or snapshot.decision.t != t:
            return
        if snapshot.decision.switched is not None:
            self.history.append(snapshot.decision.switched)

    def note(self, t: float, text: str) -> None:
        """Pass on a remark."""
        self._display.note(t, text)


async def _fly(flight: Flight, recorder: McapRecorder, notifier: ServiceNotifier, display: BackgroundDisplay) -> Flown:
    """Open camera, detector and link, in this order; fly; give everything back."""
    clock = ElapsedClock()
    pipeline = build_pipeline(flight, recorder, build_signing(flight.config.link, clock.now(), unix_time()))
    watcher = _Watcher(pipeline, display, notifier)
    try:
        async with (
            _running_camera(flight, clock) as camera,
            _running_detector(flight) as detector,
            _ground_station(flight) as ground,
        ):
            transport = await open_transport(
                flight.config.link.url, clock=clock, recognises=pipeline.recognises, source="link.url"
            )
            loop = FlightLoop(
                pipeline=pipeline,
                transport=transport,
                camera=camera,
                detector=detector,
                clock=clock,
                parameters=FlightParameters(),
                notifier=notifier,
                observer=watcher,
                frames_to=recorder if flight.config.recording.frames else None,
                ground=ground,
            )
            gc.collect()
            gc.freeze()  # what has been built lives to the end: long collections would hold up ticks
            _stop_on_signals(loop)
            notifier.ready("waiting for the vehicle")
            try:
                mission = await loop.run()
                notifier.stopping(mission.reason)
            finally:
                await transport.close()
    finally:
        display.close()
    return Flown(
        pipeline=pipeline, history=watcher.history, duration=mission.t, wall=clock.now(), ticks=loop.statistics
    )


@contextlib.asynccontextmanager
async def _running_camera(flight: Flight, clock: ElapsedClock) -> AsyncIterator[CameraSource]:
    section = flight.config.camera
    parameters = OpenCvCameraParameters(
        source=section.source, latency_s=section.latency_s, width=flight.camera.width, height=flight.camera.height
    )
    camera = OpenCvCamera(parameters, clock)
    try:
        await asyncio.to_thread(camera.start)
        yield camera
    finally:
        await asyncio.to_thread(camera.stop)


@contextlib.asynccontextmanager
async def _running_detector(flight: Flight) -> AsyncIterator[DetectorProcess]:
    detector = DetectorProcess(flight.pad, flight.camera, flight.config.perception)
    try:
        await detector.start()
        yield detector
    finally:
        detector.close()


@contextlib.asynccontextmanager
async def _ground_station(flight: Flight) -> AsyncIterator[GroundStationSender | None]:
    url = flight.config.link.ground_station
    if url is None:
        yield None
        return
    sender = GroundStationSender(parse_ground_station(url))
    try:
        yield sender
    finally:
        sender.close()


def _stop_on_signals(loop: FlightLoop) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(number, loop.stop)


def _result(flight: Flight, flown: Flown) -> dict[str, Any]:
    """Put the result together, by the companion's own word: there is no truth to judge by."""
    mission, plan = flown.pipeline.mission, flight.plan
    success = mission.state is (MissionState.LANDED if plan.land is not None else MissionState.HELD)
    outcome = Outcome.FAILED
    if mission.state is MissionState.LANDED:
        outcome = Outcome.LANDED
    elif mission.state is MissionState.HELD:
        outcome = Outcome.FOLLOWED if plan.land is None and plan.follow is not None else Outcome.HELD
    elif mission.state is MissionState.ABORTED:
        outcome = Outcome.ABORTED
    elif mission.state in (MissionState.REFUSED, MissionState.WRONG_VEHICLE):
        outcome = Outcome.REFUSED
    return {
        "outcome": outcome.value,
        "success": success,
        "reason": mission.reason,
        "position_error_m": None,
        "angular_error_rad": None,
        "station_keeping": None,
        "duration_s": flown.duration,
        "touchdown_speed_mps": None,
        "mode_history": to_plain(flown.history),
        "limits_violated": [],
        "wall_s": flown.wall,
        "seed": None,
        "ticks": to_plain(flown.ticks),
    }


def _more(flown: Flown, recorder: McapRecorder, folder: Path) -> list[tuple[str, str]]:
    ticks = flown.ticks
    rows = [
        ("ticks", f"{ticks.ticks}, {ticks.missed} missed, at most {1e3 * ticks.late_max_s:.1f} ms late"),
        ("frames searched", str(ticks.frames)),
    ]
    snapshot = flown.pipeline.snapshot
    if snapshot is not None and snapshot.vehicle.connected:
        vehicle = snapshot.vehicle
        rows.append(("autopilot", f"{vehicle.mode.value}, {'armed' if vehicle.armed else 'disarmed'}"))
        if vehicle.armed and vehicle.mode is FlightMode.OFFBOARD:
            rows.append(("WARNING", "the autopilot has not confirmed another mode: its failsafe takes over now"))
    rows.append(("recording", str(folder / RECORDING_NAME)))
    state = recorder.state
    if state.problem is not None:
        rows.append(("WARNING", f"recording: {state.problem} ({state.dropped} messages lost)"))
    return rows


def _tell(
    args: argparse.Namespace,
    console: Console,
    flight: Flight,
    result: dict[str, Any],
    more: list[tuple[str, str]],
) -> None:
    if not args.quiet:
        show_result(console, flight.mission.name, result, more)
    elif not args.json:
        print(one_line(result))
    if args.json:
        print_json(result)
