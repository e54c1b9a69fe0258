"""Reads a recorded experiment: `NAME.csv.gz` with time series, `NAME.events.jsonl` with what was sent and said."""

import csv
import gzip
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sitl_stub.fidelity.estimate_errors import EstimateErrors, euler_angles, recorded_errors
from sitl_stub.fidelity.flight import (
    ACK_GROUND,
    ACK_ONBOARD,
    ARMED,
    HEARTBEAT,
    LANDED_STATE,
    MODE,
    TEXT,
    Angles,
    Array,
    Flight,
    Report,
    Track,
    from_start,
)

Link = Literal["onboard", "ground"]
LINKS: dict[str, Link] = {"api": "onboard", "gcs": "ground"}
ARMING_STATE_ARMED = 2
SET_MODE, MODE_CHANGE_TIME = 176, 0.012
"""MAV_CMD_DO_SET_MODE, and how long PX4 takes to carry it out [s]."""
INPUT_KINDS = ("cmd", "manual", "rcovr", "evin")
IGNORED_TEXT = "[logger]"
"""Texts of PX4's log writer are no part of the autopilot's behaviour."""


class RecordingError(ValueError):
    """A recording that cannot be read; the message names the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One thing that was sent to the autopilot, or done to its simulator."""

    t: float
    """Boot time [s]."""
    link: Link
    kind: str
    """cmd, manual, rcovr, evin, command or parameter."""
    values: Mapping[str, Any]
    """Columns of the row, or fields of the event."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """One experiment: what went in, and what PX4 made of it."""

    name: str
    model: str
    """PX4's name of the simulated vehicle, such as sihsim_quadx."""
    system: int
    """MAVLink system id of the autopilot in the recording."""
    parameters: Mapping[str, float]
    """Parameters that differed from the defaults."""
    start: float
    """Boot time [s] from which the recording counts."""
    end: float
    """Boot time [s] of the last row."""
    heartbeat_phase: float
    """Boot time of HEARTBEAT modulo 1 s."""
    inputs: tuple[Input, ...]
    marks: tuple[tuple[float, str], ...]
    """What the experiment did when, in words."""
    flight: Flight
    errors: EstimateErrors
    """How PX4's estimate was wrong."""

    @property
    def clean(self) -> bool:
        """Whether the estimator was fed with the truth (external vision instead of GNSS and barometer)."""
        return self.parameters.get("EKF2_GPS_CTRL", 7) == 0

    def mark(self, words: str) -> tuple[float, float]:
        """Give begin and end [s] of the part whose mark begins with `words`. Raises `KeyError` without such a mark."""
        for (begin, text), (end, _) in zip(self.marks, [*self.marks[1:], (self.end, "")], strict=True):
            if text.startswith(words):
                return begin, end
        raise KeyError(f"{self.name}: no mark {words!r}")


def read_recording(folder: Path, name: str) -> Recording:
    """Read one experiment from `folder`. Raises `RecordingError` when a file is missing or broken."""
    try:
        with (folder / f"{name}.events.jsonl").open(encoding="utf-8") as file:
            events: list[dict[str, Any]] = [json.loads(line) for line in file]
        with gzip.open(folder / f"{name}.csv.gz", "rt", encoding="utf-8", newline="") as table:
            rows = list(csv.DictReader(table))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{folder / name}: not a readable recording ({error})") from error
    if not events or not rows or events[0].get("type") != "META":
        raise RecordingError(f"{folder / name}: expected a META line and a table with rows")
    meta = events[0]
    _date_the_undated(events)
    system = int(meta["system_id"])
    beats = [float(e["t"]) for e in events if e["type"] == "HEARTBEAT" and e["link"] == "api" and e["t"] > 0.0]
    first_row = float(rows[0]["t_s"])
    first_command = min((float(e["t"]) for e in events if e["type"] == "COMMAND_LONG"), default=first_row)
    start = max(0.0, min(first_row, first_command - 0.5))
    inputs = sorted([*_streams(rows), *_requests(events, system)], key=lambda entry: entry.t)
    return Recording(
        name=name,
        model=str(meta["model"]),
        system=system,
        parameters={key: float(value) for key, value in meta["parameters_changed_at_start"].items()},
        start=start,
        end=float(rows[-1]["t_s"]),
        heartbeat_phase=beats[0] % 1.0 if beats else 0.0,
        inputs=tuple(entry for entry in inputs if entry.t >= start),
        marks=tuple((float(e["t"]), str(e["text"])) for e in events if e["type"] == "MARK"),
        flight=(flight := _flight(rows, events, start)),
        errors=_errors(rows, flight),
    )


def _date_the_undated(events: list[dict[str, Any]]) -> None:
    """Date mode requests from before the host knew the boot clock (stamped 0) by the onboard log's mode change."""
    undated = [e for e in events if e["t"] == 0 and e.get("command") == SET_MODE]
    dated = min((e["t"] for e in events if e["t"] > 0 and e["type"] == "COMMAND_LONG"), default=0.0)
    changes = [e["t"] for e in events if "nav_state_user_intention" in e and e["t"] < dated]
    for event in undated:
        event["t"] = changes[-1] - MODE_CHANGE_TIME if len(changes) > 1 else 0.0
    events.sort(key=lambda e: e["t"])


def _streams(rows: list[dict[str, str]]) -> Iterator[Input]:
    for row in rows:
        kind = row["kind"]
        if kind in INPUT_KINDS:
            link: Link = "ground" if kind in ("manual", "rcovr") else "onboard"
            values = {key: float(cell) for key, cell in row.items() if cell and key not in ("kind", "t_s")}
            yield Input(t=float(row["t_s"]), link=link, kind=kind, values=values)


def _requests(events: list[dict[str, Any]], system: int) -> Iterator[Input]:
    """What was asked for once. The recorded autopilot's system id becomes 1, which is the stub's."""
    for event in events:
        if event["type"] not in ("COMMAND_LONG", "PARAM_SET"):
            continue
        values = dict(event)
        if event["type"] == "COMMAND_LONG":
            target = int(event["target_system"])
            values["target_system"] = {system: 1, 0: 0}.get(target, 99)
            values["params"] = [math.nan if value is None else float(value) for value in event["params"]]
        kind = "command" if event["type"] == "COMMAND_LONG" else "parameter"
        yield Input(t=float(event["t"]), link=LINKS[event["link"]], kind=kind, values=values)


def _flight(rows: list[dict[str, str]], events: list[dict[str, Any]], start: float) -> Flight:
    angles = _columns(rows, "att", ("roll", "pitch", "yaw"))
    return Flight(
        truth=_track(rows, "truth"),
        estimate=_track(rows, "lpos"),
        attitude=Angles(t=angles[:, 0], roll_pitch_yaw=angles[:, 1:]),
        reports=tuple(from_start((r for event in events for r in _report(event)), start)),
    )


def _columns(rows: list[dict[str, str]], kind: str, names: tuple[str, ...]) -> Array:
    """Time and the named columns of one kind of row, shape (n, 1 + names)."""
    found = [[float(row["t_s"]), *(float(row[name]) for name in names)] for row in rows if row["kind"] == kind]
    return np.array(found, dtype=np.float64).reshape(-1, 1 + len(names))


def _errors(rows: list[dict[str, str]], flight: Flight) -> EstimateErrors:
    known = [row for row in rows if row["kind"] == "truth" and row["qw"]]
    quaternions = _columns(known, "truth", ("qw", "qx", "qy", "qz"))
    true_attitude = Angles(t=quaternions[:, 0], roll_pitch_yaw=euler_angles(quaternions[:, 1:]))
    return recorded_errors(flight.truth, flight.estimate, flight.attitude, true_attitude)


def _track(rows: list[dict[str, str]], kind: str) -> Track:
    table = _columns(rows, kind, ("x", "y", "z", "vx", "vy", "vz"))
    return Track(t=table[:, 0], position=table[:, 1:4], velocity=table[:, 4:7])


def _report(event: Mapping[str, Any]) -> Iterator[Report]:
    """What an event says on the channels that are compared."""
    t, kind = float(event["t"]), event["type"]
    if kind == "COMMAND_ACK":
        channel = ACK_ONBOARD if event["link"] == "api" else ACK_GROUND
        yield Report(t=t, channel=channel, value=(event["command"], event["result"]))
    elif kind == "LOG.vehicle_status":
        if "nav_state_name" in event:
            yield Report(t=t, channel=MODE, value=(event["nav_state_name"],))
        if "arming_state" in event:
            yield Report(t=t, channel=ARMED, value=(int(event["arming_state"] == ARMING_STATE_ARMED),))
    elif kind == "EXTENDED_SYS_STATE" and event["link"] == "api":
        yield Report(t=t, channel=LANDED_STATE, value=(event["landed_state"],))
    elif kind == "HEARTBEAT" and event["link"] == "api":
        value = (event["main_mode"], event["sub_mode"], event["base_mode"], event["system_status"])
        yield Report(t=t, channel=HEARTBEAT, value=value)
    elif kind == "STATUSTEXT" and event["chunk_seq"] == 0 and not event["text"].startswith(IGNORED_TEXT):
        yield Report(t=t, channel=TEXT, value=(event["severity"],), words=event["text"].strip())
