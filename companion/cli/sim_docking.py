"""`companion sim` of a docking mission: spacecraft and truth in one process, in virtual time."""

from __future__ import annotations

import argparse
import math

import numpy as np
from rich.console import Console

from companion.campaign.docking import SimulatedDocking, wrong_with_docking_world
from companion.campaign.metadata import docking_metadata
from companion.campaign.result import FlightResult
from companion.cli.kept import keep, recorder_at, rows_of
from companion.cli.live import LiveLine, pacer
from companion.cli.main import NOT_ACHIEVED, SUCCESS
from companion.cli.outcome import tell
from companion.clock import MonotonicClock
from companion.config.docking import Docking, load_docking
from companion.errors import InputError
from companion.geometry.arrays import Array
from companion.runtime.docking.pipeline import DockingStep
from sitl_stub.cubesat.simulation import CubesatTruth

_BEGINS = "switched on: it waits until the position is known well enough"


def run(args: argparse.Namespace) -> int:
    """Dock; 0 where it has, 1 where it has not.

    Raises:
        InputError: a file or an option is wrong; nothing was started.
    """
    _check_options(args)
    console = Console(stderr=args.json, soft_wrap=False)
    docking = load_docking(
        args.mission, config_path=args.config, overrides=args.overrides, wrong_with_world=wrong_with_docking_world
    )
    recorder = recorder_at(args.record, docking_metadata(docking, seed=args.seed))
    try:
        simulated = SimulatedDocking(docking, seed=args.seed, recorder=recorder)
        result = _fly(args, console, simulated, docking)
    finally:
        recorder.close()
    plain = result.as_json()
    left = keep(args.record, recorder, plain)
    more = rows_of(result.seed, simulated.simulation.t, result.wall_s, left)
    tell(console, docking.mission.name, plain, more, quiet=args.quiet, as_json=args.json)
    return SUCCESS if result.success else NOT_ACHIEVED


def progress_line(step: DockingStep, docked_position: Array, rate: float | None) -> str:
    """Say in one line how a docking stands.

    Args:
        step: the pipeline's last.
        docked_position: (3,) [m] of the docked chaser, in c.
        rate: how much faster than real time it runs; None: not shown.
    """
    away = float(np.linalg.norm(step.state.position - docked_position))
    std = math.sqrt(float(np.diag(step.state.covariance)[:3].max()))
    words = [f"{step.decision.t:7.1f} s", f"{step.decision.mode.value:<10}"]
    words += [f"{away:6.3f} m to go", f"position +- {1000.0 * std:4.1f} mm"]
    if rate is not None:
        words.append(f"{rate:.1f} x real time")
    return "  ".join(words)


def _check_options(args: argparse.Namespace) -> None:
    for option, given, why in (
        ("--camera", args.camera, "a docking's camera gives the port's markers, not pictures with tags"),
        ("--fault", args.faults, "a docking spacecraft has no autopilot that could misbehave"),
    ):
        if given:
            raise InputError.single(
                source=option,
                wrong=f"{why}; {args.mission} is a docking mission",
                right="leave it out; what goes wrong with radio and camera stands in the world's file",
            )


def _fly(args: argparse.Namespace, console: Console, simulated: SimulatedDocking, docking: Docking) -> FlightResult:
    docked_position = docking.port.docked_position
    with LiveLine(console, MonotonicClock(), quiet=args.quiet, pace=not args.realtime) as line:
        hold_back = pacer() if args.realtime else None

        def on_step(step: DockingStep, _: CubesatTruth) -> None:
            decision = step.decision
            line.update(
                decision.t,
                decision.mode,
                what=decision.mode.value,
                why=_BEGINS if decision.switched is None else decision.switched.reason,
                words=lambda rate: progress_line(step, docked_position, rate),
            )
            if hold_back is not None:
                hold_back(decision.t)

        return simulated.run(on_step)
