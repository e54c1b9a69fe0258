"""Colours, words and matplotlib settings of the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

INK = "#22303c"
FAINT = "#8a97a3"
GRID = "#e3e8ec"
PAD = "#c2571a"
VEHICLE = "#1f5fa8"
GOOD, BAD = "#2b7a3d", "#b3261e"
SERIES = ("#1f5fa8", "#c2571a", "#2b7a3d", "#7a4fa3")

STYLE: dict[Any, Any] = {  # matplotlib names its keys one by one
    "font.size": 8.5,
    "axes.edgecolor": GRID,
    "axes.labelcolor": INK,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlecolor": INK,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "text.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.fontsize": 8,
}

MODE_COLOURS: Mapping[str, str] = {
    "preflight": "#c9d1d8",
    "takeoff": "#9fb4c7",
    "transit": "#6fa3a8",
    "search": "#e6c84f",
    "approach": "#5b9bd5",
    "reorient": "#8e7cc3",
    "follow": "#4db6ac",
    "align": "#f2a65a",
    "land": "#7cb86b",
    "autopilot_land": "#a8b545",
    "touchdown": "#3f7f45",
    "hold": "#d98b8b",
    "go_around": "#d1605e",
    "abort": "#8c2f2f",
    "done": "#b9c7b5",
    "wait": "#d9dfe4",
    "dock": "#6fae8f",
    "docked": "#2f7a63",
    "retreat": "#b8546f",
}
UNKNOWN_MODE = "#cccccc"
DARK_MODES = frozenset(("touchdown", "abort", "go_around", "docked", "retreat"))  # their labels are white

PROBABILITY_LABELS: Mapping[str, str] = {
    "a11": "A11: keep approaching",
    "a22": "A22: keep reorienting",
    "a32": "A32: align back to reorient",
    "steady_align": "steady state of align",
}


def mode_colour(mode: str) -> str:
    """Give a mode's colour."""
    return MODE_COLOURS.get(mode, UNKNOWN_MODE)


def mode_words(mode: str) -> str:
    """Give a mode's name as people say it."""
    return mode.replace("_", " ")
