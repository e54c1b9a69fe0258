"""The plots of dockings: trajectories in space, switching distances run by run, and many starts in one picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from companion.campaign.path import DockingPath
from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord
from companion.config.docking import Docking, load_docking
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_from_quaternion
from companion.papers.choice import Chosen
from companion.papers.ways import stretches
from companion.report.solids import add_cube, cube_corners
from companion.report.style import FAINT, INK, PAD, SERIES, mode_colour

Records = dict[str, list[RunRecord]]  # by the name of the case
Grid = Callable[..., tuple[Figure, list[Any]]]
Flown = tuple[DockingPath, FlightResult]
_MARGIN = 0.12  # [m] round all that is drawn
_MARKED = {"reorient": "o", "align": "s"}  # marked where they begin
_DRAWN_MODES = ("approach", "reorient", "align", "dock")
_PAPER_R2, _PAPER_R1 = 0.8, 0.3  # [m] the worst cases of the paper's figure 6, and its fixed distances


def draw_trajectories(chosen: Chosen, records: Records, grid: Grid) -> Figure:
    """Draw all runs of each case in space, in the colours of their modes, as in figure 5 of Parikh et al.

    Args:
        chosen: the table or figure, one case at least.
        records: its dockings, by case; those without a path are left out.
        grid: gives a figure with so many axes.
    """
    docking, flown = _docking(chosen), {case.name: _flown(records.get(case.name, [])) for case in chosen.cases}
    everything = [flight for flights in flown.values() for flight in flights]
    if chosen.exhibit.together:
        return _together(docking, everything, grid)
    figure, places = grid(len(flown), projection="3d", width=5.2, height=4.6)
    for axes, case in zip(places, chosen.cases, strict=True):
        flights = flown[case.name]
        _add_paths(axes, flights, alpha=min(1.0, max(0.12, 4.0 / max(1, len(flights)))))
        _add_port(axes, docking)
        _add_anchors(axes, docking)
        _set_view(axes, _extent(docking, everything, anchors=True), along_z=False)
        axes.set_title(f"{case.name}: {case.what}, {len(flights)} runs", fontsize=8)
    _add_key(places[0])
    return figure


def _together(docking: Docking, flights: Sequence[Flown], grid: Grid) -> Figure:
    """Draw all runs of all cases in one picture; beside it, seen along z, with the hull of the anchors."""
    figure, (near, whole) = grid(2, projection="3d", width=6.5, height=5.2)
    for axes in (near, whole):
        _add_paths(axes, flights, alpha=0.9)
        _add_port(axes, docking)
    _add_anchors(whole, docking, edges=True)
    _set_view(near, _extent(docking, flights, anchors=False), along_z=False)
    _set_view(whole, _extent(docking, flights, anchors=True), along_z=True)
    near.set_title(_skipped(flights), fontsize=8)
    whole.set_title("along z, in the hull of the anchors", fontsize=8)
    _add_key(near)
    return figure


def draw_switching(chosen: Chosen, records: Records, grid: Grid) -> Figure:
    """Draw the switching distances r2 and r1 of each run, as in figure 6 of Parikh et al."""
    figure, places = grid(len(chosen.cases), width=5.2)
    for axes, case in zip(places, chosen.cases, strict=True):
        results = [r.result.docking for r in records.get(case.name, []) if r.result and r.result.docking]
        for name, colour, values in (
            ("r2: turns", SERIES[3], [figures.reorient_range_m for figures in results]),
            ("r1: aligns", SERIES[1], [figures.align_range_m for figures in results]),
        ):
            ranges = np.array([np.nan if value is None else value for value in values])
            axes.plot(np.arange(len(ranges)), ranges, ".", color=colour, markersize=4, alpha=0.7, label=name)
        for level, label in ((_PAPER_R2, "the paper's fixed distances"), (_PAPER_R1, None)):
            axes.axhline(level, color=FAINT, linestyle=(0, (4, 3)), linewidth=1.0, label=label)
        axes.set(xlabel="run", ylabel="range [m]", ylim=(0.0, 1.1))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_title(f"{case.name}: {case.what}", fontsize=8)
        axes.legend(loc="upper right", frameon=False, ncol=3)
    return figure


def _docking(chosen: Chosen) -> Docking:
    case = chosen.cases[0]
    if case.mission is None:
        raise ValueError(f"{chosen.exhibit.label}, {case.name}: no mission; `choose` refuses such cases")
    return load_docking(case.mission, overrides=case.overrides)


def _flown(records: Sequence[RunRecord]) -> list[Flown]:
    return [(r.path, r.result) for r in records if isinstance(r.path, DockingPath) and r.result is not None]


def _add_paths(axes: Any, flights: Sequence[Flown], alpha: float) -> None:
    for path, result in flights:
        axes.plot(*path.position[:1].T, ".", color=INK, markersize=2)
        for mode, way in stretches(path.t, path.position, result.mode_history):
            axes.add_collection3d(Line3DCollection([way], colors=[mode_colour(mode)], linewidths=1.0, alpha=alpha))
            if mode in _MARKED:
                axes.plot(*way[:1].T, _MARKED[mode], color=mode_colour(mode), markersize=3)


def _add_port(axes: Any, docking: Docking) -> None:
    port = docking.port
    add_cube(axes, cube_corners(port.position, rotation_from_quaternion(port.quaternion), port.side), PAD, 0.6)


def _add_anchors(axes: Any, docking: Docking, *, edges: bool = False) -> None:
    anchors = docking.survey.positions
    axes.plot(*anchors.T, "^", color=FAINT, markersize=5, linestyle="none")
    for one, other in combinations(anchors, 2) if edges else ():
        axes.plot(*np.array([one, other]).T, color=FAINT, linewidth=0.7, linestyle=(0, (4, 3)))


def _extent(docking: Docking, flights: Sequence[Flown], *, anchors: bool) -> tuple[Array, Array]:
    points = [docking.port.position[None, :], *(path.position for path, _ in flights)]
    everything = np.vstack([*points, docking.survey.positions] if anchors else points)
    return everything.min(axis=0) - _MARGIN, everything.max(axis=0) + _MARGIN


def _set_view(axes: Any, extent: tuple[Array, Array], *, along_z: bool) -> None:
    low, high = extent
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="" if along_z else "z [m]")
    axes.set_box_aspect(high - low, zoom=0.95)
    axes.tick_params(labelsize=7)
    if along_z:
        axes.set_proj_type("ortho")
        axes.view_init(elev=90.0, azim=-90.0)
        axes.set_zticks([])
    else:
        axes.view_init(elev=20.0, azim=-55.0)


def _skipped(flights: Sequence[Flown]) -> str:
    direct = sum(
        result.success and not any(switch.mode.value == "align" for switch in result.mode_history)
        for _, result in flights
    )
    docked = sum(result.success for _, result in flights)
    return f"{docked} of {len(flights)} docked, {direct} of them without align"


def _add_key(axes: Any) -> None:
    lines = [Line2D([], [], color=mode_colour(mode), linewidth=2.0, label=mode) for mode in _DRAWN_MODES]
    marks = [
        Line2D([], [], color=mode_colour("reorient"), marker="o", linestyle="none", markersize=4, label="turn begins"),
        Line2D([], [], color=mode_colour("align"), marker="s", linestyle="none", markersize=4, label="aligns"),
        Line2D([], [], color=FAINT, marker="^", linestyle="none", markersize=5, label="anchor"),
        Line2D([], [], color=PAD, marker="s", linestyle="none", markersize=5, label="target"),
    ]
    axes.legend(handles=[*lines, *marks], loc="upper left", frameon=False, ncol=2, fontsize=7)
