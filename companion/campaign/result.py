"""What one flight came to."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from companion.messages.decision import Mode, Switch
from companion.messages.docking import DockingMode, DockingSwitch
from companion.recording import to_plain


class Outcome(Enum):
    """How a mission can end."""

    LANDED = "landed"
    DOCKED = "docked"
    INTERCEPTED = "intercepted"
    FOLLOWED = "followed"
    HELD = "held"
    ABORTED = "aborted"
    FAILED = "failed"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class StationKeeping:
    """How well the vehicle kept station, at 50 Hz from the target's first motion until the descent."""

    position_mean_m: float  # horizontal distance from the body origin to the landing point
    position_std_m: float
    angle_mean_rad: float  # absolute difference of the headings
    angle_std_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitViolation:
    """One limit that was broken, at its worst."""

    limit: str  # which one, in words
    allowed: float  # SI, tolerance included
    worst: float  # SI
    t: float  # [s] when
    configured: float | None = None  # SI, the limit itself; None in results of older versions

    @property
    def bound(self) -> str:
        """What it should have kept to, in words: the limit, and what the tolerance of the score makes of it."""
        if self.configured is None or self.configured == self.allowed:
            return f"allowed {self.allowed:.2f}"
        return f"limit {self.configured:.2f}, with tolerance {self.allowed:.2f}"

    @property
    def sentence(self) -> str:
        """What happened, in words."""
        return f"broke a limit at {self.t:.1f} s: {self.limit} {self.worst:.2f}, {self.bound}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingFigures:
    """What only a docking has."""

    policy: str  # that switched the modes
    impulse_ns: float  # true, of all nozzles, until the contact or the end
    lateral_speed_mps: float | None  # along the docking face at the contact; None: no contact
    reorient_range_m: float | None  # r2: estimated range at which it began to turn; None: never
    align_range_m: float | None  # r1: estimated range at which it moved in front of the port, the first time
    attempts: int  # runs at the docking face, the last one included
    outliers: int  # outliers among the ranges that came to the estimator's gate,
    outliers_rejected: int  # those of them that it rejected,
    ranges: int  # the other ranges that came to it,
    ranges_rejected: int  # and those of them that it rejected all the same


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachFigures:
    """What only a flight to a pad out of sight has; true, from the end of the climb to the touchdown."""

    way_left_s: float | None  # when the way there was left the first time; None: it never was
    way_left_m: float | None  # horizontal distance of the pad then
    height_m: float | None  # of the body above the pad then
    seen: bool | None  # whether the camera saw the pad then; else it was searched for
    coarse_offset_m: tuple[float, float] | None  # of the pad by the coarse estimate then, north and east of the true
    duration_s: float
    energy_j: float  # electric, by momentum theory along the true path

    @property
    def coarse_error_m(self) -> float | None:
        """Horizontal error of the coarse estimate where the way was left."""
        return None if self.coarse_offset_m is None else math.hypot(*self.coarse_offset_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightResult:
    """The figures of one flight, against the truth. Definitions: docs/components/campaign.md."""

    outcome: Outcome
    success: bool  # the mission's own goal was reached, tracked throughout, no limit broken
    reason: str  # one plain sentence
    # horizontal, body origin to landing point, at rest; None: never at rest on a surface. Of a docking: to the docked
    # place, in space, at the contact; None: no contact
    position_error_m: float | None
    angular_error_rad: float | None  # absolute difference of the headings, at rest
    station_keeping: StationKeeping | None  # None: the target never moved before the descent
    duration_s: float  # from the start until at rest, or until the mission ended
    touchdown_speed_mps: float | None  # relative to the surface, at first contact
    mode_history: tuple[Switch, ...] | tuple[DockingSwitch, ...]
    limits_violated: tuple[LimitViolation, ...]
    tracking_gap_s: float | None  # longest time without a fused measurement, first acquisition to contact
    wall_s: float  # time on the wall that the flight took to simulate
    seed: int
    along_error_m: float | None = None  # on the ground: along the target's heading, after the stop
    cross_error_m: float | None = None  # and across it
    path_rmse_m: float | None = None  # on the ground: of the forecasts with which losses of sight began
    # the first of them: t [s], north and east [m], put to where the vehicle truly stood
    forecast_path: tuple[tuple[float, float, float], ...] | None = None
    docking: DockingFigures | None = None  # of a docking
    approach: ApproachFigures | None = None  # of a flight to a pad out of sight
    wind_mps: float | None = None  # mean horizontal wind of the simulated world, as drawn; None: no air, a docking

    def as_json(self, *, with_wall: bool = True) -> dict[str, Any]:
        """Give plain values.

        Args:
            with_wall: keep `wall_s`; without it equal seeds give equal values, as a recording needs them.
        """
        plain: dict[str, Any] = to_plain(self)
        if not with_wall:
            del plain["wall_s"]
        return plain

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> FlightResult:
        """Read what `as_json` gave.

        Raises:
            KeyError, TypeError, ValueError: it is something else.
        """
        values = {field.name: data[field.name] for field in dataclasses.fields(cls)}
        keeping = values["station_keeping"]
        values["outcome"] = Outcome(values["outcome"])
        values["station_keeping"] = None if keeping is None else StationKeeping(**keeping)
        history, docking, approach = values["mode_history"], values["docking"], values["approach"]
        if approach is not None:
            offset = approach["coarse_offset_m"]
            offset = None if offset is None else (offset[0], offset[1])
            values["approach"] = ApproachFigures(**{**approach, "coarse_offset_m": offset})
        if docking is None:
            values["mode_history"] = tuple(Switch(**{**s, "mode": Mode(s["mode"])}) for s in history)
        else:
            values["docking"] = DockingFigures(**docking)
            values["mode_history"] = tuple(DockingSwitch(**{**s, "mode": DockingMode(s["mode"])}) for s in history)
        if values["forecast_path"] is not None:
            values["forecast_path"] = tuple((t, north, east) for t, north, east in values["forecast_path"])
        values["limits_violated"] = tuple(LimitViolation(**violation) for violation in values["limits_violated"])
        return cls(**values)
