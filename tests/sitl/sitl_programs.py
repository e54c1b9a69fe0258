"""`sitl-stub` as a program of its own, for the tests over real sockets."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from processes import camera_of, end, free_port, process

TRIES, STALL_S = 3, 0.25


@dataclass
class Stub:
    process: subprocess.Popen[str]
    url: str
    camera: str
    lost_time: float = 0.0  # [s] that it could not keep up with the clock; known after `stop`

    def stop(self) -> dict[str, Any]:
        """End it; give the truth at its end."""
        truth, self.lost_time = end(self.process)
        return truth


@contextlib.contextmanager
def stub(*words: str, world: str = "static_pad", onboard: int = 0) -> Iterator[Stub]:
    onboard, ground = onboard or free_port(), free_port()
    ports = ("--onboard-port", str(onboard), "--ground-port", str(ground), "--mjpeg-port", "0")
    with process("-m", "sitl_stub", "--world", world, "--seed", "1", "--json", *ports, *words) as simulator:
        yield Stub(simulator, f"udp://127.0.0.1:{onboard}", camera_of(simulator))
