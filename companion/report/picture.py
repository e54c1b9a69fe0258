"""One picture of one flight, readable at a glance."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from companion.errors import RecordingError
from companion.recording import Recording, read_recording
from companion.report.docking_maps import draw_projection, draw_space
from companion.report.docking_series import DOCKING_CHANNELS, DockingRun, docking_of
from companion.report.docking_strips import (
    draw_attitudes,
    draw_docking_speed,
    draw_impulse,
    draw_port_seen,
    draw_position_errors,
    draw_range,
)
from companion.report.maps import draw_pad_view, draw_place_view, draw_top_view
from companion.report.series import CHANNELS, Drawn, Flight, flight_of
from companion.report.strips import (
    draw_errors,
    draw_headings,
    draw_height,
    draw_modes,
    draw_probabilities,
    draw_seen,
    draw_speeds,
    draw_target_seen,
)
from companion.report.style import BAD, FAINT, GOOD, INK, STYLE
from companion.report.words import headline, subtitle

_SIZE = (15.0, 9.6)  # [inch]
_DPI = 110
_STRIPS = (
    (draw_modes, 0.28),
    (draw_seen, 0.16),
    (draw_height, 1.15),
    (draw_probabilities, 0.95),
    (draw_errors, 1.15),
    (draw_headings, 1.0),
    (draw_speeds, 1.0),
)
_GROUND_STRIPS = (  # beside a target: no height, and no model of when to descend
    (draw_modes, 0.28),
    (draw_target_seen, 0.16),
    (draw_errors, 1.5),
    (draw_headings, 1.3),
    (draw_speeds, 1.3),
)
_DOCKING_STRIPS = (
    (draw_modes, 0.28),
    (draw_port_seen, 0.16),
    (draw_range, 1.2),
    (draw_probabilities, 0.8),
    (draw_position_errors, 1.3),
    (draw_attitudes, 1.1),
    (draw_docking_speed, 0.9),
    (draw_impulse, 0.7),
)


def draw_flight(source: str | os.PathLike[str] | Recording, out_png: str | os.PathLike[str]) -> None:
    """Draw a flight.

    Args:
        source: a recording, or the path of one.
        out_png: the picture to be written.

    Raises:
        RecordingError: the recording cannot be read or holds no truth, or the picture cannot be written.
    """
    save(figure_of(open_flight(source)), out_png)


def open_flight(source: str | os.PathLike[str] | Recording) -> Flight | DockingRun:
    """Take the recording of a flight or of a docking apart.

    Raises:
        RecordingError: it cannot be read, or holds nothing that could be drawn.
    """
    channels = CHANNELS | DOCKING_CHANNELS
    recording = source if isinstance(source, Recording) else read_recording(source, channels)
    flight = docking_of(recording) or flight_of(recording)
    if flight is None:
        name = "the recording" if isinstance(source, Recording) else os.fspath(source)
        raise RecordingError(
            f"{name}: there is no truth of vehicle and target in it, so no picture; record a simulation"
        )
    return flight


def figure_of(flight: Flight | DockingRun) -> Figure:
    """Lay out the picture."""
    with rc_context(STYLE):
        figure = Figure(figsize=_SIZE, dpi=_DPI, facecolor="white")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.55], left=0.045, right=0.985, top=0.885, bottom=0.055)
        left = grid[0].subgridspec(2, 1, height_ratios=[1.45, 1.0], hspace=0.24)
        if isinstance(flight, DockingRun):
            _draw_docking_maps(figure, left, flight)
            _draw_strips(figure, grid[1], flight, _DOCKING_STRIPS)
        else:
            draw_top_view(figure.add_subplot(left[0]), flight)
            lands = flight.standoff is None
            (draw_pad_view if lands else draw_place_view)(figure.add_subplot(left[1]), flight)
            _draw_strips(figure, grid[1], flight, _STRIPS if lands else _GROUND_STRIPS)
        success = bool(flight.result and flight.result.get("success"))
        colour = INK if flight.result is None else GOOD if success else BAD
        figure.text(0.045, 0.965, headline(flight), fontsize=15, fontweight="bold", color=colour, va="center")
        figure.text(0.045, 0.937, subtitle(flight), fontsize=9, color=FAINT, va="center")
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as PNG, without the marks of time and program that matplotlib leaves.

    Raises:
        RecordingError: it cannot be written.
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(os.fspath(path), format="png", metadata={"Software": None})
    except OSError as error:
        raise RecordingError(f"{os.fspath(path)}: the picture cannot be written: {error.strerror}") from None


def _draw_docking_maps(figure: Figure, cell: Any, run: DockingRun) -> None:
    below = cell[1].subgridspec(1, 2, wspace=0.3)
    draw_space(figure.add_subplot(cell[0], projection="3d"), run)
    draw_projection(figure.add_subplot(below[0]), run, across=0, upward=1)
    draw_projection(figure.add_subplot(below[1]), run, across=1, upward=2, near=True)


def _draw_strips(
    figure: Figure, cell: Any, flight: Drawn, wanted: Sequence[tuple[Callable[[Any, Any], None], float]]
) -> None:
    strips = cell.subgridspec(len(wanted), 1, height_ratios=[height for _, height in wanted], hspace=0.32)
    first = None
    for index, (draw, _) in enumerate(wanted):
        axes = figure.add_subplot(strips[index], sharex=first)
        first = first or axes
        draw(axes, flight)
        if index < len(wanted) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time [s]")
    if first is not None:
        first.set_xlim(float(flight.t[0]), float(flight.t[-1]))
