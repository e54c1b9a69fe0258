"""`sitl-stub` and `companion fly` as programs of their own, for the tests over real sockets."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
END_S, FLIGHT_S = 15.0, 90.0
TRIES, STALL_S = 3, 0.25


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Stub:
    process: subprocess.Popen[str]
    url: str
    camera: str
    lost_time: float = 0.0  # [s] that it could not keep up with the clock; known after `stop`

    def stop(self) -> dict[str, object]:
        """End it; give the truth at its end."""
        self.process.send_signal(signal.SIGTERM)
        output, errors = self.process.communicate(timeout=END_S)
        assert self.process.returncode == 0, errors
        slow = re.search(r"too slow for real time by ([0-9.]+) s", errors)
        self.lost_time = float(slow.group(1)) if slow else 0.0
        truth: dict[str, object] = json.loads(output.strip().splitlines()[-1])
        return truth


@contextlib.contextmanager
def stub(*words: str, world: str = "static_pad", onboard: int = 0) -> Iterator[Stub]:
    onboard, ground = onboard or free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    command = [sys.executable, "-m", "sitl_stub", "--world", world, "--seed", "1", "--json"]
    command += ["--onboard-port", str(onboard), "--ground-port", str(ground), "--mjpeg-port", "0", *words]
    process = subprocess.Popen(
        command, cwd=ROOT, env=ENVIRONMENT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        process.stdout.readline()
        line = process.stdout.readline()  # "sitl-stub: camera http://...; world ..."
        camera = line.split("camera ", 1)[1].split(";", 1)[0]
        yield Stub(process, f"udp://127.0.0.1:{onboard}", camera)
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(timeout=END_S)
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def fly_command(
    url: str, camera: str, folder: Path, *words: str, program: tuple[str, ...] = ("-m", "companion")
) -> list[str]:
    command = [sys.executable, *program, "fly", str(ROOT / "missions" / "land_static.yaml"), "--auto-engage"]
    command += ["--config", str(ROOT / "config" / "x500_sim.yaml"), "--json", "--record", str(folder)]
    command += ["--connect", url, "--camera-source", camera, "--set", "recording.frames=false"]
    command += ["--set", f"operator.socket={folder / 'operator.sock'}"]
    return [*command, *words]


def fly(url: str, camera: str, folder: Path, *words: str) -> tuple[int, dict[str, object], str]:
    """Run to the end; give exit code, result and what was said."""
    done = subprocess.run(
        fly_command(url, camera, folder, *words),
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        timeout=FLIGHT_S,
        check=False,
    )
    lines = done.stdout.strip().splitlines()
    return done.returncode, json.loads(lines[-1]) if lines else {}, done.stderr


def finish(process: subprocess.Popen[str]) -> tuple[int, dict[str, object], str]:
    """Wait for the end; give exit code, result and what was said."""
    try:
        output, said = process.communicate(timeout=END_S)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait(timeout=END_S)
    return process.returncode, json.loads(output.strip().splitlines()[-1]), said
