"""The picture of an anchor study: maps of the position's standard deviation, and of the steady state of "align"."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from companion.geometry.arrays import Array
from companion.placement.area import Area, AreaMap
from companion.placement.assessment import Place
from companion.placement.scene import Scene
from companion.report.picture import save
from companion.report.style import BAD, FAINT, GOOD, INK, PAD, STYLE, VEHICLE

_DPI = 120
_WIDTH = 3.5  # [inch] of one map
_MOST = 0.99  # quantile of the standard deviations at which the colours end
_COLOURS = "viridis_r"


def draw_anchor_study(
    path: Path,
    *,
    title: str,
    scene: Scene,
    start: Array | None,
    given: AreaMap,
    proposed: AreaMap | None,
    anchors_proposed: Array | None,
) -> None:
    """Draw a row of maps, one for each plane of starts, for the given anchors, the proposed ones and Algorithm 1.

    Args:
        path: the PNG file.
        title: whose anchors these are.
        scene: with the given anchors.
        start: (3,) [m], or None.
        given: the map of the given anchors.
        proposed: the map of the proposed anchors, None: none are proposed.
        anchors_proposed: (N, 3) [m].

    Raises:
        RecordingError: it cannot be written.
    """
    rows = [("given anchors", given, scene.setup.anchors)]
    if proposed is not None and anchors_proposed is not None:
        rows.append(("proposed anchors", proposed, anchors_proposed))
    planes = len(given.area.z)
    with_chain = scene.port is not None
    with rc_context({**STYLE, "axes.grid": False}):
        shape = (len(rows) + with_chain, planes)
        figure = Figure(
            figsize=(_WIDTH * planes + 1.0, _height(given) * shape[0] + 0.9), dpi=_DPI, layout="constrained"
        )
        FigureCanvasAgg(figure)
        figure.suptitle(
            f"{title}: how well a standing vehicle knows its place", fontsize=12, fontweight="bold", x=0.01, ha="left"
        )
        axes = np.array(figure.subplots(*shape, squeeze=False, sharex=True, sharey=True))
        scale = _scale([found for _, found, _ in rows])
        for line, (name, found, anchors) in zip(axes, rows, strict=False):
            _draw_stds(figure, line, name, found, scale)
            for plane, one in enumerate(line):
                _mark(one, scene, start, anchors, float(found.area.z[plane]))
                _mark_extremes(one, found, float(found.area.z[plane]))
        if with_chain:
            _draw_chain(figure, axes[-1], given)
            for one, z in zip(axes[-1], given.area.z, strict=True):
                _mark(one, scene, start, None, float(z))
        _label(axes)
        _legend(figure, scene, start)
        save(figure, path)


def _height(found: AreaMap) -> float:
    """Give the height [inch] of a map of `_WIDTH`, title included."""
    x, y = found.area.x, found.area.y
    return 0.35 + (_WIDTH - 0.35) * float(np.clip((y[-1] - y[0]) / (x[-1] - x[0]), 0.3, 3.0))


def _scale(maps: list[AreaMap]) -> LogNorm:
    stds = np.array([1000.0 * place.worst_std for found in maps for place in found.starts])
    stds = stds[np.isfinite(stds)]
    low = float(stds.min()) if len(stds) else 1.0
    return LogNorm(low, max(1.05 * low, float(np.quantile(stds, _MOST)) if len(stds) else 10.0))


def _draw_stds(figure: Figure, line: Any, name: str, found: AreaMap, scale: LogNorm) -> None:
    values = 1000.0 * found.values(lambda place: place.worst_std)
    for plane, axes in enumerate(line):
        picture = _paint(axes, found.area, values[plane], norm=scale, cmap=_COLOURS)
        axes.set_title(f"{name}, z = {found.area.z[plane]:g} m", loc="left")
    bar = figure.colorbar(picture, ax=line, fraction=0.03, pad=0.01, extend="max")
    bar.set_label("std in the worst direction,\nranges alone [mm]")
    ticks = np.geomspace(scale.vmin or 1.0, scale.vmax or 10.0, 6)
    bar.set_ticks(list(ticks))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
    bar.ax.minorticks_off()
    bar.outline.set_visible(False)


def _draw_chain(figure: Figure, line: Any, found: AreaMap) -> None:
    align = found.values(lambda place: place.chain.steady_align)
    seen = found.values(lambda place: float(place.seen_docking))
    for plane, axes in enumerate(line):
        picture = _paint(axes, found.area, align[plane], vmin=0.4, vmax=1.0, cmap="cividis")
        if np.nanmax(seen[plane]) > 0.0:
            axes.contour(
                found.area.x, found.area.y, np.nan_to_num(seen[plane]), levels=[0.5], colors=[BAD], linewidths=1.2
            )
        axes.set_title(f"steady state of align, z = {found.area.z[plane]:g} m", loc="left")
    bar = figure.colorbar(picture, ax=line, fraction=0.03, pad=0.01, extend="min")
    bar.set_label("P(align) of Algorithm 1, d = 1,\nbelow r2 (grey: not asked)")
    bar.outline.set_visible(False)


def _paint(axes: Any, area: Area, values: Array, **colours: Any) -> Any:
    """Paint a plane of the area; grey where there is no value."""
    axes.set_facecolor("#f1f3f5")
    seen = np.ma.masked_invalid(values)
    return axes.pcolormesh(area.x, area.y, seen, shading="nearest", rasterized=True, **colours)


def _mark(axes: Any, scene: Scene, start: Array | None, anchors: Array | None, z: float) -> None:
    """Mark what there is; what does not lie in this plane is paler."""
    if anchors is not None:
        _dots(axes, anchors, "^", INK, z)
    if scene.port is None:
        if start is not None:
            _dots(axes, start[None], "o", VEHICLE, z)
        return
    port = scene.port.docked_position
    if start is not None:
        axes.plot([start[0], port[0]], [start[1], port[1]], color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        _dots(axes, start[None], "o", VEHICLE, z)
    _dots(axes, port[None], "s", PAD, z)


def _dots(axes: Any, places: Array, marker: str, colour: str, z: float) -> None:
    for place in places:
        alpha = 1.0 if abs(float(place[2]) - z) < 1e-3 else 0.45
        axes.plot(place[0], place[1], marker, color=colour, markersize=7, markeredgecolor="white", alpha=alpha)


def _mark_extremes(axes: Any, found: AreaMap, z: float) -> None:
    extremes: tuple[tuple[str, Place, str], ...] = (("best", found.best, GOOD), ("worst", found.worst, BAD))
    for name, place, colour in extremes:
        if abs(float(place.position[2]) - z) < 1e-9:
            x, y = float(place.position[0]), float(place.position[1])
            axes.plot(x, y, "D", color=colour, markersize=7, markeredgecolor="white")
            left = x > float(found.area.x.mean())
            axes.annotate(
                f"{name} {1000.0 * place.worst_std:.1f} mm",
                (x, y),
                xytext=(-8 if left else 8, 6),
                textcoords="offset points",
                ha="right" if left else "left",
                fontsize=8,
                fontweight="bold",
                color=colour,
                bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
            )


def _label(axes: Any) -> None:
    for one in axes.flat:
        one.set_aspect("equal")
        one.xaxis.set_major_locator(MaxNLocator(5))
        one.yaxis.set_major_locator(MaxNLocator(5))
        one.tick_params(colors=FAINT)
    for one in axes[-1]:
        one.set_xlabel("x [m]")
    for one in axes[:, 0]:
        one.set_ylabel("y [m]")


def _legend(figure: Figure, scene: Scene, start: Array | None) -> None:
    """Explain the marks below the maps."""
    marks = [("^", INK, "anchor", True), ("o", VEHICLE, "start", start is not None)]
    marks += [("s", PAD, "docked place", scene.port is not None)]
    handles: list[Any] = [
        Line2D(
            [], [], linestyle="none", marker=marker, color=colour, markeredgecolor="white", markersize=8, label=label
        )
        for marker, colour, label, shown in marks
        if shown
    ]
    if scene.port is not None:
        handles.append(
            Line2D([], [], color=BAD, linewidth=1.2, label="inside: the camera sees the port (docking attitude)")
        )
    handles.append(Line2D([], [], linestyle="none", label="paler: in another plane; grey: nobody starts there"))
    figure.legend(handles=handles, loc="outside lower left", ncol=len(handles), frameon=False)
