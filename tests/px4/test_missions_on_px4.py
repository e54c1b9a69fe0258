"""The landing missions on a running PX4 that simulates its own vehicle (SIH); `make test-px4`, docs/px4_sitl.md.

Read from the environment: `PX4`, where the companion hears it (as for `companion fly --connect`); `PX4_WORLD`, where
`sitl-stub world` hears it; `PX4_FLIGHTS`, how often each mission is flown; `PX4_MISSIONS`, which (names below
`missions/`, with blanks between).
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
import yaml
from processes import END_S, ROOT, camera_of, fly_words, landing_errors, process
from pymavlink.dialects.v20 import all as mavlink

pytestmark = pytest.mark.px4

URL = os.environ.get("PX4") or "udp://127.0.0.1:14540"
WORLD_URL = os.environ.get("PX4_WORLD") or "udp://127.0.0.1:14550"
FLIGHTS = int(os.environ.get("PX4_FLIGHTS") or 1)
MISSIONS = (os.environ.get("PX4_MISSIONS") or "land_static land_moving follow_then_land").split()
HEAR_S, FLIGHT_S = 5.0, 300.0
ERROR_MAX, MEAN_MAX = 0.30, 0.10  # [m]


@pytest.fixture(scope="module")
def system() -> int:
    """System id of the running PX4; skips where none is heard."""
    parts = urlsplit(URL)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((parts.hostname or "127.0.0.1", parts.port or 14540))
        sock.settimeout(HEAR_S)
        end = time.monotonic() + HEAR_S
        with contextlib.suppress(TimeoutError):
            while time.monotonic() < end:
                data = sock.recv(2048)
                heartbeat = data[0] == 0xFD and int.from_bytes(data[7:10], "little") == mavlink.MAVLINK_MSG_ID_HEARTBEAT
                if heartbeat and data[6] == 1:
                    return data[5]
    pytest.skip(f"no PX4 heard on {URL} within {HEAR_S:g} s: docs/px4_sitl.md says how one is started")


@contextlib.contextmanager
def world(name: str, seed: int, system: int) -> Iterator[tuple[subprocess.Popen[str], str]]:
    words = ("--autopilot", WORLD_URL, "--world", name, "--seed", str(seed), "--system", str(system))
    with process("-m", "sitl_stub", "world", *words, "--mjpeg-port", "0", "--json") as simulator:
        yield simulator, camera_of(simulator)


def fly(mission: str, system: int, camera: str, folder: Path) -> dict[str, Any]:
    words = fly_words(URL, camera, folder, "--set", f"link.mavlink.system_id={system}", mission=mission)
    with process("-m", "companion", *words, folder=folder) as flight:
        try:
            output, said = flight.communicate(timeout=FLIGHT_S)
        except subprocess.TimeoutExpired:
            flight.send_signal(signal.SIGINT)  # hands the vehicle to Hold
            output, said = flight.communicate(timeout=END_S)
    lines = output.strip().splitlines()
    assert lines, said
    result: dict[str, Any] = json.loads(lines[-1])
    return result


@pytest.mark.parametrize("seed", range(1, FLIGHTS + 1))
@pytest.mark.parametrize("mission", MISSIONS)
def test_mission_lands_on_px4(
    mission: str, seed: int, system: int, flown: list[dict[str, Any]], tmp_path: Path
) -> None:
    path = ROOT / "missions" / f"{mission}.yaml"
    name = yaml.safe_load(path.read_text(encoding="utf-8"))["simulation"]["world"]
    with world(name, seed, system) as (simulator, camera):
        result = fly(mission, system, camera, tmp_path)
        time.sleep(1.5)  # the heartbeat that says disarmed
        simulator.send_signal(signal.SIGTERM)
        output, said = simulator.communicate(timeout=END_S)
    assert simulator.returncode == 0, said
    truth = json.loads(output.strip().splitlines()[-1])
    position, heading = landing_errors(truth)
    slow = "the machine was too slow" if "too slow" in said else ""
    row = {"mission": mission, "seed": seed, "outcome": result["outcome"], "duration": result["duration_s"]}
    flown.append(row | {"position": position, "heading_deg": math.degrees(heading), "note": slow})
    assert result["outcome"] == "landed", (result["reason"], said)
    assert (truth["armed"], truth["surface"]) == (False, "pad")
    assert position < ERROR_MAX


def test_mean_error_is_what_is_required(system: int, flown: list[dict[str, Any]]) -> None:
    if not flown:
        pytest.skip("no mission was flown")
    assert sum(row["position"] for row in flown) / len(flown) <= MEAN_MAX
