"""Reading a recording and putting it in: what happened before the recorder knew the clock, or before it began."""

import csv
import gzip
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from sitl_stub.fidelity.flight import ACK_ONBOARD, MODE
from sitl_stub.fidelity.recording import Input, read_recording
from sitl_stub.fidelity.replay import Replay
from sitl_stub.vehicle.config import VehicleConfig

EXTRACT = Path(__file__).parents[2] / "data" / "px4_sih"


def request(t: float, main: int, sub: int = 0) -> dict[str, Any]:
    return {
        "t": t,
        "type": "COMMAND_LONG",
        "link": "api",
        "command": 176,
        "params": [1, main, sub, 0, 0, 0, 0],
        "target_system": 1,
        "target_component": 1,
    }


def written(folder: Path, events: list[dict[str, Any]]) -> Path:
    """A recording of a vehicle that stands for 5 s."""
    meta = {"t": 0, "type": "META", "model": "sihsim_quadx", "system_id": 1, "parameters_changed_at_start": {}}
    lines = [json.dumps(event) for event in [meta, *events]]
    (folder / "made.events.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    columns = ["kind", "t_s", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw"]
    with gzip.open(folder / "made.csv.gz", "wt", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(columns)
        for k in range(250):
            for kind in ("truth", "lpos", "att"):
                table.writerow([kind, f"{0.02 * k:.3f}", *["0"] * 6, "1", *["0"] * 6])
    return folder


def test_a_mode_request_without_a_time_is_dated_by_the_autopilots_own_log(tmp_path: Path) -> None:
    events = [
        request(0.0, 6),
        {"t": 0.0, "type": "COMMAND_ACK", "link": "api", "command": 176, "result": 0},
        {"t": 0.09, "type": "LOG.vehicle_status", "nav_state_user_intention": 4, "nav_state_name": "AUTO_LOITER"},
        {"t": 1.44, "type": "LOG.vehicle_status", "nav_state_user_intention": 14, "nav_state_name": "OFFBOARD"},
        request(2.25, 4, 3),
        {"t": 2.26, "type": "LOG.vehicle_status", "nav_state_user_intention": 4, "nav_state_name": "AUTO_LOITER"},
    ]
    recording = read_recording(written(tmp_path, events), "made")
    assert [round(entry.t, 2) for entry in recording.inputs] == [1.43, 2.25]
    assert [round(report.t, 2) for report in recording.flight.channel(ACK_ONBOARD)] == [1.43]
    flight = Replay(recording, VehicleConfig.load("sih_quadrotor"), seed=1, errors="none").fly()
    assert [report.value for report in flight.channel(MODE)] == [("AUTO_LOITER",), ("OFFBOARD",), ("AUTO_LOITER",)]


def test_a_recording_of_the_first_seconds_is_flown_from_the_boot(tmp_path: Path) -> None:
    recording = read_recording(written(tmp_path, [request(1.0, 6)]), "made")
    flight = Replay(recording, VehicleConfig.load("sih_quadrotor"), seed=1, errors="none").fly()
    assert flight.channel("heartbeat")[0].value[3] == 0  # not yet ready to arm


def test_sticks_that_come_when_the_recording_begins_came_before() -> None:
    recording = read_recording(EXTRACT, "q07_descent_05")
    centred = {"x": 0.0, "y": 0.0, "z": 500.0, "r": 0.0}
    stream = [Input(t=recording.start + 0.04 * k, link="ground", kind="manual", values=centred) for k in range(25)]
    vehicle = VehicleConfig.load("sih_quadrotor")

    def first_mode(delay: float) -> object:
        inputs = tuple(replace(entry, t=entry.t + delay) for entry in stream)
        changed = replace(recording, inputs=inputs, end=recording.start + 1.0)
        return Replay(changed, vehicle, seed=1, errors="none").fly().channel(MODE)[0].value

    assert first_mode(0.01) == ("POSCTL",)
    assert first_mode(0.5) == ("AUTO_LOITER",)
