"""The two maps: the flight from above, and the end of it as seen from the pad."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Polygon

from companion.geometry.arrays import Array
from companion.report.series import Flight, TruthSeries
from companion.report.style import FAINT, INK, PAD, VEHICLE, mode_colour

FINAL_SPAN = 15.0  # [s] before the end that the pad's view shows


def draw_top_view(axes: Any, flight: Flight) -> None:
    """Draw both paths over north and east; the vehicle's has the colours of its modes."""
    truth, word = flight.truth, flight.target_word
    end = len(truth.t) - 1 if truth.contact is None else truth.contact
    if flight.track is not None:
        seen = flight.track.pad_position[::5]
        axes.plot(seen[:, 1], seen[:, 0], ".", color=PAD, alpha=0.16, markersize=2.5, zorder=1, rasterized=True)
    axes.plot(truth.pad_position[:, 1], truth.pad_position[:, 0], color=PAD, linewidth=1.6, zorder=3, label=word)
    axes.add_collection(_coloured_path(flight))
    axes.plot([], [], color=INK, linewidth=2.0, label="vehicle, by mode")
    axes.plot([], [], ".", color=PAD, alpha=0.5, label=f"{word}, estimated")
    axes.plot(truth.position[0, 1], truth.position[0, 0], "o", color=INK, markersize=6, zorder=5)
    axes.annotate(
        "start", (truth.position[0, 1], truth.position[0, 0]), xytext=(7, -11), textcoords="offset points", color=INK
    )
    for index, alpha in ((0, 0.5), (end, 1.0)):
        _draw_pad(axes, truth, index, alpha)
    axes.plot(truth.position[end, 1], truth.position[end, 0], "x", color=INK, markersize=7, mew=1.8, zorder=6)
    _square_limits(axes, truth)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title("From above", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.99), ncol=3, frameon=False, columnspacing=1.0, borderpad=0.1)


def draw_pad_view(axes: Any, flight: Flight) -> None:
    """Draw the last seconds in the pad's own axes: what the pad sees of the vehicle above it."""
    truth = flight.truth
    end = len(truth.t) - 1 if truth.contact is None else truth.contact
    first = int(np.searchsorted(truth.t, truth.t[end] - FINAL_SPAN))
    ahead, right = truth.in_target
    half_x, half_y = truth.pad_half_size
    _draw_target(axes, truth)
    _draw_circles(axes, 0.0)
    height = -(truth.offset[first : end + 1, 2])
    points = axes.scatter(
        right[first : end + 1], ahead[first : end + 1], c=height, s=5, cmap="viridis_r", zorder=3, rasterized=True
    )
    axes.figure.colorbar(points, ax=axes, label="height above pad [m]", fraction=0.045, pad=0.02)
    _draw_vehicle(axes, truth, right, ahead)
    reach = max(1.35 * half_x, 1.35 * half_y, 1.15 * abs(right[-1]), 1.15 * abs(ahead[-1]))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="right of the pad [m]", ylabel="ahead [m]")
    axes.set_aspect("equal")
    axes.set_title(f"From the pad, last {min(FINAL_SPAN, truth.t[end] - truth.t[0]):.0f} s", loc="left")


def draw_place_view(axes: Any, flight: Flight) -> None:
    """Draw the last seconds beside a target in its own axes: its place behind it, and the way there."""
    truth, standoff = flight.truth, flight.standoff or 0.0
    first = int(np.searchsorted(truth.t, truth.t[-1] - FINAL_SPAN))
    ahead, right = truth.in_target
    _draw_target(axes, truth)
    _draw_circles(axes, -standoff)
    axes.plot(0.0, -standoff, "+", color=PAD, markersize=12, mew=1.4, zorder=4)
    points = axes.scatter(
        right[first:],
        ahead[first:],
        c=truth.t[-1] - truth.t[first:],
        s=5,
        cmap="viridis",
        zorder=3,
        rasterized=True,
    )
    axes.figure.colorbar(points, ax=axes, label="before the end [s]", fraction=0.045, pad=0.02)
    _draw_vehicle(axes, truth, right, ahead)
    half_x, _ = truth.pad_half_size
    low = min(-1.35 * standoff, 1.1 * float(ahead[-1]))
    high = max(1.35 * half_x, 1.1 * float(ahead[-1]))
    reach = max(0.5 * (high - low), 1.15 * abs(float(right[-1])))
    middle = 0.5 * (high + low)
    axes.set(xlim=(-reach, reach), ylim=(middle - reach, middle + reach))
    axes.set(xlabel="right of the target [m]", ylabel="ahead of it [m]")
    axes.set_aspect("equal")
    axes.set_title(f"From the target, last {min(FINAL_SPAN, truth.t[-1] - truth.t[0]):.0f} s; + its place", loc="left")


def _draw_target(axes: Any, truth: TruthSeries) -> None:
    """Draw the target in its own axes, with an arrow ahead."""
    half_x, half_y = truth.pad_half_size
    axes.add_patch(
        Polygon(
            [(-half_y, -half_x), (half_y, -half_x), (half_y, half_x), (-half_y, half_x)],
            closed=True,
            facecolor="#fbf3ec",
            edgecolor=PAD,
            linewidth=1.5,
        )
    )
    axes.annotate(
        "", (0.0, half_x * 1.22), (0.0, half_x * 1.02), arrowprops={"arrowstyle": "-|>", "color": PAD, "linewidth": 1.5}
    )


def _draw_circles(axes: Any, ahead: float) -> None:
    """Draw circles of 4 and 20 cm about a place [m] on the target's axis, each with its size above it."""
    for radius in (0.04, 0.2):
        axes.add_patch(Circle((0.0, ahead), radius, fill=False, edgecolor=FAINT, linewidth=0.8, linestyle=(0, (3, 3))))
        size, top = f"{radius * 100:.0f} cm", (0.0, ahead + radius)
        axes.annotate(size, top, color=FAINT, fontsize=7, ha="center", va="bottom")


def _coloured_path(flight: Flight) -> LineCollection:
    truth = flight.truth
    pieces, colours = [], []
    for span in flight.modes:
        inside = (truth.t >= span.start - 0.021) & (truth.t <= span.end)
        if inside.sum() > 1:
            pieces.append(truth.position[inside][:, [1, 0]])
            colours.append(mode_colour(span.mode))
    if not pieces:
        pieces, colours = [truth.position[:, [1, 0]]], [VEHICLE]
    return LineCollection(pieces, colors=colours, linewidths=2.2, zorder=4, capstyle="round")


def _draw_pad(axes: Any, truth: TruthSeries, index: int, alpha: float) -> None:
    half_x, half_y = truth.pad_half_size
    cosine, sine = math.cos(truth.pad_yaw[index]), math.sin(truth.pad_yaw[index])
    north, east = truth.pad_position[index, :2]
    corners = [
        (east + sine * x + cosine * y, north + cosine * x - sine * y)
        for x, y in ((half_x, half_y), (half_x, -half_y), (-half_x, -half_y), (-half_x, half_y))
    ]
    axes.add_patch(Polygon(corners, closed=True, facecolor="none", edgecolor=PAD, linewidth=1.6, alpha=alpha, zorder=3))
    tip = (east + 1.9 * half_x * sine, north + 1.9 * half_x * cosine)
    axes.annotate(
        "", tip, (east, north), arrowprops={"arrowstyle": "-|>", "color": PAD, "linewidth": 1.2, "alpha": alpha}
    )


def _square_limits(axes: Any, truth: TruthSeries) -> None:
    both = np.vstack((truth.position[:, :2], truth.pad_position[:, :2]))
    centre = (both.max(axis=0) + both.min(axis=0)) / 2.0
    reach = 0.5 * float((both.max(axis=0) - both.min(axis=0)).max()) * 1.08 + 0.9
    axes.set(xlim=(centre[1] - reach, centre[1] + reach), ylim=(centre[0] - reach, centre[0] + reach))
    axes.set_aspect("equal")


def _draw_vehicle(axes: Any, truth: TruthSeries, right: Array, ahead: Array) -> None:
    """Draw where it came to rest and where its nose points."""
    x, y = right[-1], ahead[-1]
    turn = truth.yaw[-1] - truth.pad_yaw[-1]
    length = 0.45 * max(truth.pad_half_size)
    axes.plot([x, x + length * math.sin(turn)], [y, y + length * math.cos(turn)], color=INK, linewidth=1.6, zorder=5)
    axes.plot(x, y, "x", color=INK, markersize=9, mew=2.0, zorder=6)
