"""`companion sim`: a mission and the simulator in one process, in virtual time."""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
from rich.console import Console

from companion.campaign.flight import Camera, Progress, SimulatedFlight
from companion.campaign.metadata import flight_metadata
from companion.campaign.result import FlightResult
from companion.cli import sim_docking
from companion.cli.check import wrong_with_world
from companion.cli.kept import RECORD_HELP, keep, recorder_at, rows_of
from companion.cli.live import LiveLine, pacer
from companion.cli.outcome import exit_code, tell
from companion.cli.overrides import add_overrides
from companion.clock import MonotonicClock
from companion.config import Flight, load_flight
from companion.errors import InputError
from companion.mission.docking import names_docking
from companion.recording import McapRecorder, NullRecorder
from sitl_stub.vehicle.faults import FaultError, Faults


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion sim`."""
    parser.add_argument("mission", metavar="MISSION.yaml", help="the mission file")
    parser.add_argument("--config", metavar="FILE", help="a configuration instead of the one that the mission names")
    parser.add_argument("--seed", type=_seed, default=1, metavar="N", help="all dice come from it (default 1)")
    parser.add_argument(
        "--camera",
        choices=("rendered", "corners"),
        help="rendered: pictures, searched for tags (default); corners: the tags' corners directly, much faster",
    )
    add_overrides(parser)
    parser.add_argument("--realtime", action="store_true", help="no faster than the clock on the wall")
    parser.add_argument(
        "--record",
        metavar="DIR",
        type=Path,
        help=RECORD_HELP,
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
    if names_docking(args.mission):
        return sim_docking.run(args)
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
    left = keep(args.record, recorder, plain)
    more = rows_of(result.seed, simulated.simulation.t, result.wall_s, left)
    tell(console, flight.mission.name, plain, more, quiet=args.quiet, as_json=args.json)
    return exit_code(result.success, simulated.pipeline.mission)


def _seed(word: str) -> int:
    if not word.isascii() or not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word!r} is no seed: a whole number from 0 on")
    return int(word)


def _camera(word: str | None) -> Camera:
    return "corners" if word == "corners" else "rendered"


def _check_faults(words: list[str]) -> None:
    try:
        Faults.parse(words)
    except FaultError as error:
        wrong, _, right = str(error).partition("; ")
        raise InputError.single(source="--fault", wrong=wrong, right=right) from None


def _recorder(args: argparse.Namespace, flight: Flight) -> McapRecorder | NullRecorder:
    metadata = flight_metadata(flight, seed=args.seed, camera=_camera(args.camera))
    if args.faults:
        metadata["run"]["faults"] = " ".join(args.faults)
    return recorder_at(args.record, metadata)


def _fly(args: argparse.Namespace, console: Console, simulated: SimulatedFlight) -> FlightResult:
    with LiveLine(console, MonotonicClock(), quiet=args.quiet, pace=not args.realtime) as line:
        hold_back = pacer() if args.realtime else None

        def on_progress(progress: Progress) -> None:
            line.show(progress.t, progress.mission, progress.snapshot)
            if hold_back is not None:
                hold_back(progress.t)

        return simulated.run(on_progress)
