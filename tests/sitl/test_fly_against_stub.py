"""`companion fly` against `sitl-stub`: two programs, real sockets, the clock on the wall."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest
from sitl_programs import END_S, ENVIRONMENT, STALL_S, TRIES, Stub, finish, fly, fly_command, stub

pytestmark = pytest.mark.sitl


def test_lands_on_the_pad_in_wall_time(tmp_path: Path) -> None:
    for _ in range(TRIES):
        with stub() as simulator:
            code, result, said = fly(simulator.url, simulator.camera, tmp_path)
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
        fly_command(simulator.url, simulator.camera, folder),
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
        code, result, _ = fly(simulator.url, simulator.camera, tmp_path, "--set", "engagement.vehicle_timeout_s=2.0")
    assert code == 3
    assert result["success"] is False
    assert "no heartbeat within 2 s" in str(result["reason"])


def test_another_vehicle_on_the_link_is_named(tmp_path: Path) -> None:
    with stub() as simulator:
        words = ["--set", "engagement.vehicle_timeout_s=2.0", "--set", "link.mavlink.system_id=7"]
        code, result, _ = fly(simulator.url, simulator.camera, tmp_path, *words)
        truth = simulator.stop()
    assert code == 3
    assert "system 1 component 1" in str(result["reason"])
    assert truth["armed"] is False


def test_every_reason_of_a_refusal_is_shown(tmp_path: Path) -> None:
    with stub("--fault", "refuse_arming=gps") as simulator:
        code, result, said = fly(simulator.url, simulator.camera, tmp_path)
    assert code == 1
    assert result["outcome"] == "refused"
    for text in ("GPS fix too low", "event 29146769", "unhealthy: GPS", "answer to the arm command"):
        assert text in str(result["reason"])
        assert text in said


def test_without_a_camera_nothing_is_started(tmp_path: Path) -> None:
    with stub() as simulator:
        code, result, said = fly(
            simulator.url, simulator.camera, tmp_path, "--camera-source", str(tmp_path / "no such camera")
        )
        truth = simulator.stop()
    assert code == 2
    assert result == {}
    assert "no such camera" in said
    assert truth["armed"] is False


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
