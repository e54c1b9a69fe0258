"""`companion fly`: a mission on a real or simulated PX4, in real time.

This process becomes the guardian's: it owns the connection to the autopilot and outlives the planner, which it starts
(`fly_planner`) with all that is heavy: camera, detector, recording, display.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import ipaddress
import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from multiprocessing.process import BaseProcess
from pathlib import Path

from companion.cli.fly_planner import PlannerSetup, planner_main
from companion.cli.main import PLANNER_DIED
from companion.cli.no_hardware import refuse_docking
from companion.cli.overrides import add_overrides
from companion.clock import ElapsedClock, unix_time
from companion.config import Flight, load_flight
from companion.errors import InputError
from companion.link.connect import open_transport
from companion.link.endpoints import SerialEndpoint, parse_endpoint
from companion.link.ground_station import GroundStationSender, parse_ground_station
from companion.messages.guardian import GuardianState
from companion.recording import RECORDING_NAME, SUMMARY_NAME
from companion.runtime.channel import PlannerPort, pair
from companion.runtime.guardian_loop import GuardianLoop, GuardianLoopParameters
from companion.runtime.helm import Helm
from companion.runtime.operator_socket import OperatorSocket, remove_stale
from companion.runtime.service import ServiceNotifier
from companion.runtime.wiring import build_helm, build_signing

_READY_POLL_S = 0.02
_SILENT_S = 1.0  # of the planner at the end: it hangs, or is stopped
_PLANNER_END_S = 15.0  # for its recording and its result


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
        "--auto-engage",
        action="store_true",
        help="for simulations only: arm and take off as soon as telemetry is good, without the operator's word "
        "(`companion ctl engage`)",
    )
    parser.add_argument(
        "--record",
        metavar="DIR",
        type=Path,
        help=f"leave {RECORDING_NAME} and {SUMMARY_NAME} here (default: a folder named by the time, below "
        "recording.directory)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object, as the last line")
    parser.add_argument("--quiet", action="store_true", help="no progress and no table, only one line with the result")


def run(args: argparse.Namespace) -> int:
    """Fly; see the exit codes."""
    refuse_docking(args.mission)
    flight = load_flight(args.mission, config_path=args.config, overrides=_overrides(args))
    if args.auto_engage:
        _check_auto_engage(flight)
    remove_stale(flight.config.operator.socket)  # or refuse, before anything is started
    folder = args.record or flight.config.recording.directory / datetime.now(UTC).strftime("%Y-%m-%d_%H-%M-%S")
    clock = ElapsedClock()
    ours, theirs = pair()
    setup = PlannerSetup(
        flight=flight,
        folder=folder,
        clock_start=clock.start,
        auto_engage=args.auto_engage,
        as_json=args.json,
        quiet=args.quiet,
    )
    planner = multiprocessing.get_context("spawn").Process(target=planner_main, args=(setup, theirs), name="planner")
    planner.start()
    theirs.close()
    port = PlannerPort(ours)
    notifier = ServiceNotifier.from_environment()
    silent = False
    try:
        silent = asyncio.run(_guard(flight, port, planner, clock, notifier, auto_engage=args.auto_engage))
    finally:
        port.close()  # for the planner this is the end: it finishes its recording and tells the result
        notifier.close()
        _wait_for(planner, 0.0 if silent else _PLANNER_END_S)
    code = planner.exitcode
    if code is None or code < 0:
        print(f"the planner's process {_fate(code)}; the recording in {folder} is incomplete", file=sys.stderr)
        return PLANNER_DIED
    return code


def _overrides(args: argparse.Namespace) -> list[str]:
    overrides: list[str] = list(args.overrides)
    if args.connect is not None:
        overrides.append(f"link.url={json.dumps(str(parse_endpoint(args.connect)))}")
    if args.camera_source is not None:
        overrides.append(f"camera.source={json.dumps(args.camera_source)}")
    return overrides


def _check_auto_engage(flight: Flight) -> None:
    """Refuse to engage by itself over anything but loopback; say what it does.

    Raises:
        InputError: the connection does not end on this machine.
    """
    endpoint = parse_endpoint(flight.config.link.url, source="link.url")
    if isinstance(endpoint, SerialEndpoint) or not ipaddress.ip_address(endpoint.host).is_loopback:
        raise InputError.single(
            source="--auto-engage",
            wrong=f"{endpoint} does not end on this machine; a vehicle could be there",
            right="use it only with a simulator on this machine, udp://127.0.0.1:PORT; else leave it out, and engage "
            "by `companion ctl engage`",
        )
    print("--auto-engage: arms and takes off WITHOUT the operator's word; for simulators only", file=sys.stderr)


async def _guard(
    flight: Flight,
    port: PlannerPort,
    planner: BaseProcess,
    clock: ElapsedClock,
    notifier: ServiceNotifier,
    *,
    auto_engage: bool,
) -> bool:
    """Wait for the planner's camera and detector, open the link and the operator's socket, and guard.

    Returns:
        Whether the planner was silent at the end, so that nothing is to be waited for.
    """
    stop = _on_signals()
    if not await _ready(port, stop):
        return False
    signing = build_signing(flight.config.link, clock.now(), unix_time())
    helm = build_helm(flight, auto_engage=auto_engage, signing=signing)
    transport = await open_transport(flight.config.link.url, clock=clock, recognises=helm.recognises, source="link.url")
    operator = OperatorSocket(helm.order, lambda: _status(helm, planner, clock.now()))
    try:
        await operator.open(flight.config.operator.socket)
        with _ground_station(flight) as ground:
            loop = GuardianLoop(
                helm=helm,
                transport=transport,
                planner=port,
                clock=clock,
                parameters=GuardianLoopParameters(),
                notifier=notifier,
                stop=stop,
                ground=ground,
            )
            gc.collect()
            gc.freeze()  # what has been built lives to the end: long collections would hold up ticks
            notifier.ready("waiting for the vehicle")
            await loop.run()
        notifier.stopping(helm.reason)
        return helm.planner_age(clock.now()) > _SILENT_S
    finally:
        await operator.close()
        await transport.close()


@contextlib.contextmanager
def _ground_station(flight: Flight) -> Iterator[GroundStationSender | None]:
    url = flight.config.link.ground_station
    if url is None:
        yield None
        return
    with contextlib.closing(GroundStationSender(parse_ground_station(url))) as sender:
        yield sender


def _on_signals() -> asyncio.Event:
    stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
    return stop


async def _ready(port: PlannerPort, stop: asyncio.Event) -> bool:
    """Wait for the planner's first word; False where it ends without one, or the operator stops."""
    while not port.closed and not stop.is_set():
        if port.receive() is not None:
            return True
        await asyncio.sleep(_READY_POLL_S)
    return False


def _status(helm: Helm, planner: BaseProcess, now: float) -> Mapping[str, object]:
    """Give what the operator wants to know, as plain values."""
    vehicle, age = helm.vehicle, helm.planner_age(now)
    against = helm.against_engaging()
    return {
        "mission": helm.stage.value,
        "because": helm.reason,
        "guardian": helm.state.value,
        "guardian_because": "" if helm.output is None else helm.output.reason,
        "vehicle": "not connected" if vehicle is None or not vehicle.connected else vehicle.mode.value,
        "armed": vehicle is not None and vehicle.armed,
        "engage": against or ("possible" if helm.state is GuardianState.MUTED else ""),
        "planner_silent_s": round(age, 3) if age < 1e9 else None,
        "guardian_process": os.getpid(),
        "planner_process": planner.pid,
    }


def _wait_for(planner: BaseProcess, patience: float) -> None:
    """Let the planner finish within `patience` [s]; a stopped or hanging one is ended."""
    planner.join(patience)
    if planner.is_alive():
        planner.kill()
        planner.join()


def _fate(code: int | None) -> str:
    if code is None:
        return "did not end"
    return f"was ended by {signal.Signals(-code).name}"
