"""The figures of the papers: what they are called, and where a flight has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from companion.campaign.result import ApproachFigures, FlightResult, StationKeeping
from companion.papers.spec import Published

OfFlight = Callable[[FlightResult], float | None]
SUCCESS = "success rate"
DOCKING_TIME, IMPULSE = "docking time", "total impulse"


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One figure; less is better."""

    words: str  # its name in rows and tables
    unit: str
    of_flight: OfFlight | None  # None: no flight measures it yet
    spread: OfFlight | None = None  # its standard deviation within the flight
    spread_key: str | None = None  # that deviation as published, in `Published`
    short: str = ""  # a shorter name, for narrow tables


def _station(pick: Callable[[StationKeeping], float]) -> OfFlight:
    return lambda result: None if result.station_keeping is None else pick(result.station_keeping)


def _docked(pick: OfFlight) -> OfFlight:
    """Of dockings that succeeded only: one that was given up early is not a fast one."""
    return lambda result: pick(result) if result.docking is not None and result.success else None


def _approach(pick: Callable[[ApproachFigures], float | None]) -> OfFlight:
    """Of flights to a pad out of sight; those that landed only, as for dockings."""
    return lambda result: pick(result.approach) if result.approach is not None and result.success else None


# By the name of the published value.
METRICS: Mapping[str, Metric] = {
    "position_error_m": Metric(words="position error", unit="m", of_flight=lambda r: r.position_error_m),
    "angular_error_rad": Metric(words="angular error", unit="rad", of_flight=lambda r: r.angular_error_rad),
    "along_track_error_m": Metric(words="along-track error", unit="m", of_flight=lambda r: r.along_error_m),
    "cross_track_error_m": Metric(words="cross-track error", unit="m", of_flight=lambda r: r.cross_error_m),
    "station_position_m": Metric(
        words="station-keeping position error",
        unit="m",
        of_flight=_station(lambda s: s.position_mean_m),
        spread=_station(lambda s: s.position_std_m),
        spread_key="station_position_std_m",
        short="station-keeping",
    ),
    "station_angle_rad": Metric(
        words="station-keeping angular error",
        unit="rad",
        of_flight=_station(lambda s: s.angle_mean_rad),
        spread=_station(lambda s: s.angle_std_rad),
        spread_key="station_angle_std_rad",
        short="station-keeping",
    ),
    "duration_s": Metric(words=DOCKING_TIME, unit="s", of_flight=_docked(lambda r: r.duration_s)),
    "impulse_ns": Metric(
        words=IMPULSE, unit="N s", of_flight=_docked(lambda r: r.docking.impulse_ns if r.docking else None)
    ),
    "reorient_range_m": Metric(
        words="turn begins, r2",
        unit="m",
        of_flight=_docked(lambda r: r.docking.reorient_range_m if r.docking else None),
    ),
    "align_range_m": Metric(
        words="moves in front, r1",
        unit="m",
        of_flight=_docked(lambda r: r.docking.align_range_m if r.docking else None),
    ),
    "way_left_m": Metric(words="way left at", unit="m", of_flight=_approach(lambda a: a.way_left_m)),
    "coarse_error_m": Metric(
        words="coarse estimate's error there",
        unit="m",
        of_flight=_approach(lambda a: a.coarse_error_m),
        short="coarse error",
    ),
    "approach_s": Metric(words="time to touchdown", unit="s", of_flight=_approach(lambda a: a.duration_s)),
    "energy_kj": Metric(words="energy to touchdown", unit="kJ", of_flight=_approach(lambda a: 1e-3 * a.energy_j)),
    "operations_flop": Metric(words="operations", unit="FLOP", of_flight=None),
    "memory_kb": Metric(words="memory", unit="kB", of_flight=None),
    "runtime_ms": Metric(words="run time", unit="ms", of_flight=None),
    "path_rmse_m": Metric(words="RMSE of the predicted path", unit="m", of_flight=lambda r: r.path_rmse_m),
}


def published_value(published: Published, name: str) -> float | None:
    """Give a published figure by its name."""
    value: float | None = getattr(published, name)
    return value
