"""The strips over time: height, probabilities, errors, speeds, and what the camera saw."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Patch

from companion.report.series import Drawn, Flight
from companion.report.style import (
    DARK_MODES,
    FAINT,
    INK,
    PAD,
    PROBABILITY_LABELS,
    SERIES,
    VEHICLE,
    mode_colour,
    mode_words,
)

LETTER_SPAN = 0.0065  # of the flight, for each letter: a mode without that much room has no label
SMALLEST = 1e-3  # [m], [rad] lower end of the errors' scale
SEEN_BINS = 240
KEY: dict[str, Any] = {
    "loc": "lower left",
    "bbox_to_anchor": (0.0, 0.96),
    "ncol": 4,
    "frameon": False,
    "fontsize": 7.5,
    "borderpad": 0.1,
}


def draw_modes(axes: Any, flight: Drawn) -> None:
    """Draw one band for each stay in a mode, with its name where there is room, and a key of all colours."""
    start, end = float(flight.t[0]), float(flight.t[-1])
    for span in flight.modes:
        axes.axvspan(span.start, span.end, color=mode_colour(span.mode), linewidth=0)
        words = mode_words(span.mode)
        if span.end - span.start > LETTER_SPAN * (len(words) + 1) * (end - start):
            middle, colour = (span.start + span.end) / 2, "white" if span.mode in DARK_MODES else INK
            axes.text(middle, 0.48, words, ha="center", va="center", fontsize=7.5, color=colour, clip_on=True)
    modes = dict.fromkeys(span.mode for span in flight.modes)
    key = [Patch(facecolor=mode_colour(mode), label=mode_words(mode)) for mode in modes]
    if key:
        axes.legend(handles=key, **{**KEY, "ncol": len(key), "columnspacing": 0.9, "handlelength": 1.0})
    axes.set(ylim=(0.0, 1.0), yticks=[])
    axes.set_ylabel("mode", rotation=0, ha="right", va="center")
    axes.tick_params(labelbottom=False, bottom=False)
    axes.grid(visible=False)


def draw_seen(axes: Any, flight: Drawn, what: str = "pad seen") -> None:
    """Draw how much of the time the target was found in the pictures; `what` says so at the left."""
    t, seen = flight.seen
    start, end = float(flight.t[0]), float(flight.t[-1])
    if t.size:
        edges = np.linspace(start, end, SEEN_BINS + 1)
        count = np.histogram(t, edges)[0]
        found = np.histogram(t, edges, weights=seen)[0]
        share = np.where(count > 0, found / np.maximum(count, 1), 0.0)
        axes.imshow(share[None, :], aspect="auto", extent=(start, end, 0.0, 1.0), cmap="Greens", vmin=0.0, vmax=1.3)
    axes.set(ylim=(0.0, 1.0), yticks=[])
    axes.set_ylabel(what, rotation=0, ha="right", va="center")
    axes.tick_params(labelbottom=False, bottom=False)
    axes.grid(visible=False)


def draw_target_seen(axes: Any, flight: Drawn) -> None:
    """Draw how much of the time a target was found that is no pad; see `draw_seen`."""
    draw_seen(axes, flight, "target seen")


def draw_height(axes: Any, flight: Flight) -> None:
    """Draw the height of the body origin above the pad, over the bands of the modes."""
    truth = flight.truth
    draw_bands(axes, flight)
    axes.plot(truth.t, -truth.offset[:, 2], color=VEHICLE, linewidth=1.6)
    axes.axhline(0.0, color=PAD, linewidth=1.0)
    axes.set_ylabel("height above\nthe pad [m]")
    axes.set_ylim(bottom=min(-0.25, float(-truth.offset[:, 2].max()) - 0.1))


def draw_probabilities(axes: Any, flight: Drawn) -> None:
    """Draw the Markov model's numbers."""
    draw_bands(axes, flight)
    for (name, (t, values)), colour in zip(flight.probabilities.items(), SERIES, strict=False):
        axes.plot(t, values, color=colour, linewidth=1.4, label=PROBABILITY_LABELS[name])
    if flight.probabilities:
        axes.legend(**KEY)
    else:
        axes.text(0.5, 0.5, "the model was not asked", ha="center", transform=axes.transAxes, color=FAINT)
    axes.set(ylim=(-0.04, 1.04), yticks=[0.0, 0.5, 1.0])
    axes.set_ylabel("probability")


def draw_errors(axes: Any, flight: Flight) -> None:
    """Draw the distance to where it is to be and the error of the target's estimate, beside the stated deviation."""
    truth, track, standoff = flight.truth, flight.track, flight.standoff
    aim = "landing point" if standoff is None else "place"
    distance = truth.lateral if standoff is None else truth.distance_to_place(standoff)
    draw_bands(axes, flight)
    if track is not None:
        axes.plot(track.t, shown(track.position_sigma), color=PAD, linewidth=1.0, linestyle=":", label="stated sigma")
        axes.plot(track.t, shown(track.position_error), color=PAD, linewidth=0.9, alpha=0.85, label="of the estimate")
    axes.plot(truth.t, shown(distance), color=VEHICLE, linewidth=1.5, label=f"to the {aim}")
    log_scale(axes)
    axes.set_ylabel("lateral\nerror [m]" if standoff is None else "position\nerror [m]")


def draw_headings(axes: Any, flight: Flight) -> None:
    """Draw the difference of the headings and the error of its estimate."""
    truth, track = flight.truth, flight.track
    draw_bands(axes, flight)
    if track is not None:
        axes.plot(track.t, shown(track.sigma_heading), color=PAD, linewidth=1.0, linestyle=":", label="stated sigma")
        axes.plot(track.t, shown(track.heading_error), color=PAD, linewidth=0.9, alpha=0.85, label="of the estimate")
    aim = f"to the {flight.target_word}'s heading"
    axes.plot(truth.t, shown(truth.heading_error), color=VEHICLE, linewidth=1.5, label=aim)
    log_scale(axes)
    axes.set_ylabel("heading\nerror [rad]")


def draw_speeds(axes: Any, flight: Flight) -> None:
    """Draw the true speeds of vehicle and pad."""
    truth = flight.truth
    relative = truth.velocity - truth.pad_velocity
    draw_bands(axes, flight)
    speed = np.hypot(truth.velocity[:, 0], truth.velocity[:, 1])
    axes.plot(truth.t, speed, color=VEHICLE, linewidth=1.3, label="vehicle, horizontal")
    pad_speed = np.hypot(truth.pad_velocity[:, 0], truth.pad_velocity[:, 1])
    axes.plot(truth.t, pad_speed, color=PAD, linewidth=1.3, label=flight.target_word)
    axes.plot(
        truth.t,
        np.hypot(relative[:, 0], relative[:, 1]),
        color=SERIES[3],
        linewidth=0.9,
        alpha=0.8,
        label="relative, horizontal",
    )
    if flight.standoff is None:
        axes.plot(truth.t, -truth.velocity[:, 2], color=SERIES[2], linewidth=1.0, label="climb")
    axes.axhline(0.0, color=FAINT, linewidth=0.6)
    axes.legend(**KEY)
    axes.set_ylabel("speed [m/s]")


def draw_bands(axes: Any, flight: Drawn) -> None:
    """Shade the stays in the modes."""
    for span in flight.modes:
        axes.axvspan(span.start, span.end, color=mode_colour(span.mode), alpha=0.16, linewidth=0)


def log_scale(axes: Any) -> None:
    """Make a scale of errors logarithmic, with a key."""
    axes.set_yscale("log")
    axes.set_ylim(bottom=SMALLEST)
    axes.legend(**KEY)


def shown(values: Any) -> Any:
    """Give values that a logarithmic scale of errors can show."""
    return np.maximum(values, SMALLEST)
