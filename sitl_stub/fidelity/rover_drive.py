"""A drive of a rover as time series and events: read from a recording of PX4, or driven by the stub with its inputs."""

import csv
import gzip
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.simulation import STEP, Simulation
from sitl_stub.truth import GROUND, Truth, Vector, VehicleTruth
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.mavlink_io import PORTS, Port
from sitl_stub.vehicle.rover.autopilot import RoverAutopilot

Array = npt.NDArray[np.float64]
LINKS: Mapping[str, Port] = {"api": "onboard", "gcs": "ground"}
PLACE, YAW, SPEED_SETPOINT, YAW_RATE_SETPOINT, THROTTLE, STEERING = (
    "place",
    "yaw",
    "speed setpoint",
    "yaw rate setpoint",
    "throttle",
    "steering",
)
"""Time series: true place [m] and velocity [m/s] (north, east, v north, v east); estimated yaw [rad]; setpoints [m/s],
[rad/s]; actuators -1 to 1."""
COLUMNS = {
    PLACE: ("truth", ("x", "y", "vx", "vy")),
    YAW: ("att", ("yaw",)),
    SPEED_SETPOINT: ("speed_sp", ("speed",)),
    YAW_RATE_SETPOINT: ("rate_sp", ("yaw_rate",)),
    THROTTLE: ("act", ("throttle",)),
    STEERING: ("act", ("steering",)),
}
"""Where a recording has them: kind of row, columns."""
MODE_NAMES = {"STAB": "STABILIZED"}
"""Modes that the onboard log calls otherwise."""
LOOKS = 5
"""The stub is looked at every so many steps: 50 Hz."""


class DriveError(ValueError):
    """A recording that cannot be read; the message names the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something the autopilot said, or a state of it that changed."""

    t: float
    """Boot time [s]."""
    channel: str
    """"ack", "mode", "armed" or "landed"."""
    value: tuple[int | str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One message sent to the autopilot."""

    t: float
    """Boot time [s]."""
    link: Port
    message: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """One drive."""

    name: str
    series: Mapping[str, Array]
    """Name -> time [s] and values, shape (n, 1 + values)."""
    events: tuple[Event, ...]
    marks: tuple[tuple[float, str], ...]
    """What the experiment did when [s], in words; the last one ends it."""

    def part(self, name: str, begin: float, end: float) -> Array:
        """Rows of a time series with begin <= t < end."""
        series = self.series[name]
        return series[(series[:, 0] >= begin) & (series[:, 0] < end)]

    def mark(self, words: str, number: int = 0) -> tuple[float, float]:
        """Begin and end [s] of the part whose mark begins with `words`, the `number`-th of them."""
        found = [i for i, (_, text) in enumerate(self.marks) if text.startswith(words)]
        if number >= len(found):
            raise KeyError(f"{self.name}: no mark {words!r} number {number}")
        i = found[number]
        return self.marks[i][0], self.marks[i + 1][0]


def read_drive(folder: Path, name: str) -> tuple[Drive, tuple[Input, ...]]:
    """Read a recorded drive and what was sent to the autopilot. Raises `DriveError`."""
    try:
        with (folder / f"{name}.events.jsonl").open(encoding="utf-8") as lines:
            events: list[dict[str, Any]] = [json.loads(line) for line in lines]
        with gzip.open(folder / f"{name}.csv.gz", "rt", encoding="utf-8", newline="") as table:
            rows = list(csv.DictReader(table))
    except (OSError, ValueError) as error:
        raise DriveError(f"{folder / name}: not a readable recording ({error})") from error
    drive = Drive(
        name=name,
        series={key: _series(rows, kind, columns) for key, (kind, columns) in COLUMNS.items()},
        events=_changes(event for line in events for event in _heard(line)),
        marks=tuple((float(e["t"]), str(e["text"])) for e in events if e["type"] == "MARK"),
    )
    inputs = [*map(_stream, (row for row in rows if row["kind"] in ("cmd", "manual"))), *_commands(events)]
    return drive, tuple(sorted(inputs, key=lambda entry: entry.t))


def _series(rows: Sequence[Mapping[str, str]], kind: str, columns: tuple[str, ...]) -> Array:
    found = [
        [float(row["t_s"]), *(float(row[name]) for name in columns)]
        for row in rows
        if row["kind"] == kind and row[columns[0]]
    ]
    return np.array(found, dtype=np.float64).reshape(-1, 1 + len(columns))


def _heard(line: Mapping[str, Any]) -> Iterable[Event]:
    t, kind = float(line["t"]), line["type"]
    if kind == "COMMAND_ACK":
        yield Event(t=t, channel="ack", value=(line["command"], line["result"]))
    elif kind == "LOG.vehicle_status":
        if "nav_state_name" in line:
            name = line["nav_state_name"]
            yield Event(t=t, channel="mode", value=(MODE_NAMES.get(name, name),))
        if "arming_state" in line:
            yield Event(t=t, channel="armed", value=(int(line["arming_state"] == 2),))
    elif kind == "EXTENDED_SYS_STATE" and line["link"] == "api":
        yield Event(t=t, channel="landed", value=(line["landed_state"],))


def _changes(events: Iterable[Event]) -> tuple[Event, ...]:
    """Drop repetitions of a state."""
    kept: list[Event] = []
    last: dict[str, Event] = {}
    for event in events:
        if event.channel == "ack" or event.channel not in last or last[event.channel].value != event.value:
            kept.append(event)
        last[event.channel] = event
    return tuple(kept)


def _stream(row: Mapping[str, str]) -> Input:
    def cell(name: str) -> float:
        return float(row.get(name) or 0.0)

    t = float(row["t_s"])
    if row["kind"] == "manual":
        x, y, z, r = (int(cell(name)) for name in ("x", "y", "z", "r"))
        return Input(t=t, link="ground", message=mavlink.MAVLink_manual_control_message(1, x, y, z, r, 0))
    values = [cell(name) for name in ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "yaw", "yaw_rate")]
    frame, mask = int(cell("frame")), int(cell("type_mask"))
    message = mavlink.MAVLink_set_position_target_local_ned_message(int(t * 1e3), 1, 1, frame, mask, *values)
    return Input(t=t, link="onboard", message=message)


def _commands(events: Iterable[Mapping[str, Any]]) -> Iterable[Input]:
    for event in events:
        if event["type"] == "COMMAND_LONG":
            message = mavlink.MAVLink_command_long_message(1, 1, event["command"], 0, *map(float, event["params"]))
            yield Input(t=float(event["t"]), link=LINKS[event["link"]], message=message)


class _Plain:
    """World, running world and wind in one: flat ground, calm air, no camera, no dice."""

    def __init__(self) -> None:
        self.targets = self.camera = self.wind = self
        self.ranging = None

    def start(self, *_: object) -> "_Plain":
        return self

    def step(self, *_: object) -> Vector:
        return (0.0, 0.0, 0.0)

    def truths(self) -> tuple[()]:
        return ()

    def frames(self, t: float) -> tuple[()]:  # noqa: ARG002
        return ()

    def surface_under(self, north: float, east: float) -> tuple[float, str, Vector, float]:  # noqa: ARG002
        return (0.0, GROUND, (0.0, 0.0, 0.0), 0.0)


def replay(recorded: Drive, inputs: Sequence[Input], vehicle: VehicleFile, *, seed: int, noise: bool) -> Drive:
    """Send a recording's inputs to the stub at their times; returns its drive.

    Without `noise` the estimate is the truth. Simulation time 0 is the whole second before the first input.
    """
    vehicle = replace(vehicle, estimator=replace(vehicle.estimator, enabled=noise))
    simulation = Simulation(_Plain(), vehicle, seed)  # type: ignore[arg-type]
    begin, end = float(math.floor(inputs[0].t)), recorded.marks[-1][0]
    encoders = {"onboard": mavlink.MAVLink(None, srcSystem=1, srcComponent=191)}
    encoders["ground"] = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    observer = _Observer(simulation, begin)
    waiting = list(reversed(inputs))
    for i in range(round((end - begin) / (STEP * LOOKS))):
        t = begin + i * STEP * LOOKS
        while waiting and waiting[-1].t <= t:
            entry = waiting.pop()
            simulation.advance(entry.t - begin)
            simulation.receive(entry.link, bytes(entry.message.pack(encoders[entry.link])))
            observer.listen(entry.t)
        simulation.advance(t - begin)
        observer.look(t)
    return Drive(name=recorded.name, series=observer.series(), events=_changes(observer.events), marks=recorded.marks)


class _Observer:
    """Notes what the stub does and says."""

    def __init__(self, simulation: Simulation, begin: float) -> None:
        self._simulation = simulation
        self._autopilot = simulation.autopilot
        self._decoder = mavlink.MAVLink(None)
        self._rows: dict[str, list[list[float]]] = {name: [] for name in COLUMNS}
        self.events: list[Event] = []
        self.look(begin)

    def listen(self, t: float) -> None:
        """Take what was sent on both links."""
        for link in PORTS:
            for frame in self._simulation.transmit(link):
                number = frame[7] | frame[8] << 8 | frame[9] << 16
                if number in (mavlink.MAVLINK_MSG_ID_COMMAND_ACK, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE):
                    message = self._decoder.decode(bytearray(frame))
                    if number == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
                        self._note(t, "ack", message.command, message.result)
                    elif link == "onboard":
                        self._note(t, "landed", message.landed_state)

    def _note(self, t: float, channel: str, *value: int | str) -> None:
        self.events.append(Event(t=t, channel=channel, value=value))

    def look(self, t: float) -> None:
        """Take a row of every time series."""
        self.listen(t)
        autopilot = self._autopilot
        if not isinstance(autopilot, RoverAutopilot):
            raise TypeError(f"expected a rover, got {type(autopilot).__name__}")
        self._note(t, "mode", autopilot.commander.mode.name)
        self._note(t, "armed", int(autopilot.commander.armed))
        truth: Truth = self._simulation.truth()
        vehicle: VehicleTruth = truth.vehicle
        drive = autopilot.drive
        values = {
            PLACE: [*vehicle.position_ned[:2], *vehicle.velocity_ned[:2]],
            YAW: [autopilot.estimate.yaw],
            SPEED_SETPOINT: [drive.speed],
            YAW_RATE_SETPOINT: [drive.yaw_rate],
            THROTTLE: [drive.actuators.throttle],
            STEERING: [drive.actuators.steering],
        }
        for name, row in values.items():
            self._rows[name].append([t, *row])

    def series(self) -> dict[str, Array]:
        """Give the time series."""
        return {name: np.array(rows, dtype=np.float64) for name, rows in self._rows.items()}
