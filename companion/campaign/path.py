"""The way that vehicle and target took, thinned out: enough to draw a flight, small enough to keep with its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.campaign.truth import sample_from_record
from companion.geometry.arrays import Array
from companion.geometry.place import distance_to_place

_EVERY_S = 0.1
_DOCKING_EVERY_S = 0.5  # it moves a centimetre meanwhile
_DECIMALS = 4  # 0.1 mm
_COLUMNS, _DOCKING_COLUMNS = 10, 9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightPath:
    """True motion of vehicle and first target, ten times a second."""

    t: Array  # (n,) [s]
    vehicle_ned: Array  # (n, 3) [m] body origin
    vehicle_yaw: Array  # (n,) [rad]
    target_ned: Array  # (n, 3) [m] landing point
    target_yaw: Array  # (n,) [rad]
    moving: Array  # (n,) 1 where the target moves or turns, else 0

    @property
    def lateral(self) -> Array:
        """(n,) [m] horizontal distance from the body origin to the landing point."""
        return self.distance_to_place(0.0)

    def distance_to_place(self, standoff: float) -> Array:
        """Give the horizontal distances (n,) [m] from the body origin to the place `standoff` [m] behind the target."""
        return distance_to_place(self.vehicle_ned - self.target_ned, self.target_yaw, standoff)

    @property
    def heading_error(self) -> Array:
        """(n,) [rad] absolute difference of the headings."""
        turn = self.vehicle_yaw - self.target_yaw
        error: Array = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi)
        return error

    @property
    def t_moved(self) -> float | None:
        """Time [s] of the target's first motion, None where it never moved."""
        moved = np.flatnonzero(self.moving > 0.5)
        return float(self.t[moved[0]]) if moved.size else None

    def as_json(self) -> list[list[float]]:
        """Give plain values: one row for each instant."""
        columns = (self.t, self.vehicle_ned, self.vehicle_yaw, self.target_ned, self.target_yaw, self.moving)
        rows: list[list[float]] = np.round(np.column_stack(columns), _DECIMALS).tolist()
        return rows

    @classmethod
    def from_json(cls, rows: Sequence[Sequence[float]]) -> FlightPath:
        """Read what `as_json` gave.

        Raises:
            ValueError, TypeError: it is something else.
        """
        table = np.array(rows, dtype=float).reshape(-1, _COLUMNS)
        return cls(
            t=table[:, 0],
            vehicle_ned=table[:, 1:4],
            vehicle_yaw=table[:, 4],
            target_ned=table[:, 5:8],
            target_yaw=table[:, 8],
            moving=table[:, 9],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DockingPath:
    """True motion of a docking chaser, twice a second."""

    t: Array  # (n,) [s]
    position: Array  # (n, 3) [m] of its centre, in c
    quaternion: Array  # (n, 4) c_from_d
    impulse: Array  # (n,) [N s] of all nozzles so far

    def as_json(self) -> list[list[float]]:
        """Give plain values: one row for each instant."""
        columns = (self.t, self.position, self.quaternion, self.impulse)
        rows: list[list[float]] = np.round(np.column_stack(columns), _DECIMALS).tolist()
        return rows


def path_from_json(rows: Sequence[Sequence[float]]) -> FlightPath | DockingPath:
    """Read what the `as_json` of either gave; the number of columns tells them apart.

    Raises:
        ValueError, TypeError: it is something else.
    """
    if not rows or len(rows[0]) != _DOCKING_COLUMNS:
        return FlightPath.from_json(rows)
    table = np.array(rows, dtype=float).reshape(-1, _DOCKING_COLUMNS)
    return DockingPath(t=table[:, 0], position=table[:, 1:4], quaternion=table[:, 4:8], impulse=table[:, 8])


class PathRecorder:
    """A recorder that keeps the path only."""

    def __init__(self) -> None:
        self._rows: list[list[float]] = []
        self._next = 0.0

    def record(self, channel: str, t: float, data: Mapping[str, Any]) -> None:
        """Keep a message of the channel `truth` where one is due."""
        if channel != "truth" or t < self._next - 1e-6:
            return
        self._next = t + (_EVERY_S if "targets" in data else _DOCKING_EVERY_S)
        if "targets" not in data:
            self._rows.append([t, *data["position"], *data["quaternion"], data["impulse_ns"]])
            return
        sample = sample_from_record(data)
        target = sample.target(None)
        self._rows.append(
            [t, *sample.position_ned, sample.yaw, *target.position_ned, target.yaw, 1.0 if target.moving else 0.0]
        )

    def record_bytes(self, channel: str, t: float, data: bytes) -> None:
        """Ignore bytes."""

    def close(self) -> None:
        """Do nothing: the path stays."""

    @property
    def path(self) -> FlightPath | DockingPath:
        """The path so far."""
        return path_from_json(self._rows)
