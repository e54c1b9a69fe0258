"""`companion fly` against `sitl-stub`: two programs, real sockets, the clock on the wall."""

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
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
END_S, FLIGHT_S = 15.0, 90.0
TRIES, STALL_S = 3, 0.25


@pytest.fixture(autouse=True)
def _one_at_a_time() -> Iterator[None]:
    """Programs in real time need their cores: two workers of pytest must not fly at the same time."""
    with (Path(tempfile.gettempdir()) / f"companion-sitl-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


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


def fly_command(simulator: Stub, folder: Path, *words: str) -> list[str]:
    command = [sys.executable, "-m", "companion", "fly", str(ROOT / "missions" / "land_static.yaml")]
    command += ["--config", str(ROOT / "config" / "x500_sim.yaml"), "--json", "--record", str(folder)]
    command += ["--auto-engage", "--set", f"operator.socket={folder / 'operator.sock'}"]
    command += ["--connect", simulator.url, "--camera-source", simulator.camera, "--set", "recording.frames=false"]
    return [*command, *words]


def fly(simulator: Stub, folder: Path, *words: str) -> tuple[int, dict[str, object], str]:
    """Run to the end; give exit code, result and what was said."""
    done = subprocess.run(
        fly_command(simulator, folder, *words),
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        timeout=FLIGHT_S,
        check=False,
    )
    lines = done.stdout.strip().splitlines()
    return done.returncode, json.loads(lines[-1]) if lines else {}, done.stderr


def test_lands_on_the_pad_in_wall_time(tmp_path: Path) -> None:
    for _ in range(TRIES):
        with stub() as simulator:
            code, result, said = fly(simulator, tmp_path)
            truth = simulator.stop()
        if code == 0 or simulator.lost_time < STALL_S:
            break  # a simulator that was starved of its core says nothing of the companion: once more
    assert code == 0, said
    assert result["outcome"] == "landed"
    assert result["success"] is True
    assert truth["armed"] is False
    assert truth["surface"] == "pad"
    assert truth["feet_in_contact"] == 4
    north, east, _ = truth["targets"][0]["vehicle_minus_target_ned"]  # type: ignore[index]
    assert (north**2 + east**2) ** 0.5 < 0.3
    modes = [switch["mode"] for switch in result["mode_history"]]  # type: ignore[attr-defined]
    assert modes[0] == "takeoff"
    assert modes[-2:] == ["touchdown", "done"]
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "landed"
    assert (tmp_path / "flight.mcap").stat().st_size > 100_000


def flying(simulator: Stub, folder: Path) -> subprocess.Popen[str]:
    """Start a flight and wait until it is armed."""
    process = subprocess.Popen(
        fly_command(simulator, folder),
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "armed and in OFFBOARD" in line:
            return process
    process.wait(timeout=END_S)
    raise AssertionError("the vehicle was not armed")


def finish(process: subprocess.Popen[str]) -> tuple[int, dict[str, object], str]:
    try:
        output, said = process.communicate(timeout=END_S)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait(timeout=END_S)
    return process.returncode, json.loads(output.strip().splitlines()[-1]), said


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_hands_the_vehicle_to_hold(tmp_path: Path, number: signal.Signals) -> None:
    with stub() as simulator:
        process = flying(simulator, tmp_path)
        time.sleep(4.0)  # into the air
        process.send_signal(number)
        code, result, said = finish(process)
        truth = simulator.stop()
    assert code == 1
    assert result["outcome"] == "aborted"
    assert result["reason"] == "stopped by the operator"
    assert "AUTO.LOITER, armed" in said
    assert truth["armed"] is True


def test_a_vehicle_that_falls_silent_is_lost(tmp_path: Path) -> None:
    with stub() as simulator:
        process = flying(simulator, tmp_path)
        simulator.process.kill()
        code, result, _ = finish(process)
    assert code == 3
    assert result["success"] is False
    assert "lost" in str(result["reason"])


def test_a_vehicle_without_heartbeat(tmp_path: Path) -> None:
    with stub("--fault", "no_heartbeat") as simulator:
        code, result, _ = fly(simulator, tmp_path, "--set", "engagement.vehicle_timeout_s=2.0")
    assert code == 3
    assert result["success"] is False
    assert "no heartbeat within 2 s" in str(result["reason"])


def test_another_vehicle_on_the_link_is_named(tmp_path: Path) -> None:
    with stub() as simulator:
        words = ["--set", "engagement.vehicle_timeout_s=2.0", "--set", "link.mavlink.system_id=7"]
        code, result, _ = fly(simulator, tmp_path, *words)
        truth = simulator.stop()
    assert code == 3
    assert "system 1 component 1" in str(result["reason"])
    assert truth["armed"] is False


def test_every_reason_of_a_refusal_is_shown(tmp_path: Path) -> None:
    with stub("--fault", "refuse_arming=gps") as simulator:
        code, result, said = fly(simulator, tmp_path)
    assert code == 1
    assert result["outcome"] == "refused"
    for text in ("GPS fix too low", "event 29146769", "unhealthy: GPS", "answer to the arm command"):
        assert text in str(result["reason"])
        assert text in said


def test_without_a_camera_nothing_is_started(tmp_path: Path) -> None:
    with stub() as simulator:
        code, result, said = fly(simulator, tmp_path, "--camera-source", str(tmp_path / "no such camera"))
        truth = simulator.stop()
    assert code == 2
    assert result == {}
    assert "no such camera" in said
    assert truth["armed"] is False
