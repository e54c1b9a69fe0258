"""The plots of a table: paths, errors over time, bars beside the published figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from companion.campaign.path import FlightPath
from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord
from companion.config import load_flight
from companion.papers.approach_plots import draw_landings, draw_ways
from companion.papers.choice import Chosen
from companion.papers.docking_plots import Records, draw_switching, draw_trajectories
from companion.papers.pareto_plots import draw_pareto
from companion.papers.rows import Row
from companion.papers.spec import PaperCase, Vehicle
from companion.report.picture import save
from companion.report.style import FAINT, INK, PAD, SERIES, STYLE, VEHICLE

_DPI = 110
_WIDTH, _HEIGHT = 4.2, 3.6  # [inch] of one case
_MOST_LINES = 10  # flights drawn in one plot of errors
_WIDE = 20.0  # ratio of figures from which on their axis is logarithmic
_STEP = 0.5  # [m] a path that rises by less is drawn from above
_FLOOR = {"m": 1e-3, "rad": 1e-4}  # smallest value on a logarithmic axis


def write_plots(chosen: Chosen, records: Records, rows: Sequence[Row], folder: Path) -> list[Path]:
    """Draw one table or figure; give the files written.

    Args:
        chosen: the table or figure.
        records: its flights, by case; those without a path are left out.
        rows: its figures.
        folder: where the pictures go.

    Raises:
        RecordingError: a picture cannot be written.
    """
    name = chosen.exhibit.label.replace(" ", "_")
    with rc_context(STYLE):
        drawn = _of_dockings(chosen, records) if _docks(chosen) else _of_flights(chosen, records)
        if chosen.exhibit.study is not None:
            drawn = {"pareto": draw_pareto(chosen, rows, _grid)}
        elif chosen.exhibit.flights_of is None:
            drawn["figures"] = _series(chosen, rows) if _has_series(chosen) else _bars(rows)
        for what, figure in drawn.items():
            save(figure, folder / f"{name}_{what}.png")
    return [folder / f"{name}_{what}.png" for what in drawn]


def _docks(chosen: Chosen) -> bool:
    return chosen.exhibit.vehicle is Vehicle.CUBESAT


def _of_flights(chosen: Chosen, records: Records) -> dict[str, Figure]:
    if "way_left_m" in chosen.exhibit.measures:  # to a pad out of sight
        return (
            {"landings": draw_landings(chosen, records, _grid)}
            if _has_series(chosen)
            else {"ways": draw_ways(chosen, records, _grid)}
        )
    return {"paths": _paths(chosen, records), "errors": _errors(chosen, records)}


def _of_dockings(chosen: Chosen, records: Records) -> dict[str, Figure]:
    """Draw dockings: a table all that there is, a figure of its flights either trajectories or what it measures.

    Where nothing was flown, as for a table about the estimator alone, there are only the bars of its figures.
    """
    exhibit, drawn = chosen.exhibit, {}
    if chosen.cases and (exhibit.flights_of is None or not exhibit.measures):
        drawn["trajectories"] = draw_trajectories(chosen, records, _grid)
    if chosen.cases and (exhibit.flights_of is None or exhibit.measures) and not exhibit.together:
        drawn["switching"] = draw_switching(chosen, records, _grid)
    return drawn


def _paths(chosen: Chosen, records: Records) -> Figure:
    """Draw for each case the first flight that succeeded (else the first), in space, as in the paper's figure 9.

    Drives are drawn from above, with what was foreseen of a target that left the view, as in figure 8.
    """
    shown = [_example(records.get(case.name, [])) for case in chosen.cases]
    leaves = any(case.published.path_rmse_m is not None for case in chosen.cases)
    flat = all(example is None or _is_flat(example[1]) for example in shown)
    figure, places = _grid(len(chosen.cases), projection=None if flat else "3d")
    for axes, case, example in zip(places, chosen.cases, shown, strict=True):
        axes.set_title(f"{case.name}: {case.what}", fontsize=8)
        if example is None:
            continue
        result, path = example
        for points, colour, label in ((path.target_ned, PAD, "target"), (path.vehicle_ned, VEHICLE, "vehicle")):
            north, east, up = points[:, 0], points[:, 1], -points[:, 2]
            line = (east, north) if flat else (east, north, up)
            axes.plot(*line, color=colour, linewidth=1.2, label=label)
            axes.plot(*(values[-1:] for values in line), "o", color=colour, markersize=3)
        axes.set(xlabel="east [m]", ylabel="north [m]")
        if flat and leaves and result.forecast_path is not None:
            foreseen = np.array(result.forecast_path)
            line = foreseen[:, 2], foreseen[:, 1]
            axes.plot(*line, color=INK, linestyle=(0, (3, 2)), linewidth=1.2, label="target, foreseen")
        if flat:
            axes.set_aspect("equal", adjustable="datalim")
        else:
            axes.set_zlabel("up [m]")
            axes.set_aspect("equalxy")
            axes.set_box_aspect(None, zoom=0.85)
        axes.legend(loc="upper left", frameon=False)
    return figure


def _is_flat(path: FlightPath) -> bool:
    """Say whether nothing in it rises by more than a step."""
    down = np.concatenate((path.vehicle_ned[:, 2], path.target_ned[:, 2]))
    return float(np.ptp(down)) < _STEP


def _errors(chosen: Chosen, records: Records) -> Figure:
    """Draw position and heading error over the time since the target's first motion (else since the start)."""
    figure, places = _grid(2 * len(chosen.cases))
    for index, case in enumerate(chosen.cases):
        position, heading = places[2 * index], places[2 * index + 1]
        standoff = _standoff(case)
        for record in records.get(case.name, [])[:_MOST_LINES]:
            path = record.path
            if not isinstance(path, FlightPath):
                continue
            since = path.t - (path.t_moved if path.t_moved is not None else float(path.t[0]))
            distance = np.maximum(path.distance_to_place(standoff or 0.0), _FLOOR["m"])
            position.plot(since, distance, color=VEHICLE, linewidth=0.7, alpha=0.6)
            heading.plot(since, np.maximum(path.heading_error, _FLOOR["rad"]), color=PAD, linewidth=0.7, alpha=0.6)
        published = case.published
        for axes, level in ((position, published.station_position_m), (heading, published.station_angle_rad)):
            axes.set_yscale("log")
            axes.set_xlabel("time [s]")
            if level:
                axes.axhline(level, color=FAINT, linestyle=(0, (4, 3)), linewidth=1.0, label="published mean")
                axes.legend(loc="upper right", frameon=False)
        kind = "lateral" if standoff is None else "position"
        position.set_title(f"{case.name}: {kind} error [m]", fontsize=8)
        heading.set_title(f"{case.name}: heading error [rad]", fontsize=8)
    return figure


def _standoff(case: PaperCase) -> float | None:
    """Give how far [m] behind the target the vehicle's place is; None where it flies above it."""
    if case.mission is None:
        return None
    ground = load_flight(case.mission, overrides=case.overrides).plan.ground
    return None if ground is None else ground.standoff_m


def _bars(rows: Sequence[Row]) -> Figure:
    """Draw each figure of the cases as bars, ours with its interval beside the published."""
    metrics = list(dict.fromkeys((row.metric, row.unit) for row in rows))
    figure, places = _grid(len(metrics))
    for axes, (metric, unit) in zip(places, metrics, strict=True):
        own = [row for row in rows if row.metric == metric]
        at = np.arange(len(own))
        ours = np.array([np.nan if row.ours is None else row.ours for row in own])
        theirs = np.array([np.nan if row.published is None else row.published for row in own])
        reach = np.array([[_reach(row, row.low) for row in own], [_reach(row, row.high) for row in own]])
        axes.bar(at - 0.2, ours, 0.38, color=VEHICLE, label="ours")
        axes.errorbar(at - 0.2, ours, yerr=reach, fmt="none", ecolor=FAINT, elinewidth=1.0, capsize=2.0)
        axes.bar(at + 0.2, theirs, 0.38, color=PAD, label="published")
        axes.set_xticks(at, [row.case for row in own], rotation=30, ha="right")
        axes.set_title(metric if unit == "1" else f"{metric} [{unit}]", fontsize=8)
        axes.set_ylim(0.0, 1.2 * axes.get_ylim()[1])  # room for the legend
        axes.legend(loc="upper right", frameon=False, ncol=2)
    return figure


def _has_series(chosen: Chosen) -> bool:
    return any(case.series for case in chosen.cases)


def _series(chosen: Chosen, rows: Sequence[Row]) -> Figure:
    """Draw each figure over the axis of the cases, a bar for each series, as in the paper's figures 10 and 11.

    The whisker is the standard deviation within a trial, upwards only as there; of a rate its 95 % interval.
    """
    places = list(dict.fromkeys(case.at for case in chosen.cases))
    series = list(dict.fromkeys(case.series for case in chosen.cases))
    metrics = list(dict.fromkeys((row.metric, row.unit) for row in rows))
    width = 0.8 / len(series)
    figure, grid = _grid(len(metrics), width=max(_WIDTH, 0.6 * len(places)))
    for axes, (metric, unit) in zip(grid, metrics, strict=True):
        by_case = {row.case: row for row in rows if row.metric == metric}
        for index, name in enumerate(series):
            own = [(places.index(c.at), by_case[c.name]) for c in chosen.cases if c.series == name]
            at = np.array([place for place, _ in own]) + width * (index - 0.5 * (len(series) - 1))
            ours = np.array([np.nan if row.ours is None else row.ours for _, row in own])
            reach = np.array([_whisker(row) for _, row in own]).T
            axes.bar(at, ours, 0.9 * width, color=SERIES[index % len(SERIES)], label=name)
            axes.errorbar(at, ours, yerr=reach, fmt="none", ecolor=FAINT, elinewidth=1.0, capsize=2.0)
        axes.set_xticks(range(len(places)), places)
        axes.set_title(metric if unit == "1" else f"{metric} [{unit}]", fontsize=8)
        values = [row.ours for row in by_case.values() if row.ours]
        if values and max(values) > _WIDE * min(values):  # a lost target is tens of metres away
            axes.set_yscale("log")
            axes.set_ylim(top=4.0 * axes.get_ylim()[1])  # room for the legend
        else:
            axes.set_ylim(0.0, 1.25 * axes.get_ylim()[1])
        axes.legend(loc="upper left", frameon=False, ncol=2)
    return figure


def _whisker(row: Row) -> tuple[float, float]:
    if row.unit == "1":
        return _reach(row, row.low), _reach(row, row.high)
    return 0.0, row.ours_std or 0.0


def _reach(row: Row, end: float | None) -> float:
    return 0.0 if end is None or row.ours is None else abs(end - row.ours)


def _example(records: Sequence[RunRecord]) -> tuple[FlightResult, FlightPath] | None:
    drawn = [(r.result, r.path) for r in records if r.result is not None and isinstance(r.path, FlightPath)]
    return next((each for each in drawn if each[0].success), drawn[0] if drawn else None)


def _grid(
    count: int, projection: str | None = None, width: float = _WIDTH, height: float = _HEIGHT, columns: int = 4
) -> tuple[Figure, list[Any]]:
    columns = min(columns, count)
    lines = -(-count // columns)
    figure = Figure(figsize=(width * columns, height * lines), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(lines, columns, n + 1, projection=projection) for n in range(count)]
