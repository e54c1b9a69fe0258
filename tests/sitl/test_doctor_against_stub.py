"""`companion doctor` against `sitl-stub`: two programs, real sockets. How well they keep time is not judged here.

Nothing flies, so these run beside other tests, without the mark `sitl`.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import subprocess
import sys
import threading
import tty
from pathlib import Path

import pytest
from processes import ENVIRONMENT, ROOT
from sitl_programs import Stub, stub

MISSION = ROOT / "missions" / "land_static.yaml"
# What a machine that is short of time may fail in.
TIMING = {"link", "round trip", "autopilot's clock", "message rates", "frame rate", "CPU load", "disk"}


def doctor(*words: str) -> tuple[int, dict[str, dict[str, object]], str]:
    """Run to the end; give exit code, rows by name and what was said."""
    command = [sys.executable, "-m", "companion", "doctor", "--json", *words]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, text=True, capture_output=True, timeout=60.0, check=False)
    lines = done.stdout.strip().splitlines()
    result = json.loads(lines[-1])
    if "problems" in result:  # nothing was started
        assert result["ok"] is False
        return done.returncode, {}, done.stderr
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


def test_an_unsafe_parameter_a_sick_sensor_and_a_missing_camera_are_named() -> None:
    with stub("--fault", "refuse_arming=gps") as simulator:
        words = ["--mission", str(MISSION), "--connect", simulator.url, "--camera-source", "/dev/no-such-camera"]
        code, rows, said = doctor(*words, "--set", "preflight.autopilot.COM_RC_OVERRIDE.bits_set=2")
    assert code == 1
    assert not_fine(rows) - TIMING == {"COM_RC_OVERRIDE", "sensors", "camera"}
    assert rows["COM_RC_OVERRIDE"]["found"] == "1"
    assert "bit 1 set" in str(rows["COM_RC_OVERRIDE"]["wanted"])
    assert "GPS" in str(rows["sensors"]["found"])
    assert "no-such-camera" in str(rows["camera"]["found"])
    assert "COM_RC_OVERRIDE" in said


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


def carry(wire: socket.socket, line: int, stop: threading.Event) -> None:
    """Carry MAVLink between a UDP socket, to which the simulator sends, and a serial line."""
    peer = None
    while not stop.is_set():
        for ready in select.select([wire, line], [], [], 0.05)[0]:
            if ready is wire:
                data, peer = wire.recvfrom(4096)
                with contextlib.suppress(BlockingIOError):  # nobody reads: a line drops it
                    os.write(line, data)
            elif peer is not None:
                wire.sendto(os.read(line, 4096), peer)


def test_over_a_serial_line() -> None:
    autopilot_side, device_side = os.openpty()
    tty.setraw(device_side)
    os.set_blocking(autopilot_side, False)
    stop = threading.Event()
    with stub() as simulator, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", int(simulator.url.rsplit(":", 1)[1])))
        carrier = threading.Thread(target=carry, args=(wire, autopilot_side, stop))
        carrier.start()
        try:
            url = f"serial://{os.ttyname(device_side)}?baud=921600"
            code, rows, said = doctor("--config", str(ROOT / "config" / "x500_sim.yaml"), "--connect", url)
        finally:
            stop.set()
            carrier.join()
            os.close(device_side)
            os.close(autopilot_side)
    assert code == 1  # without its camera
    assert not_fine(rows) - TIMING == {"camera"}, said
    assert float(rows["link"]["figures"]["messages"]) > 500  # type: ignore[index]
