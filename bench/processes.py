"""Programs of this project as processes of their own, on loopback, for the benchmarks and tests in real time."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = os.environ | {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "PYTHONUNBUFFERED": "1",
    "PYTHONPATH": str(ROOT),
}
END_S, FLIGHT_S = 20.0, 90.0


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Give a port of loopback that nobody listens at now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def process(*words: str, folder: Path = ROOT, more: Mapping[str, str] | None = None) -> Iterator[subprocess.Popen[str]]:
    """Start Python with `words`; at the end of the block it is gone.

    Args:
        words: arguments of the interpreter.
        folder: where it runs.
        more: further variables of its environment.
    """
    started = subprocess.Popen(
        [sys.executable, *words],
        cwd=folder,
        env=ENVIRONMENT | (more or {}),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        yield started
    finally:
        if started.poll() is None:
            started.kill()
        started.wait(timeout=END_S)
        for stream in (started.stdout, started.stderr):
            if stream is not None:
                stream.close()


def camera_of(simulator: subprocess.Popen[str]) -> str:
    """Wait for the simulator's second line, and give the address of its camera."""
    assert simulator.stdout is not None
    lines = [simulator.stdout.readline(), simulator.stdout.readline()]
    found = re.search(r"camera ([^;]+);", lines[1])
    if found is None:
        raise RuntimeError(f"the simulator did not start: {lines} {simulator.communicate(timeout=END_S)}")
    return found.group(1)


def end(simulator: subprocess.Popen[str]) -> tuple[dict[str, Any], float]:
    """End a simulator; give its final truth, and the time [s] that it could not keep up with the clock."""
    simulator.send_signal(signal.SIGTERM)
    output, said = simulator.communicate(timeout=END_S)
    if simulator.returncode != 0:
        raise RuntimeError(said)
    slow = re.search(r"too slow for real time by ([0-9.]+) s", said)
    truth: dict[str, Any] = json.loads(output.strip().splitlines()[-1])
    return truth, float(slow.group(1)) if slow else 0.0


def landing_errors(truth: dict[str, Any]) -> tuple[float, float]:
    """Give the distance [m] to the landing point and the heading [rad] against the pad's, from a simulator's truth."""
    target = truth["targets"][0]
    north, east, _ = target["vehicle_minus_target_ned"]
    w, x, y, z = truth["quaternion"]
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return math.hypot(north, east), math.remainder(yaw - target["yaw"], math.tau)


def fly_words(
    url: str, camera: str, folder: Path, *words: str, mission: str = "land_static", auto: bool = True
) -> list[str]:
    """Give the arguments of `companion fly`; its recording and its socket lie in `folder`.

    Args:
        url: where it hears the autopilot.
        camera: address of the pictures.
        folder: for recording and socket.
        words: further arguments.
        mission: name of one of the project's missions.
        auto: it engages by itself.
    """
    return [
        *("fly", str(ROOT / "missions" / f"{mission}.yaml"), *(("--auto-engage",) if auto else ()), "--json"),
        *("--record", str(folder), "--connect", url, "--camera-source", camera, "--set", "recording.frames=false"),
        *("--set", f"operator.socket={folder / 'operator.sock'}", *words),
    ]


def finish(flight: subprocess.Popen[str], seconds: float = END_S) -> tuple[int, dict[str, Any], str]:
    """Wait for the end of `companion fly`; give exit code, result (empty: none was told) and what was said."""
    try:
        output, said = flight.communicate(timeout=seconds)
    finally:
        if flight.poll() is None:
            flight.kill()
            flight.wait(timeout=END_S)
    lines = output.strip().splitlines()
    return flight.returncode, json.loads(lines[-1]) if lines else {}, said


def fly(
    url: str, camera: str, folder: Path, *words: str, mission: str = "land_static", seconds: float = FLIGHT_S
) -> tuple[int, dict[str, Any], str]:
    """Run `companion fly` to its end; gives what `finish` gives."""
    folder.mkdir(parents=True, exist_ok=True)
    with process("-m", "companion", *fly_words(url, camera, folder, *words, mission=mission), folder=folder) as flight:
        return finish(flight, seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truths:
    """What both halves of a simulator say at the end."""

    vehicle: dict[str, Any]
    world: dict[str, Any]


class Halves:
    """`sitl-stub vehicle` and `sitl-stub world`, which knows the vehicle by its telemetry only."""

    def __init__(self, vehicle: subprocess.Popen[str], world: subprocess.Popen[str], url: str) -> None:
        self._vehicle, self._world = vehicle, world
        self.url = url  # where the companion hears the vehicle
        self.camera = camera_of(world)
        self.starved = 0.0  # [s] that a half could not keep up with the clock; known after `stop`

    def stop(self) -> Truths:
        """End both."""
        world, slow = end(self._world)
        vehicle, slower = end(self._vehicle)
        self.starved = max(slow, slower)
        return Truths(vehicle=vehicle, world=world)


@contextlib.contextmanager
def halves(world: str, *, seed: int) -> Iterator[Halves]:
    """Start both halves in a world (its name or its file)."""
    onboard, ground = free_port(), free_port()
    common = ("--world", world, "--seed", str(seed), "--json")
    ports = ("--onboard-port", str(onboard), "--ground-port", str(ground))
    where = ("--autopilot", f"udp://127.0.0.1:{ground}", "--mjpeg-port", "0")
    with process("-m", "sitl_stub", "vehicle", *common, *ports) as vehicle:
        assert vehicle.stdout is not None
        vehicle.stdout.readline()
        with process("-m", "sitl_stub", "world", *common, *where) as beside:
            yield Halves(vehicle, beside, f"udp://127.0.0.1:{onboard}")
