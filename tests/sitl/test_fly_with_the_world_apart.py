"""`sitl-stub vehicle`, `sitl-stub world` and `companion fly`: three programs that know each other by sockets only.

The vehicle half plays an external autopilot: the world half has nothing but its telemetry.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mavlink
from test_fly_against_stub import END_S, ENVIRONMENT, FLIGHT_S, ROOT, TRIES, _one_at_a_time, free_port

pytestmark = pytest.mark.sitl
__all__ = ["_one_at_a_time"]


@dataclass
class Program:
    """A half of the simulator."""

    process: subprocess.Popen[str]
    lines: list[str]

    def stop(self) -> tuple[dict[str, object], str]:
        """End it; give its final truth and what it said."""
        self.process.send_signal(signal.SIGTERM)
        output, errors = self.process.communicate(timeout=END_S)
        assert self.process.returncode == 0, errors
        truth: dict[str, object] = json.loads(output.strip().splitlines()[-1])
        return truth, errors


@contextlib.contextmanager
def half(*words: str) -> Iterator[Program]:
    process = subprocess.Popen(
        [sys.executable, "-m", "sitl_stub", *words, "--json"],
        cwd=ROOT,
        env=ENVIRONMENT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        assert process.stdout is not None
        yield Program(process, [process.stdout.readline(), process.stdout.readline()])
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(timeout=END_S)
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def fly(onboard: int, camera: str, folder: Path, mission: str = "land_static") -> tuple[int, dict[str, object], str]:
    command = [sys.executable, "-m", "companion", "fly", str(ROOT / "missions" / f"{mission}.yaml"), "--json"]
    command += ["--config", str(ROOT / "config" / "x500_sim.yaml"), "--record", str(folder)]
    command += ["--connect", f"udp://127.0.0.1:{onboard}", "--camera-source", camera]
    done = subprocess.run(
        [*command, "--set", "recording.frames=false"],
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        timeout=FLIGHT_S,
        check=False,
    )
    lines = done.stdout.strip().splitlines()
    return done.returncode, json.loads(lines[-1]) if lines else {}, done.stderr


def test_lands_with_the_world_beside_an_external_autopilot(tmp_path: Path) -> None:
    for _ in range(TRIES):
        onboard, ground = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
        ports = ("--onboard-port", str(onboard), "--ground-port", str(ground))
        where = ("--autopilot", f"udp://127.0.0.1:{ground}", "--mjpeg-port", "0")
        with (
            half("vehicle", "--world", "static_pad", "--seed", "2", *ports) as vehicle,
            half("world", "--world", "static_pad", "--seed", "2", *where) as world,
        ):
            camera = world.lines[1].split("camera ", 1)[1].split(";", 1)[0]
            code, result, said = fly(onboard, camera, tmp_path)
            seen, world_said = world.stop()
            truth, vehicle_said = vehicle.stop()
        if code == 0 or "too slow" not in vehicle_said + world_said:
            break  # a half that was starved of its core says nothing of the companion: once more
    assert code == 0, said
    assert result["outcome"] == "landed"
    assert (seen["armed"], seen["surface"], seen["feet_in_contact"]) == (False, "pad", 4)
    north, east, _ = seen["targets"][0]["vehicle_minus_target_ned"]  # type: ignore[index]
    assert math.hypot(north, east) < 0.3
    # what the world saw is what was: it knows the place from telemetry in steps of a centimetre
    assert math.dist(seen["position_ned"][:2], truth["position_ned"][:2]) < 0.02  # type: ignore[index]
    assert (truth["armed"], truth["surface"]) == (False, "ground")


def run_world(*words: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "sitl_stub", "world", *words],
        cwd=ROOT,
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        timeout=60.0,
        check=False,
    )
    return done.returncode, done.stderr


def quiet(*words: str) -> tuple[str, ...]:
    return ("--world", "static_pad", "--camera", "corners", "--timeout", "1.5", *words)


def test_nobody_there_is_said() -> None:
    code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}"))
    assert code == 3
    assert "no heartbeat of an autopilot" in said
    assert "within 1.5 s" in said


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--world", "nowhere"), "static_pad"),
        (("--world", "static_pad", "--autopilot", "14550"), "udp://127.0.0.1:14550"),
        (("--world", "static_pad", "--vehicle", "nothing"), "nothing"),
    ],
)
def test_bad_input_is_named_with_what_would_be_right(words: tuple[str, ...], expected: str) -> None:
    code, said = run_world(*words)
    assert code == 2
    assert expected in said


def test_a_port_that_is_taken_is_said() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{taken.getsockname()[1]}"))
    assert code == 2
    assert "is a ground station open?" in said


class Talker:
    """An autopilot that sends heartbeats, hears requests, and answers as a test wants."""

    def __init__(self, port: int, *, armed: bool = False, answer: int | None = None, truth_for: float = 0.0) -> None:
        self.peer, self.armed, self.answer = ("127.0.0.1", port), armed, answer
        self.truth_for = truth_for  # [s] truth is sent for so long after each request
        self.asked: list[float] = []
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._talk)

    def __enter__(self) -> Talker:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _talk(self) -> None:
        mav, begin = mavlink.MAVLink(None, srcSystem=3, srcComponent=1), time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind(("127.0.0.1", 0))
            sock.settimeout(0.01)
            while not self._end.is_set():
                messages = [mavlink.MAVLink_heartbeat_message(2, 12, 128 * self.armed, 0, 3, 3)]
                t = time.monotonic() - begin
                if self.asked and t - self.asked[-1] < self.truth_for:
                    rest = (0.0,) * 3
                    messages += [
                        mavlink.MAVLink_hil_state_quaternion_message(0, (1.0, 0.0, 0.0, 0.0), *rest, *[0] * 11),
                        mavlink.MAVLink_highres_imu_message(int(t * 1e6), *[0.0] * 13, 63),
                    ]
                for message in messages:
                    with contextlib.suppress(ConnectionError):
                        sock.sendto(bytes(message.pack(mav)), self.peer)
                with contextlib.suppress(TimeoutError, ConnectionError):
                    request = mavlink.MAVLink(None).decode(bytearray(sock.recv(512)))
                    if request.param1 == 115.0:
                        self.asked.append(time.monotonic() - begin)
                    if self.answer is not None:
                        ack = mavlink.MAVLink_command_ack_message(request.command, self.answer, 0, 0, 0, 0)
                        sock.sendto(bytes(ack.pack(mav)), self.peer)


def test_an_autopilot_without_the_truth_is_asked_and_named() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with Talker(port, answer=4) as autopilot:
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}"))
    assert code == 3
    assert re.search(r"system 3 sends no HIL_STATE_QUATERNION, asked \d times \(answered FAILED\)", said)
    assert len(autopilot.asked) >= 2


def test_an_armed_vehicle_is_not_followed() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with Talker(port, armed=True):
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}"))
    assert code == 3
    assert "start the world while the vehicle stands on the ground" in said


def test_truth_that_stops_is_asked_for_again() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with Talker(port, truth_for=0.5) as autopilot:
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}", "--duration", "3"))
    assert code == 0
    assert len(autopilot.asked) >= 2
    assert "asking system 3 for it again" in said
    assert "the truth is back" in said
