"""`companion doctor` against `sitl-stub`: two programs, real sockets. How well they keep time is not judged here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from test_fly_against_stub import ENVIRONMENT, ROOT, Stub, stub

pytestmark = pytest.mark.sitl

MISSION = ROOT / "missions" / "land_static.yaml"
# What a machine that is short of time may fail in.
TIMING = {"link", "round trip", "autopilot's clock", "message rates", "frame rate", "CPU load", "disk"}


def doctor(*words: str) -> tuple[int, dict[str, dict[str, object]], str]:
    """Run to the end; give exit code, rows by name and what was said."""
    command = [sys.executable, "-m", "companion", "doctor", "--json", *words]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, text=True, capture_output=True, timeout=60.0, check=False)
    lines = done.stdout.strip().splitlines()
    if not lines:
        return done.returncode, {}, done.stderr
    result = json.loads(lines[-1])
    assert result["exit_code"] == done.returncode
    assert result["ok"] is (done.returncode == 0)
    return done.returncode, {row["check"]: row for row in result["checks"]}, done.stderr


def aims(simulator: Stub) -> list[str]:
    return ["--mission", str(MISSION), "--connect", simulator.url, "--camera-source", simulator.camera]


def not_fine(rows: dict[str, dict[str, object]]) -> set[str]:
    return {name for name, row in rows.items() if row["verdict"] == "not fine"}


def test_everything_is_looked_at_and_nothing_is_changed() -> None:
    with stub() as simulator:
        code, rows, said = doctor(*aims(simulator))
        truth = simulator.stop()
    assert not_fine(rows) <= TIMING, said
    assert code == (1 if not_fine(rows) else 0)
    assert set(rows) >= {"link", "round trip", "message rates", "estimator", "sensors", "battery", "GF_ACTION"}
    assert set(rows) >= {"camera", "frame rate", "exposure", "sharpness", "calibration", "camera mount"}
    assert set(rows) >= {"disk", "clock", "CPU load"}
    assert str(rows["autopilot"]["found"]).startswith("PX4 1.17")
    assert rows["COM_OF_LOSS_T"]["figures"] == {"value": 1.0}
    assert truth["armed"] is False
    assert "nothing is armed or changed" in said
    assert "estimator" in said


def test_an_unsafe_parameter_and_a_sick_sensor_are_named() -> None:
    with stub("--fault", "refuse_arming=gps") as simulator:
        accept = "preflight.autopilot.COM_RC_OVERRIDE.bits_set=2"
        code, rows, said = doctor(*aims(simulator), "--set", accept)
    assert code == 1
    assert not_fine(rows) - TIMING >= {"COM_RC_OVERRIDE", "sensors"}
    assert rows["COM_RC_OVERRIDE"]["found"] == "1"
    assert "bit 1 set" in str(rows["COM_RC_OVERRIDE"]["wanted"])
    assert "GPS" in str(rows["sensors"]["found"])
    assert "COM_RC_OVERRIDE" in said


def test_a_camera_that_is_not_there_is_one_row() -> None:
    with stub() as simulator:
        words = ["--mission", str(MISSION), "--connect", simulator.url, "--camera-source", "/dev/no-such-camera"]
        code, rows, _ = doctor(*words)
    assert code == 1
    assert not_fine(rows) - TIMING == {"camera"}
    assert "no-such-camera" in str(rows["camera"]["found"])


def test_the_link_alone_can_be_looked_at() -> None:
    with stub() as simulator:
        code, rows, _ = doctor("--connect", simulator.url)
    assert code == 1
    assert not_fine(rows) - TIMING == {"COM_RC_OVERRIDE", "transmitter"}  # PX4's defaults, no simulation accepted
    assert rows["camera"]["verdict"] == "not checked"


def test_no_vehicle() -> None:
    with stub("--fault", "no_heartbeat") as simulator:
        code, rows, _ = doctor(*aims(simulator), "--set", "engagement.vehicle_timeout_s=2")
    assert code == 3
    assert "no heartbeat within 2 s" in str(rows["vehicle"]["found"])


def test_the_wrong_vehicle() -> None:
    with stub("--fault", "vehicle_type=fixed_wing") as simulator:
        code, rows, _ = doctor(*aims(simulator))
    assert code == 3
    assert "fixed wing" in str(rows["vehicle"]["found"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--connect", "radio://x"], "unknown scheme 'radio'"),
        (["--config", "no/such/file.yaml"], "no/such/file.yaml"),
        (["--seconds", "1"], "5.5"),
        (["--camera-source", "0"], "--config FILE"),
        (["--set", "camera.latency_s=0.1"], "--config FILE"),
        (["--config", str(Path("config") / "x500_sim.yaml"), "--set", "link.url=tcp://nowhere"], "not an IP address"),
    ],
)
def test_bad_input_starts_nothing(words: list[str], said: str) -> None:
    code, rows, errors = doctor(*words)
    assert code == 2
    assert rows == {}
    assert said in errors


def test_a_link_that_cannot_be_opened_is_no_vehicle() -> None:
    code, rows, errors = doctor("--connect", "tcp://127.0.0.1:1")
    assert code == 3
    assert rows == {}
    assert "tcp://127.0.0.1:1: cannot be opened" in errors
