"""The plots of flights to a pad out of sight: the way there with the place where it was left, and where they landed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle

from companion.campaign.path import FlightPath
from companion.campaign.result import FlightResult
from companion.config import Flight, load_flight
from companion.config.vehicle import body_height
from companion.geometry.arrays import Array
from companion.guidance.transit import cheapest_way
from companion.messages.decision import Mode
from companion.papers.choice import Chosen
from companion.papers.docking_plots import Grid, Records
from companion.papers.spec import PaperCase
from companion.papers.ways import place_at, stretches
from companion.report.style import FAINT, INK, PAD, SERIES, mode_colour, mode_words

Flown = tuple[FlightPath, FlightResult]
_WIDTH, _HEIGHT = 6.4, 3.3  # [inch] of one picture
_DRAWN_MODES = ("takeoff", "transit", "search", "approach", "reorient", "align", "land", "touchdown")
_GROUNDED = (Mode.PREFLIGHT.value, Mode.DONE.value)  # the vehicle stands
_MARGIN = 1.3  # of what is drawn around the pad
_PRECISE = 0.05  # [m] mean error that the campaign of these missions requires
_MARKS = ("o", "s", "^", "D")


def draw_ways(chosen: Chosen, records: Records, grid: Grid) -> Figure:
    """Draw all flights of each case, height over distance and from above, as in figure 9 of Parikh et al.

    Args:
        chosen: the figure, one case at least.
        records: its flights, by case; those without a path are left out.
        grid: gives a figure with so many axes.
    """
    count = len(chosen.cases)
    figure, places = grid(2 * count, width=_WIDTH, height=_HEIGHT, columns=count)
    for index, case in enumerate(chosen.cases):
        flight, flown = _flight(chosen, case), list(_flown(records, case))
        side, above = places[index], places[count + index]
        for path, result in flown:
            _add_way(side, path, result, _side(path, body_height(flight.config)))
            _add_way(above, path, result, _above(path))
        _add_cheapest(side, flight, flown)
        _add_lowest(side, flight)
        side.axvspan(-_half(flight), _half(flight), ymax=0.02, color=PAD)
        above.add_patch(
            Rectangle((-_half(flight),) * 2, 2.0 * _half(flight), 2.0 * _half(flight), color=PAD, alpha=0.6)
        )
        side.set(xlabel="to the pad, horizontally [m]", ylabel="height of the feet\nabove the pad [m]")
        side.set_ylim(bottom=0.0, top=1.35 * side.get_ylim()[1])  # room for the key
        above.set(xlabel="to the pad, along the way [m]", ylabel="aside [m],\nstretched")
        for axes in (side, above):
            axes.invert_xaxis()
        side.set_title(f"{case.name}: {case.what} ({len(flown)})", fontsize=8)
        above.set_title(_left_at([result for _, result in flown]), fontsize=8)
    _add_key(places[0])
    return figure


def draw_landings(chosen: Chosen, records: Records, grid: Grid) -> Figure:
    """Draw where each flight landed on the pad, and where the coarse estimate had the pad when the way was left.

    As figure 10 of Parikh et al. says: the effectiveness of the switching in ensuring precision landing. Two pictures
    for each place of the axis, a colour for each series.
    """
    places = list(dict.fromkeys(case.at for case in chosen.cases))
    series = list(dict.fromkeys(case.series for case in chosen.cases))
    figure, grid_of_axes = grid(2 * len(places), width=5.0, height=4.6, columns=2)
    for index, place in enumerate(places):
        whole, near = grid_of_axes[2 * index], grid_of_axes[2 * index + 1]
        for case in (case for case in chosen.cases if case.at == place):
            colour, mark = SERIES[series.index(case.series) % len(SERIES)], _MARKS[series.index(case.series)]
            for path, result in _flown(records, case):
                _add_landing(whole, near, path, result, colour, mark)
        half = _half(_flight(chosen, chosen.cases[0]))
        whole.add_patch(Rectangle((-half, -half), 2.0 * half, 2.0 * half, fill=False, edgecolor=PAD, linewidth=1.2))
        near.add_patch(Circle((0.0, 0.0), _PRECISE, fill=False, edgecolor=PAD, linewidth=1.2))
        _set_square(whole, half, f"{place}: the pad by the coarse estimate, way left")
        _set_square(near, _PRECISE, f"{place}: touchdowns, circle of {100.0 * _PRECISE:.0f} cm")
    handles = [
        Line2D([], [], color=SERIES[n % len(SERIES)], marker=_MARKS[n], linestyle="none", markersize=5, label=name)
        for n, name in enumerate(series)
    ]
    cross = Line2D([], [], color=INK, marker="x", linestyle="none", markersize=5, label="not seen by then")
    grid_of_axes[0].legend(handles=[*handles, cross], loc="upper left", frameon=False, ncol=2, fontsize=7)
    return figure


def _flight(chosen: Chosen, case: PaperCase) -> Flight:
    if case.mission is None:
        raise ValueError(f"{chosen.exhibit.label}, {case.name}: no mission; `choose` refuses such cases")
    return load_flight(case.mission, overrides=case.overrides)


def _flown(records: Records, case: PaperCase) -> Iterator[Flown]:
    for record in records.get(case.name, []):
        if isinstance(record.path, FlightPath) and record.result is not None and len(record.path.t):
            yield record.path, record.result


def _half(flight: Flight) -> float:
    return 0.5 * max(flight.pad.size)


def _side(path: FlightPath, body: float) -> Array:
    """Give distance from the pad and height of the feet above it (n, 2) [m]."""
    height = path.target_ned[:, 2] - path.vehicle_ned[:, 2] - body
    return np.column_stack([path.lateral, height])


def _above(path: FlightPath) -> Array:
    """Give the place (n, 2) [m]: to the pad along the straight line from the start, and to the right of that line."""
    offset = path.target_ned[:, :2] - path.vehicle_ned[:, :2]
    course = offset[0] / max(float(np.hypot(*offset[0])), 1e-6)
    along = offset @ course
    aside = -(offset @ np.array([-course[1], course[0]]))
    return np.column_stack([along, aside])


def _add_way(axes: Any, path: FlightPath, result: FlightResult, places: Array) -> None:
    for mode, way in stretches(path.t, places, result.mode_history):
        if mode not in _GROUNDED:
            axes.plot(*way.T, color=mode_colour(mode), linewidth=1.3, alpha=0.85)
    left = result.approach
    if left is not None and left.way_left_s is not None:
        place = place_at(np.array([left.way_left_s]), path.t, places)
        axes.plot(*place.T, "o", color=INK, markerfacecolor=INK if left.seen else "white", markersize=4.5, zorder=5)


def _add_cheapest(axes: Any, flight: Flight, flown: Sequence[Flown]) -> None:
    """Draw the way of least energy from where the first flight began its way, with nothing else to heed."""
    if not flown:
        return
    path, result = flown[0]
    began = next((switch.t for switch in result.mode_history if switch.mode.value == Mode.TRANSIT.value), None)
    if began is None:
        return
    (length, height), *_ = place_at(np.array([began]), path.t, _side(path, body_height(flight.config))).tolist()
    way = cheapest_way(flight.config.guidance, length=length, height=height)
    left = np.linspace(0.0, length, 100)
    heights = [way.height(float(each))[0] for each in left]
    axes.plot([0.0, *left], [0.0, *heights], color=FAINT, linestyle=(0, (4, 3)), linewidth=1.2)


def _add_lowest(axes: Any, flight: Flight) -> None:
    transit, surveyed = flight.plan.transit, flight.mission.surveyed
    if transit is not None and surveyed is not None:
        axes.axhline(transit.height_m + surveyed.down_m, color=FAINT, linestyle=(0, (1, 2)), linewidth=1.0)


def _left_at(results: Sequence[FlightResult]) -> str:
    figures = [result.approach for result in results if result.approach is not None]
    ranges = [each.way_left_m for each in figures if each.way_left_m is not None]
    if not ranges:
        return "the way was never left"
    seen = sum(each.seen is True for each in figures)
    low, high = f"{min(ranges):.1f}", f"{max(ranges):.1f}"
    spread = low if low == high else f"{low} to {high}"
    return f"way left at {spread} m, the pad in sight in {seen} of {len(ranges)}"


def _add_key(axes: Any) -> None:
    lines = [Line2D([], [], color=mode_colour(mode), linewidth=2.0, label=mode_words(mode)) for mode in _DRAWN_MODES]
    marks = [
        Line2D([], [], color=INK, marker="o", linestyle="none", markersize=4.5, label="way left, pad seen"),
        Line2D(
            [], [], color=INK, marker="o", markerfacecolor="white", linestyle="none", markersize=4.5, label="unseen"
        ),
        Line2D([], [], color=FAINT, linestyle=(0, (4, 3)), label="least energy"),
        Line2D([], [], color=FAINT, linestyle=(0, (1, 2)), label="lowest unseen"),
    ]
    axes.legend(handles=[*lines, *marks], loc="upper left", frameon=False, ncol=4, fontsize=7)


def _add_landing(whole: Any, near: Any, path: FlightPath, result: FlightResult, colour: str, mark: str) -> None:
    """Draw one flight in the pad's frame: x to its right, y along its heading."""
    yaw = float(path.target_yaw[-1])
    cosine, sine = math.cos(yaw), math.sin(yaw)

    def on_pad(north: float, east: float) -> tuple[float, float]:
        return cosine * east - sine * north, cosine * north + sine * east

    if result.position_error_m is not None:
        north, east = (path.vehicle_ned[-1, :2] - path.target_ned[-1, :2]).tolist()
        near.plot(*on_pad(north, east), mark, color=colour, markersize=5, alpha=0.8)
    approach = result.approach
    if approach is not None and approach.coarse_offset_m is not None:
        shown = mark if approach.seen else "x"
        whole.plot(*on_pad(*approach.coarse_offset_m), shown, color=colour, markersize=5, alpha=0.8)


def _set_square(axes: Any, least: float, title: str) -> None:
    axes.plot(0.0, 0.0, "+", color=PAD, markersize=9)
    reach = max(_MARGIN * least, *(1.1 * abs(value) for line in axes.lines for value in _values(line)))
    axes.set(xlim=(-reach, reach), ylim=(-reach, 1.25 * reach), xlabel="right of the pad [m]", ylabel="ahead [m]")
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=8)


def _values(line: Line2D) -> list[float]:
    return [float(value) for value in np.ravel(line.get_xydata())]
