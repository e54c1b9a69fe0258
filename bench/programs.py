"""Starts `sitl-stub` and `companion fly` with a wire between them, for the benchmarks in real time."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from wire import Wire

from companion.runtime.operator_socket import ask

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
END_S = 20.0


class Programs:
    """Both programs, running."""

    def __init__(self, fly: subprocess.Popen[str], stub: subprocess.Popen[str], wire: Wire, operator: Path) -> None:
        self.fly, self.stub, self.wire, self.operator = fly, stub, wire, operator
        self.ground_port = 0  # of the simulator: where a ground station sends to

    def order(self, word: str) -> dict:
        return ask(self.operator, word)

    def status(self) -> dict:
        return self.order("status")["status"]

    def until(self, condition, seconds: float, what: str) -> None:
        t_end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > t_end or self.fly.poll() is not None:
                raise SystemExit(
                    f"{what}: not within {seconds:g} s; {self.status() if self.fly.poll() is None else ''}"
                )
            time.sleep(0.02)

    def stop_stub(self) -> float:
        """End the simulator; give the time [s] that it could not keep up with the clock."""
        self.stub.send_signal(signal.SIGTERM)
        _, said = self.stub.communicate(timeout=END_S)
        slow = re.search(r"too slow for real time by ([0-9.]+) s", said)
        return float(slow.group(1)) if slow else 0.0


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def programs(*words: str) -> Iterator[Programs]:
    """Start both; `words` are further arguments of `companion fly`."""
    port = free_port()
    with tempfile.TemporaryDirectory() as name, Wire(port) as wire:
        folder = Path(name)
        command = [sys.executable, "-m", "sitl_stub", "--world", "static_pad", "--seed", "1", "--mjpeg-port", "0"]
        command += ["--onboard-port", str(wire.port), "--ground-port", str(free_port())]
        pipes = {"cwd": ROOT, "env": ENVIRONMENT, "text": True, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        stub = subprocess.Popen(command, **pipes)
        assert stub.stdout is not None
        stub.stdout.readline()
        camera = stub.stdout.readline().split("camera ", 1)[1].split(";", 1)[0]
        command = [sys.executable, "-m", "companion", "fly", str(ROOT / "missions" / "land_static.yaml"), "--json"]
        command += ["--config", str(ROOT / "config" / "x500_sim.yaml"), "--record", str(folder / "flight"), "--quiet"]
        command += ["--connect", f"udp://127.0.0.1:{port}", "--camera-source", camera]
        command += ["--set", "recording.frames=false", "--set", f"operator.socket={folder / 'operator.sock'}"]
        fly = subprocess.Popen([*command, *words], **pipes)
        try:
            yield Programs(fly, stub, wire, folder / "operator.sock")
        finally:
            for process in (fly, stub):
                if process.poll() is None:
                    process.kill()
                process.wait(timeout=END_S)
                for stream in (process.stdout, process.stderr):
                    if stream is not None and not stream.closed:
                        stream.close()
