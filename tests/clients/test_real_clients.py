"""Ground stations and libraries that others use, against the simulator over real sockets.

They live in an environment of their own (`make test-clients` makes it): MAVProxy wants another build of OpenCV than the
companion. `CLIENTS_PYTHON` names its interpreter; where a client is not installed its tests are skipped.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.clients

ROOT = Path(__file__).resolve().parents[2]
PYTHON = os.path.abspath(os.environ.get("CLIENTS_PYTHON") or sys.executable)  # the clients run in other folders
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
OUTSIDE = {name: value for name, value in ENVIRONMENT.items() if name != "PYTHONPATH"}
SESSION_S, WAIT_S, END_S = 180.0, 25.0, 15.0


def needs(module: str) -> None:
    """Skip where the clients' interpreter does not have a module."""
    found = subprocess.run(
        [PYTHON, "-c", f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"],
        env=OUTSIDE,
        check=False,
    )
    if found.returncode != 0:
        pytest.skip(f"{module} is not installed: make test-clients")


@pytest.fixture(autouse=True)
def _one_at_a_time() -> Iterator[None]:
    """Programs in real time need their cores."""
    with (Path(tempfile.gettempdir()) / f"companion-sitl-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def vehicle(*words: str) -> Iterator[int]:
    """Run the simulator's vehicle; gives the port on which a ground station hears it."""
    ports = []
    for _ in range(2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            ports.append(str(probe.getsockname()[1]))
    command = [sys.executable, "-m", "sitl_stub", "vehicle", "--onboard-port", ports[0], "--ground-port", ports[1]]
    process = subprocess.Popen([*command, *words], cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.DEVNULL)
    try:
        yield int(ports[1])
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(timeout=END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def mavsdk_session(what: str, *words: str) -> dict[str, Any]:
    """Run one session of `mavsdk_session.py`; gives each step's value, or {"error": name}."""
    needs("mavsdk.plugins.action")
    with vehicle(*words) as port:
        done = subprocess.run(
            [PYTHON, str(Path(__file__).with_name("mavsdk_session.py")), what, str(port)],
            cwd=tempfile.gettempdir(),
            env=OUTSIDE,
            text=True,
            capture_output=True,
            timeout=SESSION_S,
            check=False,
        )
    steps = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"step"')]
    assert done.returncode == 0, (steps, done.stderr)
    return {step["step"]: {"error": step["error"]} if "error" in step else step["value"] for step in steps}


def test_mavsdk_flies_a_whole_session() -> None:
    steps = mavsdk_session("flight")
    failed = {name: value for name, value in steps.items() if value is False or isinstance(value, dict)}
    assert failed == {}
    assert (steps["connection"], steps["system"], steps["version"]) == ("SUCCESS", 1, 1)
    assert (steps["takeoff altitude read"], steps["float read"], steps["int read"]) == (3.0, 11.0, 3)
    assert steps["float"] == 12.0
    assert steps["all parameters"] > 500
    assert {"there", "moves", "turns", "stands", "landed", "disarmed"} <= set(steps)


def test_mavsdk_reports_what_is_refused() -> None:
    steps = mavsdk_session("refusals")
    refused = {name: value["error"] for name, value in steps.items() if isinstance(value, dict)}
    assert refused == {
        "offboard without a setpoint": "NO_SETPOINT_SET",
        "unknown parameter": "DOES_NOT_EXIST",
        "wrong type read": "WRONG_TYPE",
        "wrong type set": "TYPE_MISMATCH",
        "relay": "UNSUPPORTED",
        "vtol": "NO_VTOL_TRANSITION_SUPPORT",
        "disarm in the air": "COMMAND_DENIED",
        "reboot in the air": "COMMAND_DENIED",
    }
    assert False not in steps.values()


def test_mavsdk_is_told_that_the_vehicle_is_not_ready() -> None:
    steps = mavsdk_session("unready", "--fault", "refuse_arming=gps")
    assert (steps["healthy"], steps["arm"]) == (0, {"error": "COMMAND_DENIED"})


class MavProxy:
    """MAVProxy without windows, typed into and read."""

    def __init__(self, port: int, folder: Path) -> None:
        words = [f"--master=udpin:127.0.0.1:{port}", f"--state-basedir={folder}"]
        words.append("--default-modules=link,log,param,mode,arm,cmdlong")
        self._process = subprocess.Popen(
            [PYTHON, str(Path(PYTHON).with_name("mavproxy.py")), *words],
            cwd=folder,
            env=OUTSIDE | {"HOME": str(folder)},
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.said = ""
        self._read = threading.Thread(target=self._listen)
        self._read.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        while character := self._process.stdout.read(1):
            self.said += character

    def type(self, line: str, *expected: str) -> None:
        """Type a line, and wait until each pattern has been printed after it."""
        assert self._process.stdin is not None
        begin = len(self.said)
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        self.wait(*expected, begin=begin)

    def wait(self, *expected: str, begin: int = 0) -> None:
        """Wait until each pattern has been printed."""
        end = time.monotonic() + WAIT_S
        for pattern in expected:
            while not re.search(pattern, self.said[begin:]):
                assert time.monotonic() < end, (pattern, self.said)
                time.sleep(0.05)

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.wait(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._read.join()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()


@contextlib.contextmanager
def mavproxy(folder: Path, *words: str) -> Iterator[MavProxy]:
    needs("MAVProxy")
    with vehicle(*words) as port:
        station = MavProxy(port, folder)
        try:
            station.wait("online system 1", r"Received \d{3} parameters")
            yield station
        finally:
            station.close()


def test_mavproxy_plays_the_ground_station(tmp_path: Path) -> None:
    with mavproxy(tmp_path) as station:
        station.type("param show MPC_XY_VEL_MAX", r"MPC_XY_VEL_MAX +12\.0")
        station.type("param set MPC_XY_VEL_MAX 9", "")
        station.type("param fetch MPC_XY_VEL_MAX", "")
        time.sleep(0.5)
        station.type("param show MPC_XY_VEL_MAX", r"MPC_XY_VEL_MAX +9\.0")
        # `mode NAME` of MAVProxy 1.8.75 cannot name a mode to PX4 (it packs a triple as one number)
        station.type("long DO_SET_MODE 1 4 5", "Mode RTL")
        station.type("long DO_SET_MODE 1 4 3", "Mode LOITER")
        station.type("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED", "AP: Armed by external command", "ARMED")
        station.type("long NAV_TAKEOFF", "NAV_TAKEOFF: ACCEPTED", "Mode TAKEOFF", "AP: Takeoff detected", "Mode LOITER")
        station.type("disarm", "COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED", "Disarming denied: not landed")
        station.type("long NAV_LAND", "Mode LAND", "Landing detected", "DISARMED")
    saved = (tmp_path / "mav.parm").read_text(encoding="utf-8")
    assert len(saved.splitlines()) > 500


def test_mavproxy_shows_why_arming_is_refused(tmp_path: Path) -> None:
    with mavproxy(tmp_path, "--fault", "refuse_arming=gps") as station:
        station.type("arm throttle", "COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED", "Arming denied")
