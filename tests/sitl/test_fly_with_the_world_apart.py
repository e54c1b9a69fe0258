"""`sitl-stub vehicle`, `sitl-stub world` and `companion fly`: three programs that know each other by sockets only.

The vehicle half plays an external autopilot: the world half has nothing but its telemetry.
"""

from __future__ import annotations

import contextlib
import math
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml
from processes import ENVIRONMENT, ROOT, fly, free_port, halves
from pymavlink.dialects.v20 import all as mavlink
from sitl_programs import TRIES

from sitl_stub.world.world import WORLDS

# The pad moves for less time than in the world's file. All three landings, at length: bench/world_apart.py.
MOTION = {"duration_s": [6, 8]}
SHORTER = ("--set", "steps.2.follow.for_s=4.0")


def shortened(world: str, folder: Path) -> str:
    text = yaml.safe_load((WORLDS / f"{world}.yaml").read_text(encoding="utf-8"))
    text["targets"][0]["motion"] |= MOTION
    path = folder / f"{world}.yaml"
    path.write_text(yaml.safe_dump(text), encoding="utf-8")
    return str(path)


@pytest.mark.sitl
def test_lands_with_the_world_beside_an_external_autopilot(tmp_path: Path) -> None:
    world = shortened("moving_pad", tmp_path)
    for attempt in range(TRIES):
        folder = tmp_path / str(attempt)
        with halves(world, seed=2) as simulator:
            code, result, said = fly(simulator.url, simulator.camera, folder, *SHORTER, mission="land_moving")
            truths = simulator.stop()
        if code == 0 or not simulator.starved:
            break  # a half that was starved of its core says nothing of the companion: once more
    assert code == 0, said
    assert result["outcome"] == "landed"
    seen, truth = truths.world, truths.vehicle
    assert (seen["armed"], seen["surface"], seen["feet_in_contact"]) == (False, "pad", 4)
    north, east, _ = seen["targets"][0]["vehicle_minus_target_ned"]
    assert math.hypot(north, east) < 0.3
    # what the world saw is what was: it knows the place from telemetry in steps of a centimetre
    assert math.dist(seen["position_ned"][:2], truth["position_ned"][:2]) < 0.02
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
    code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{free_port()}"))
    assert code == 3
    assert "no heartbeat of an autopilot" in said
    assert "within 1.5 s" in said


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--world", "nowhere"), "static_pad"),
        (("--world", "static_pad", "--autopilot", "14550"), "udp://127.0.0.1:14550"),
        (("--world", "static_pad", "--vehicle", "nothing"), "nothing"),
        (("--world", "static_pad", "--timeout", "-1"), "more than 0 seconds"),
        (("--world", "static_pad", "--duration", "nan"), "more than 0 seconds"),
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


@pytest.mark.sitl
def test_an_autopilot_without_the_truth_is_asked_and_named() -> None:
    port = free_port()
    with Talker(port, answer=4) as autopilot:
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}"))
    assert code == 3
    assert re.search(r"system 3 sends no HIL_STATE_QUATERNION, asked \d times \(answered FAILED\)", said)
    assert len(autopilot.asked) >= 2


@pytest.mark.sitl
def test_an_armed_vehicle_is_not_followed() -> None:
    port = free_port()
    with Talker(port, armed=True):
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}"))
    assert code == 3
    assert "start the world while the vehicle stands on the ground" in said


@pytest.mark.sitl
def test_truth_that_stops_is_asked_for_again() -> None:
    port = free_port()
    with Talker(port, truth_for=0.5) as autopilot:
        code, said = run_world(*quiet("--autopilot", f"udp://127.0.0.1:{port}", "--duration", "3"))
    assert code == 0
    assert len(autopilot.asked) >= 2
    assert "asking system 3 for it again" in said
    assert "the truth is back" in said
