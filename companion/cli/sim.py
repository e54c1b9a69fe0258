"""`companion sim`: a mission and the simulator in one process, in virtual time."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
from rich.console import Console

from companion.campaign.flight import Camera, Progress, SimulatedFlight
from companion.campaign.metadata import flight_metadata
from companion.campaign.result import FlightResult
from companion.cli.check import wrong_with_world
from companion.cli.live import LiveLine
from companion.cli.outcome import exit_code, one_line, print_json, show_result
from companion.cli.overrides import add_overrides
from companion.clock import MonotonicClock
from companion.config import Flight, load_flight
from companion.errors import InputError, RecordingError
from companion.recording import RECORDING_NAME, SUMMARY_NAME, McapRecorder, NullRecorder, write_json
from sitl_stub.vehicle.faults import FaultError, Faults

PICTURE_NAME, PAGE_NAME = "flight.png", "flight.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion sim`."""
    parser.add_argument("mission", metavar="MISSION.yaml", help="the mission file")
    parser.add_argument("--config", metavar="FILE", help="a configuration instead of the one that the mission names")
    parser.add_argument("--seed", type=_seed, default=1, metavar="N", help="all dice come from it (default 1)")
    parser.add_argument(
        "--camera",
        choices=("rendered", "corners"),
        default="rendered",
        help="rendered: pictures, searched for tags (default); corners: the tags' corners directly, much faster",
    )
    add_overrides(parser)
    parser.add_argument("--realtime", action="store_true", help="no faster than the clock on the wall")
    parser.add_argument(
        "--record",
        metavar="DIR",
        type=Path,
        help=f"leave {RECORDING_NAME}, {SUMMARY_NAME}, {PICTURE_NAME} and {PAGE_NAME} here",
    )
    parser.add_argument(
        "--fault",
        metavar="WORD",
        dest="faults",
        action="append",
        default=[],
        help="make the simulated autopilot misbehave: refuse_arming=gps, no_heartbeat, vehicle_type=fixed_wing",
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object, as the last line")
    parser.add_argument("--quiet", action="store_true", help="no progress and no table, only one line with the result")


def run(args: argparse.Namespace) -> int:
    """Fly; see the exit codes."""
    cv2.setNumThreads(1)
    console = Console(stderr=args.json, soft_wrap=False)
    flight = load_flight(
        args.mission, config_path=args.config, overrides=args.overrides, wrong_with_world=wrong_with_world
    )
    _check_faults(args.faults)
    recorder = _recorder(args, flight)
    try:
        simulated = SimulatedFlight(
            flight, seed=args.seed, camera=_camera(args.camera), recorder=recorder, faults=args.faults
        )
        result = _fly(args, console, simulated)
    finally:
        recorder.close()
    plain = result.as_json()
    left = [] if args.record is None else _keep(args.record, recorder, plain)
    if not args.quiet:
        show_result(console, flight.mission.name, plain, _more(simulated, result, left))
    elif not args.json:
        print(one_line(plain))
    if args.json:
        print_json(plain)
    return exit_code(result.success, simulated.pipeline.mission)


def _seed(word: str) -> int:
    if not word.isascii() or not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word!r} is no seed: a whole number from 0 on")
    return int(word)


def _camera(word: str) -> Camera:
    return "corners" if word == "corners" else "rendered"


def _check_faults(words: list[str]) -> None:
    try:
        Faults.parse(words)
    except FaultError as error:
        wrong, _, right = str(error).partition("; ")
        raise InputError.single(source="--fault", wrong=wrong, right=right) from None


def _recorder(args: argparse.Namespace, flight: Flight) -> McapRecorder | NullRecorder:
    if args.record is None:
        return NullRecorder()
    metadata = flight_metadata(flight, seed=args.seed, camera=args.camera)
    if args.faults:
        metadata["run"]["faults"] = " ".join(args.faults)
    return McapRecorder(args.record / RECORDING_NAME, metadata)


def _fly(args: argparse.Namespace, console: Console, simulated: SimulatedFlight) -> FlightResult:
    with LiveLine(console, MonotonicClock(), quiet=args.quiet, pace=not args.realtime) as line:
        hold_back = _pacer() if args.realtime else None

        def on_progress(progress: Progress) -> None:
            line.show(progress.t, progress.mission, progress.snapshot)
            if hold_back is not None:
                hold_back(progress.t)

        return simulated.run(on_progress)


def _pacer() -> Callable[[float], None]:
    """Give what sleeps until the wall has come as far as virtual time."""
    clock = MonotonicClock()
    started = clock.now()

    def hold_back(t: float) -> None:
        ahead = t - (clock.now() - started)
        if ahead > 0.0:
            time.sleep(ahead)

    return hold_back


def _keep(folder: Path, recorder: McapRecorder | NullRecorder, result: dict[str, Any]) -> list[Path]:
    """Write what stands beside the recording; give the pictures."""
    from companion.report import draw_flight, write_page  # needs matplotlib, which takes its time

    if isinstance(recorder, McapRecorder) and recorder.state.problem is not None:
        raise RecordingError(f"{recorder.state.problem} ({recorder.state.dropped} messages lost)")
    write_json(folder / SUMMARY_NAME, result)
    picture, page = folder / PICTURE_NAME, folder / PAGE_NAME
    draw_flight(folder / RECORDING_NAME, picture)
    write_page(folder / RECORDING_NAME, page)
    return [picture, page]


def _more(simulated: SimulatedFlight, result: FlightResult, left: list[Path]) -> list[tuple[str, str]]:
    simulation_s = simulated.simulation.t
    rows = [
        ("seed", str(result.seed)),
        ("speed", f"{simulation_s / max(result.wall_s, 1e-9):.1f} x real time ({result.wall_s:.1f} s on the wall)"),
    ]
    if left:
        rows.append(("picture", str(left[0])))
        rows.append(("page", str(left[1])))
        rows.append(("recording", str(left[0].with_name(RECORDING_NAME))))
    return rows
