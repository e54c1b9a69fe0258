"""Starts `sitl-stub` and `companion fly` with a wire between them, for the benchmarks in real time."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from processes import camera_of, end, fly_words, free_port, process
from wire import Wire

from companion.runtime.operator_socket import ask


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
        return end(self.stub)[1]


@contextlib.contextmanager
def programs(*words: str, auto: bool = False) -> Iterator[Programs]:
    """Start both; `words` are further arguments of `companion fly`, which engages by itself where `auto` says so."""
    port = free_port()
    ground = free_port()
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        wire = stack.enter_context(Wire(port))
        ports = ("--onboard-port", str(wire.port), "--ground-port", str(ground), "--mjpeg-port", "0")
        stub = stack.enter_context(process("-m", "sitl_stub", "--world", "static_pad", "--seed", "1", "--json", *ports))
        arguments = fly_words(f"udp://127.0.0.1:{port}", camera_of(stub), folder, "--quiet", *words, auto=auto)
        fly = stack.enter_context(process("-m", "companion", *arguments))
        yield Programs(fly, stub, wire, folder / "operator.sock")
