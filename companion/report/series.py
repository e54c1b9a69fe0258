"""A recording as arrays over time: what the picture draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.place import distance_to_place
from companion.recording import Record, Recording

CHANNELS = frozenset(("truth", "track", "decision", "observation", "result"))


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeSpan:
    """One stay in a mode."""

    mode: str
    start: float  # [s]
    end: float  # [s]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TruthSeries:
    """Vehicle and target, sampled together."""

    t: Array  # (n,) [s]
    position: Array  # (n, 3) [m] ned, the vehicle's body origin
    velocity: Array  # (n, 3) [m/s]
    yaw: Array  # (n,) [rad]
    feet: Array  # (n,) feet in contact
    pad_position: Array  # (n, 3) [m] ned, the landing point
    pad_velocity: Array  # (n, 3) [m/s]
    pad_yaw: Array  # (n,) [rad]
    pad_half_size: tuple[float, float]  # [m]

    @property
    def offset(self) -> Array:
        """(n, 3) [m] ned, from the landing point to the vehicle."""
        return self.position - self.pad_position

    @property
    def lateral(self) -> Array:
        """(n,) [m] horizontal distance to the landing point."""
        distance: Array = np.hypot(self.offset[:, 0], self.offset[:, 1])
        return distance

    @property
    def in_target(self) -> tuple[Array, Array]:
        """(n,), (n,) [m] the vehicle's place ahead of and to the right of the landing point, in the target's axes."""
        cosine, sine = np.cos(self.pad_yaw), np.sin(self.pad_yaw)
        north, east = self.offset[:, 0], self.offset[:, 1]
        return cosine * north + sine * east, -sine * north + cosine * east

    def distance_to_place(self, standoff: float) -> Array:
        """Give the distances (n,) [m] to the place `standoff` [m] behind the target."""
        return distance_to_place(self.offset, self.pad_yaw, standoff)

    @property
    def heading_error(self) -> Array:
        """(n,) [rad] absolute difference of the headings."""
        return np.abs(wrapped(self.yaw - self.pad_yaw))

    @property
    def contact(self) -> int | None:
        """Index of the first sample of the last contact, after having been in the air; None: never."""
        touching = self.feet > 0
        begins = np.flatnonzero(touching[1:] & ~touching[:-1]) + 1
        return int(begins[-1]) if begins.size and touching[-1] else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackSeries:
    """The estimate of the target, and its true errors."""

    t: Array  # (n,) [s]
    pad_position: Array  # (n, 2) [m] north, east: the estimated offset laid on the true vehicle
    position_error: Array  # (n,) [m] horizontal
    heading_error: Array  # (n,) [rad]
    position_sigma: Array  # (n,) [m] stated: root of the larger horizontal variance
    sigma_heading: Array  # (n,) [rad] stated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """Everything that the picture shows."""

    truth: TruthSeries
    track: TrackSeries | None
    modes: tuple[ModeSpan, ...]
    probabilities: Mapping[str, tuple[Array, Array]]  # name -> times (n,), values (n,)
    seen: tuple[Array, Array]  # times (n,) and 1.0 where the pad was found in the frame
    result: Mapping[str, Any] | None
    metadata: Mapping[str, Mapping[str, str]]
    complete: bool  # False: the recording ends early

    @property
    def t(self) -> Array:
        """(n,) [s] times of the truth."""
        return self.truth.t

    @property
    def standoff(self) -> float | None:
        """Distance [m] of the vehicle's place behind the target; None where it lands on it."""
        said = self.metadata.get("run", {}).get("standoff_m")
        return None if said is None else float(said)

    @property
    def target_word(self) -> str:
        """What the target is called."""
        return "pad" if self.standoff is None else "target"


class Drawn(Protocol):
    """What the pictures of flights and of dockings have in common."""

    @property
    def t(self) -> Array:
        """(n,) [s] times of the truth."""

    @property
    def modes(self) -> tuple[ModeSpan, ...]:
        """The stays in the modes."""

    @property
    def probabilities(self) -> Mapping[str, tuple[Array, Array]]:
        """Name of a probability: times (n,), values (n,)."""

    @property
    def seen(self) -> tuple[Array, Array]:
        """Times (n,), and 1.0 where the target was found in the picture."""

    @property
    def result(self) -> Mapping[str, Any] | None:
        """As in the recording; None: it holds none."""

    @property
    def metadata(self) -> Mapping[str, Mapping[str, str]]:
        """Of the recording."""

    @property
    def complete(self) -> bool:
        """False: the recording ends early."""


def flight_of(recording: Recording) -> Flight | None:
    """Take apart a recording; None where it holds no truth to draw."""
    truth = _truth(recording.of("truth"))
    if truth is None:
        return None
    end = float(truth.t[-1])
    return Flight(
        truth=truth,
        track=_track(recording.of("track"), truth),
        modes=mode_spans(recording.of("decision"), end),
        probabilities=probabilities_over(recording.of("decision")),
        seen=_seen(recording.of("observation")),
        result=recording.last("result"),
        metadata=recording.metadata,
        complete=recording.complete,
    )


def wrapped(angle: Array) -> Array:
    """Bring angles [rad] into [-pi, pi)."""
    result: Array = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return result


def _truth(records: Sequence[Record]) -> TruthSeries | None:
    rows = [record.data for record in records if record.data.get("targets")]
    if not rows:
        return None
    pads = [row["targets"][0] for row in rows]
    quaternion = np.array([row["quaternion"] for row in rows])
    w, x, y, z = quaternion.T
    half = pads[0].get("half_size") or (0.4, 0.4)
    return TruthSeries(
        t=np.array([row["t"] for row in rows]),
        position=np.array([row["position_ned"] for row in rows]),
        velocity=np.array([row["velocity_ned"] for row in rows]),
        yaw=np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        feet=np.array([float(row["feet_in_contact"]) for row in rows]),
        pad_position=np.array([pad["position_ned"] for pad in pads]),
        pad_velocity=np.array([pad["velocity_ned"] for pad in pads]),
        pad_yaw=np.array([pad["yaw"] for pad in pads]),
        pad_half_size=(float(half[0]), float(half[1])),
    )


def _track(records: Sequence[Record], truth: TruthSeries) -> TrackSeries | None:
    if not records:
        return None
    t = np.array([record.data["t"] for record in records])
    state = np.array([record.data["state"] for record in records])
    covariance = np.array([record.data["covariance"] for record in records])
    yaw = np.interp(t, truth.t, np.unwrap(truth.yaw))
    heading = np.interp(t, truth.t, np.unwrap(truth.pad_yaw - truth.yaw))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    estimated = np.column_stack((cosine * state[:, 0] - sine * state[:, 1], sine * state[:, 0] + cosine * state[:, 1]))
    true = -np.column_stack([np.interp(t, truth.t, truth.offset[:, axis]) for axis in (0, 1)])
    vehicle = np.column_stack([np.interp(t, truth.t, truth.position[:, axis]) for axis in (0, 1)])
    error = estimated - true
    return TrackSeries(
        t=t,
        pad_position=vehicle + estimated,
        position_error=np.hypot(error[:, 0], error[:, 1]),
        heading_error=np.abs(wrapped(state[:, 3] - heading)),
        position_sigma=np.sqrt(np.linalg.eigvalsh(covariance[:, :2, :2])[:, -1].clip(0.0)),
        sigma_heading=np.sqrt(covariance[:, 3, 3].clip(0.0)),
    )


def mode_spans(records: Sequence[Record], end: float) -> tuple[ModeSpan, ...]:
    """Give the stays in the modes of a channel of decisions; the last one lasts to `end` [s]."""
    spans: list[ModeSpan] = []
    for record in records:
        mode, t = str(record.data["mode"]), float(record.data["t"])
        if not spans or spans[-1].mode != mode:
            if spans:
                spans[-1] = ModeSpan(mode=spans[-1].mode, start=spans[-1].start, end=t)
            spans.append(ModeSpan(mode=mode, start=t, end=max(end, t)))
    return tuple(spans)


def probabilities_over(records: Sequence[Record]) -> dict[str, tuple[Array, Array]]:
    """Give each probability over time, with a gap (NaN) where the model was not asked."""
    if not any(record.data.get("probabilities") for record in records):
        return {}
    t = np.array([record.data["t"] for record in records])
    found = {}
    for name in ("a11", "a22", "a32", "steady_align"):
        values = [(record.data.get("probabilities") or {}).get(name) for record in records]
        found[name] = (t, np.array([np.nan if value is None else float(value) for value in values]))
    return found


def _seen(records: Sequence[Record]) -> tuple[Array, Array]:
    t = np.array([float(record.data["t"]) for record in records])
    return t, np.array([1.0 if record.data.get("hypotheses") else 0.0 for record in records])
