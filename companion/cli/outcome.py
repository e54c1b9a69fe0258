"""How a mission ended: as a table, as JSON, as an exit code."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from companion.campaign.result import LimitViolation
from companion.cli.main import NO_VEHICLE, NOT_ACHIEVED, SUCCESS
from companion.runtime.ports import MissionStatus


def exit_code(success: bool, mission: MissionStatus) -> int:
    """Give the exit code of a mission that has ended."""
    if success:
        return SUCCESS
    return NO_VEHICLE if mission.vehicle_missing else NOT_ACHIEVED


def print_json(result: Mapping[str, Any]) -> None:
    """Print the result as one line, the last one of standard output."""
    print(json.dumps(result, allow_nan=False), flush=True)


def show_result(console: Console, title: str, result: Mapping[str, Any], more: Sequence[tuple[str, str]] = ()) -> None:
    """Print the result as a table.

    Args:
        console: where to.
        title: of the table.
        result: plain values, as for JSON; figures that are None are left out.
        more: further rows.
    """
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    colour = "green" if result["success"] else "red"
    table.add_row("outcome", f"[bold {colour}]{result['outcome']}[/]")
    rows = [*figures(result), *more]
    for name, value in rows:
        table.add_row(name, _plain(value))
    console.print(table)


def tell(
    console: Console,
    title: str,
    result: Mapping[str, Any],
    more: Sequence[tuple[str, str]],
    *,
    quiet: bool,
    as_json: bool,
) -> None:
    """Print a result as `--quiet` and `--json` ask for.

    Args:
        console: where the table goes.
        title: of the table.
        result: plain values.
        more: further rows of the table.
        quiet: one line instead of the table, none with `as_json`.
        as_json: one line of JSON at the end of standard output.
    """
    if not quiet:
        show_result(console, title, result, more)
    elif not as_json:
        print(one_line(result))
    if as_json:
        print_json(result)


def one_line(result: Mapping[str, Any]) -> str:
    """Say in one line how it ended."""
    words = [f"{name} {value}" for name, value in figures(result) if name in ("position error", "angular error")]
    reason = "" if result["success"] or not result["reason"] else result["reason"]
    return f"{result['outcome']}: " + (reason or ", ".join(words) or f"{result['duration_s']:.1f} s")


def figures(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Give the figures of a result as names and values."""
    found: list[tuple[str, str]] = []
    if result["reason"]:
        found.append(("reason", result["reason"]))
    found += _of_flight(result) if result.get("docking") is None else _of_docking(result)
    found.append(("modes", ", ".join(switch["mode"].replace("_", " ") for switch in result["mode_history"]) or "none"))
    found.append(("duration", f"{result['duration_s']:.1f} s"))
    return found


def _of_docking(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Give what a docking came to; what needs a contact is left out where there was none."""
    docking = result["docking"]
    found = [("policy", str(docking["policy"]))]
    for name, value, scale, digits, unit in (
        ("position error", result["position_error_m"], 1000.0, 1, "mm"),
        ("angular error", result["angular_error_rad"], 1.0, 4, "rad"),
        ("closing speed", result["touchdown_speed_mps"], 1000.0, 1, "mm/s"),
        ("lateral speed", docking["lateral_speed_mps"], 1000.0, 1, "mm/s"),
        ("impulse", docking["impulse_ns"], 1.0, 3, "N s"),
        ("turned at (r2)", docking["reorient_range_m"], 1.0, 3, "m"),
        ("aligned at (r1)", docking["align_range_m"], 1.0, 3, "m"),
    ):
        if value is not None:
            found.append((name, f"{scale * value:.{digits}f} {unit}"))
    found.append(("attempts", str(docking["attempts"])))
    found.append(
        (
            "ranges rejected",
            f"{docking['outliers_rejected']} of {docking['outliers']} outliers, "
            f"{docking['ranges_rejected']} of {docking['ranges']} good ones",
        )
    )
    return found


def _of_flight(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    for name, key, digits, unit in (
        ("position error", "position_error_m", 3, "m"),
        ("along the track", "along_error_m", 3, "m"),
        ("across it", "cross_error_m", 3, "m"),
        ("angular error", "angular_error_rad", 4, "rad"),
        ("touchdown speed", "touchdown_speed_mps", 2, "m/s"),
    ):
        if result[key] is not None:
            found.append((name, f"{result[key]:.{digits}f} {unit}"))
    keeping = result["station_keeping"]
    if keeping is not None:
        found.append(
            (
                "station-keeping",
                f"{keeping['position_mean_m']:.3f} +- {keeping['position_std_m']:.3f} m, "
                f"{keeping['angle_mean_rad']:.3f} +- {keeping['angle_std_rad']:.3f} rad",
            )
        )
    broken = [
        f"{limit.limit} {limit.worst:.2f} at {limit.t:.1f} s ({limit.bound})"
        for limit in (LimitViolation(**plain) for plain in result["limits_violated"])
    ]
    found.append(("limits broken", "; ".join(broken) or "none"))
    wind = result.get("wind_mps")  # only the simulator knows it
    if wind is not None:
        found.append(("wind", f"{wind:.3g} m/s" if wind > 0.0 else "none"))
    return found


def _plain(text: str) -> str:
    return text.replace("[", r"\[")
