"""Missions on a running PX4 that simulates its own vehicle (SIH); `make test-px4`, docs/px4_sitl.md.

Read from the environment: `PX4`, where the companion hears it (as for `companion fly --connect`); `PX4_WORLD`, where
`sitl-stub world` hears it; `PX4_START`, a shell command by which PX4 is started anew for each flight (empty: it runs
already); `PX4_FLIGHTS`, how often each mission is flown; `PX4_MISSIONS`, which (names below `missions/`, with blanks
between).
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import END_S, ROOT, camera_of, fly_words, landing_errors, process
from running_px4 import px4

from companion.config import load_flight
from companion.config.flight import Flight
from companion.config.sections import VehicleType

pytestmark = pytest.mark.px4

URL = os.environ.get("PX4") or "udp://127.0.0.1:14540"
WORLD_URL = os.environ.get("PX4_WORLD") or "udp://127.0.0.1:14550"
FLIGHTS = int(os.environ.get("PX4_FLIGHTS") or 1)
MISSIONS = (os.environ.get("PX4_MISSIONS") or "land_static land_moving follow_then_land").split()
START = os.environ.get("PX4_START") or ""
FLIGHT_S = 300.0
LANDING_MAX, MEAN_MAX = 0.30, 0.10  # [m]
STANDOFF_MAX, STANDOFF_TURN_MAX = 0.25, 0.20  # [m], [rad] Patel et al., section 4: a rover's success
ROVER_CONFIG = ROOT / "config" / "rover_px4_sih.yaml"
ROVER_PARAMETERS = {"NAV_RCL_ACT": 1}  # its default, Return, is refused before a drive


@contextlib.contextmanager
def world(flight: Flight, seed: int, system: int) -> Iterator[tuple[subprocess.Popen[str], str]]:
    where = ("--autopilot", WORLD_URL, "--system", str(system), "--mjpeg-port", "0", "--json")
    what = ("--world", flight.mission.world, "--seed", str(seed))
    kind = ("--vehicle", "rover") if on_ground(flight) else ()
    with process("-m", "sitl_stub", "world", *where, *what, *kind) as simulator:
        yield simulator, camera_of(simulator)


def fly(mission: str, flight: Flight, system: int, camera: str, folder: Path) -> dict[str, Any]:
    more = ("--config", str(ROVER_CONFIG)) if on_ground(flight) else ()
    words = fly_words(URL, camera, folder, "--set", f"link.mavlink.system_id={system}", *more, mission=mission)
    with process("-m", "companion", *words, folder=folder) as program:
        try:
            output, said = program.communicate(timeout=FLIGHT_S)
        except subprocess.TimeoutExpired:
            program.send_signal(signal.SIGINT)  # hands the vehicle to Hold
            output, said = program.communicate(timeout=END_S)
    lines = output.strip().splitlines()
    assert lines, said
    result: dict[str, Any] = json.loads(lines[-1])
    return result


def on_ground(flight: Flight) -> bool:
    """Whether a rover drives the mission."""
    return flight.config.vehicle.type is VehicleType.ROVER


def standoff_errors(truth: dict[str, Any], standoff_m: float) -> tuple[float, float]:
    """Give the distance [m] from the place behind the target and the heading [rad] against the target's."""
    _, heading = landing_errors(truth)
    target = truth["targets"][0]
    north, east, _ = target["vehicle_minus_target_ned"]
    behind_north, behind_east = -standoff_m * math.cos(target["yaw"]), -standoff_m * math.sin(target["yaw"])
    return math.hypot(north - behind_north, east - behind_east), heading


@pytest.mark.parametrize("seed", range(1, FLIGHTS + 1))
@pytest.mark.parametrize("mission", MISSIONS)
def test_mission_is_flown_on_px4(mission: str, seed: int, flown: list[dict[str, Any]], tmp_path: Path) -> None:
    flight = load_flight(ROOT / "missions" / f"{mission}.yaml")
    with px4(START, URL, ROVER_PARAMETERS if on_ground(flight) else {}) as system:
        if system is None:
            pytest.skip(f"no PX4 heard on {URL}: docs/px4_sitl.md says how one is started")
        with world(flight, seed, system) as (simulator, camera):
            result = fly(mission, flight, system, camera, tmp_path)
            time.sleep(1.5)  # the heartbeat that says disarmed
            simulator.send_signal(signal.SIGTERM)
            output, said = simulator.communicate(timeout=END_S)
    assert simulator.returncode == 0, said
    truth = json.loads(output.strip().splitlines()[-1])
    ground = flight.plan.ground
    position, heading = landing_errors(truth) if ground is None else standoff_errors(truth, ground.standoff_m)
    slow = "the machine was too slow" if "too slow" in said else ""
    row = {"mission": mission, "seed": seed, "outcome": result["outcome"], "duration": result["duration_s"]}
    flown.append(row | {"position": position, "heading_deg": math.degrees(heading), "note": slow})
    if ground is None:
        assert result["outcome"] == "landed", (result["reason"], said)
        assert (truth["armed"], truth["surface"]) == (False, "pad")
        assert position < LANDING_MAX
    else:
        assert result["outcome"] in ("intercepted", "followed"), (result["reason"], said)
        assert position <= STANDOFF_MAX
        assert abs(heading) <= STANDOFF_TURN_MAX


def test_mean_error_is_what_is_required(flown: list[dict[str, Any]]) -> None:
    if not flown:
        pytest.skip("no mission was flown")
    assert sum(row["position"] for row in flown) / len(flown) <= MEAN_MAX
