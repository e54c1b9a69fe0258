"""`companion fly` against `sitl-stub`: two programs, real sockets, the clock on the wall.

What is refused on the ground runs beside other tests, without the mark `sitl`.
"""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import finish, fly, fly_words, process
from sitl_programs import STALL_S, TRIES, Stub, stub


@pytest.mark.sitl
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


@contextlib.contextmanager
def flying(simulator: Stub, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a flight and wait until it is armed."""
    words = fly_words(simulator.url, simulator.camera, folder)
    with process("-m", "companion", *words, folder=folder) as flight:
        assert flight.stderr is not None
        if not any("armed and in OFFBOARD" in line for line in flight.stderr):
            raise AssertionError("the vehicle was not armed")
        yield flight


@pytest.mark.sitl
def test_a_vehicle_that_falls_silent_is_lost(tmp_path: Path) -> None:
    with stub() as simulator, flying(simulator, tmp_path) as flight:
        simulator.process.kill()
        code, result, _ = finish(flight)
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


@pytest.mark.sitl
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_hands_the_vehicle_to_hold(tmp_path: Path, number: signal.Signals) -> None:
    with stub() as simulator:
        with flying(simulator, tmp_path) as flight:
            time.sleep(4.0)  # into the air
            flight.send_signal(number)
            code, result, said = finish(flight)
        truth = simulator.stop()
    assert code == 1
    assert result["outcome"] == "aborted"
    assert result["reason"] == "stopped by the operator"
    assert "AUTO.LOITER, armed" in said
    assert truth["armed"] is True
