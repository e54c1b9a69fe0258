"""The plots of a study that trades one figure for another: each case a point, and the front of those no other beats."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from companion.papers.choice import Chosen
from companion.papers.docking_plots import Grid
from companion.papers.metrics import DOCKING_TIME, IMPULSE, SUCCESS
from companion.papers.rows import Row
from companion.report.style import FAINT, INK, SERIES

_WIDTH, _HEIGHT = 5.2, 4.2  # [inch] of one picture
_MISSES = "misses"
_AXES: Mapping[str, tuple[str, float]] = {  # words, scale
    DOCKING_TIME: ("time, dockings only [s]", 1.0),
    IMPULSE: ("impulse, dockings only [N s]", 1.0),
    _MISSES: ("share of misses [%]", 100.0),
}
_SIDES = ((1, 0.6), (1, -0.6), (-1, 0.6), (-1, -0.6), (0, 1.5), (0, -1.5))  # of a point: to the right, up
_SIZE = 7.5  # [pt] of the names,
_LETTER, _LINE = 6.4, 12.0  # [pixel] as wide and as high at the pictures' resolution
_SPOT = 9.0  # [pixel] points nearer than this are one spot


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A figure with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One policy, or several that came to the same."""

    names: tuple[str, ...]
    series: str
    figures: Mapping[str, Estimate]

    @property
    def label(self) -> str:
        """Its series and names, a row of them by its ends."""
        names = self.names[0] if len(self.names) == 1 else f"{self.names[0]} to {self.names[-1]}"
        return f"{self.series} {names}".strip()


def points_of(chosen: Chosen, rows: Sequence[Row]) -> tuple[Point, ...]:
    """Give each case that docked at all as a point; cases of one series with the same figures are one.

    Args:
        chosen: the study.
        rows: its figures: docking time, impulse and success rate.
    """
    points: list[Point] = []
    for case in chosen.cases:
        own = {row.metric: row for row in rows if row.case == case.name}
        figures = {name: _estimate(own[name]) for name in (DOCKING_TIME, IMPULSE) if name in own}
        rate = _estimate(own[SUCCESS])
        if rate is None or None in figures.values():
            continue
        known = {name: each for name, each in figures.items() if each is not None}
        known[_MISSES] = Estimate(value=1.0 - rate.value, low=1.0 - rate.high, high=1.0 - rate.low)
        name = case.short or case.name
        same = next(
            (p for p in points if p.series and p.series == case.series and _values(p.figures) == _values(known)), None
        )
        if same is None:
            points.append(Point(names=(name,), series=case.series, figures=known))
        else:
            points[points.index(same)] = Point(names=(*same.names, name), series=case.series, figures=known)
    return tuple(points)


def front_of(points: Sequence[Point], metrics: Sequence[str]) -> tuple[Point, ...]:
    """Give the points that no other one beats: none is as good in every metric and better in one."""

    def beats(one: Point, other: Point) -> bool:
        pairs = [(one.figures[name].value, other.figures[name].value) for name in metrics]
        return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)

    return tuple(point for point in points if not any(beats(other, point) for other in points))


def draw_pareto(chosen: Chosen, rows: Sequence[Row], grid: Grid) -> Figure:
    """Draw time and impulse over the share of misses, and impulse over time, each with its front.

    Args:
        chosen: the study.
        rows: its figures.
        grid: gives a figure with so many axes.
    """
    points = points_of(chosen, rows)
    pairs = [(DOCKING_TIME, IMPULSE)]
    if any(point.figures[_MISSES].value > 0.0 for point in points):
        pairs = [(_MISSES, DOCKING_TIME), (_MISSES, IMPULSE), *pairs]
    figure, places = grid(len(pairs), width=_WIDTH, height=_HEIGHT)
    for axes, (across, upward) in zip(places, pairs, strict=True):
        _add_front(axes, front_of(points, (across, upward)), across, upward)
        for point in points:
            _add_point(axes, point, chosen, across, upward)
        axes.set(xlabel=_AXES[across][0], ylabel=_AXES[upward][0])
        axes.margins(0.16)
    places[0].set_title("circled: no other is as good in both and better in one", fontsize=8)
    figure.canvas.draw()  # the layout settles: only now it is known where the points are
    for axes, (across, upward) in zip(places, pairs, strict=True):
        _label(axes, points, across, upward)
    return figure


def _values(figures: Mapping[str, Estimate]) -> dict[str, float]:
    return {name: figure.value for name, figure in figures.items()}


def _estimate(row: Row) -> Estimate | None:
    if row.ours is None:
        return None
    return Estimate(
        value=row.ours,
        low=row.ours if row.low is None else row.low,
        high=row.ours if row.high is None else row.high,
    )


def _add_front(axes: Any, front: Sequence[Point], across: str, upward: str) -> None:
    places = sorted(_place(point, across, upward) for point in front)
    axes.plot(*zip(*places, strict=True), color=FAINT, linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
    axes.plot(*zip(*places, strict=True), "o", markersize=11, markerfacecolor="none", markeredgecolor=INK, zorder=1)


def _add_point(axes: Any, point: Point, chosen: Chosen, across: str, upward: str) -> None:
    series = list(dict.fromkeys(case.series or case.name for case in chosen.cases))
    colour = SERIES[series.index(point.series or point.names[0]) % len(SERIES)]
    x, y = _place(point, across, upward)
    axes.errorbar(
        x,
        y,
        xerr=_reach(point, across),
        yerr=_reach(point, upward),
        fmt="o",
        color=colour,
        markersize=5,
        ecolor=(colour, 0.45),
        elinewidth=0.9,
        capsize=2.0,
    )


def _label(axes: Any, points: Sequence[Point], across: str, upward: str) -> None:
    """Write the names beside the points, each where it covers least; names of points on one spot stand together."""
    to_pixels = axes.transData.transform
    frame = axes.get_window_extent()
    spots: list[tuple[float, float, list[str]]] = []
    for point in points:
        x, y = to_pixels(_place(point, across, upward))
        near = next((names for a, b, names in spots if math.hypot(a - x, b - y) < _SPOT), None)
        if near is None:
            spots.append((x, y, [point.label]))
        else:
            near.append(point.label)
    taken = [(x - 6.0, y - 6.0, x + 6.0, y + 6.0) for x, y, _ in spots]
    for x, y, names in spots:
        text = ", ".join(names)
        wide = _LETTER * len(text)
        boxes = {side: _box(x, y, wide, *side) for side in _SIDES}
        side = min(_SIDES, key=lambda each: _covered(boxes[each], taken, frame.bounds))
        taken.append(boxes[side])
        left, low, _, _ = boxes[side]
        axes.annotate(
            text,
            (left, low),
            xycoords="figure pixels",
            fontsize=_SIZE,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=5,
        )


def _box(x: float, y: float, wide: float, right: float, up: float) -> tuple[float, float, float, float]:
    """Give the pixels of a text beside a point: its left, lower, right and upper end."""
    left = x + right * 9.0 - (0.5 - 0.5 * right) * wide
    low = y + up * 10.0 - (0.5 - 0.5 * up) * _LINE
    return left, low, left + wide, low + _LINE


def _covered(
    box: tuple[float, float, float, float],
    taken: Sequence[tuple[float, float, float, float]],
    frame: tuple[float, float, float, float],
) -> float:
    """Give how many square pixels of a text cover others, and by how much it leaves the frame."""
    left, low, right, high = box
    x, y, wide, tall = frame
    outside = max(0.0, x - left) + max(0.0, right - x - wide) + max(0.0, y - low) + max(0.0, high - y - tall)
    overlaps = (
        max(0.0, min(right, r) - max(left, le)) * max(0.0, min(high, h) - max(low, lo)) for le, lo, r, h in taken
    )
    return sum(overlaps) + 50.0 * outside


def _place(point: Point, across: str, upward: str) -> tuple[float, float]:
    return _AXES[across][1] * point.figures[across].value, _AXES[upward][1] * point.figures[upward].value


def _reach(point: Point, metric: str) -> list[list[float]]:
    figure, scale = point.figures[metric], _AXES[metric][1]
    return [[scale * max(0.0, figure.value - figure.low)], [scale * max(0.0, figure.high - figure.value)]]
