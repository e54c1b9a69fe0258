"""The figures of a flight in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from companion.report.series import Drawn


def headline(flight: Drawn) -> str:
    """Say in one line how the flight ended."""
    result = flight.result
    if result is None:
        return "A flight without a result" if flight.complete else "A recording that ends early"
    outcome = str(result["outcome"]).capitalize()
    figures = _figures(result)
    if not result["success"]:
        return _short(f"{outcome}: {result['reason']}", 95)
    return ": ".join((outcome, ", ".join(figures))) if figures else outcome


def subtitle(flight: Drawn) -> str:
    """Say in one line which flight it was, and what the headline has no room for."""
    run, result = flight.metadata.get("run", {}), flight.result
    words = [run.get("mission", "")]
    words += [f"{key} {run[key]}" for key in ("world", "wind", "camera", "seed") if key in run]
    words.append(f"{flight.t[-1] - flight.t[0]:.0f} s")
    if result is not None:
        words += [] if result["success"] else _figures(result)
        if result.get("limits_violated"):
            words.append("limits broken: " + ", ".join(v["limit"] for v in result["limits_violated"]))
    return _short("  ·  ".join(word for word in words if word), 170)


def rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Give the result as a table of names and values."""
    if result.get("docking"):
        return _docking_rows(result, result["docking"])
    keeping = result.get("station_keeping") or {}
    found = [
        ("outcome", f"{result['outcome']}{'' if result['success'] else ' (not a success)'}"),
        ("reason", str(result["reason"])),
        ("position error", _number(result.get("position_error_m"), 3, "m")),
        ("angular error", _number(result.get("angular_error_rad"), 4, "rad")),
        ("touchdown speed, relative to the pad", _number(result.get("touchdown_speed_mps"), 2, "m/s")),
        ("station-keeping, position", _spread(keeping, "position_mean_m", "position_std_m", 3, "m")),
        ("station-keeping, heading", _spread(keeping, "angle_mean_rad", "angle_std_rad", 3, "rad")),
        ("duration", _number(result.get("duration_s"), 1, "s")),
        ("limits broken", ", ".join(v["limit"] for v in result.get("limits_violated", [])) or "none"),
        ("mean wind", _number(result.get("wind_mps"), 1, "m/s")),
        ("seed", str(result.get("seed", "-"))),
    ]
    return [(name, value) for name, value in found if value != "-"]


def _docking_rows(result: Mapping[str, Any], docking: Mapping[str, Any]) -> list[tuple[str, str]]:
    found = [
        ("outcome", f"{result['outcome']}{'' if result['success'] else ' (not a success)'}"),
        ("reason", str(result["reason"]) or "-"),
        ("policy", str(docking["policy"])),
        ("position error at contact", _number(result["position_error_m"], 4, "m")),
        ("angular error at contact", _number(result["angular_error_rad"], 4, "rad")),
        ("closing speed", _number(result["touchdown_speed_mps"], 4, "m/s")),
        ("lateral speed", _number(docking["lateral_speed_mps"], 4, "m/s")),
        ("time", _number(result["duration_s"], 1, "s")),
        ("impulse of all nozzles", _number(docking["impulse_ns"], 3, "N s")),
        ("turned at (r2)", _number(docking["reorient_range_m"], 3, "m")),
        ("aligned at (r1)", _number(docking["align_range_m"], 3, "m")),
        ("attempts", str(docking["attempts"])),
        ("outliers rejected", f"{docking['outliers_rejected']} of {docking['outliers']}"),
        ("good ranges rejected", f"{docking['ranges_rejected']} of {docking['ranges']}"),
        ("seed", str(result["seed"])),
    ]
    return [(name, value) for name, value in found if value != "-"]


def is_on_ground(result: Mapping[str, Any] | None) -> bool:
    """Say whether it was a mission on the ground, which ends beside its target."""
    return result is not None and result.get("along_error_m") is not None


def _figures(result: Mapping[str, Any]) -> list[str]:
    if result.get("docking"):
        return _docking_figures(result, result["docking"])
    found = []
    if result.get("position_error_m") is not None:
        place = "its place" if is_on_ground(result) else "the landing point"
        found.append(f"{_length(result['position_error_m'])} from {place}")
        found.append(f"{_angle(result['angular_error_rad'])} off its heading")
    if result.get("touchdown_speed_mps") is not None:
        found.append(f"{result['touchdown_speed_mps']:.2f} m/s at contact")
    return found


def _docking_figures(result: Mapping[str, Any], docking: Mapping[str, Any]) -> list[str]:
    found = []
    if result["position_error_m"] is not None:
        found.append(
            f"{1000.0 * result['position_error_m']:.1f} mm and {1000.0 * result['angular_error_rad']:.1f} mrad off"
        )
        found.append(f"closing at {1000.0 * result['touchdown_speed_mps']:.1f} mm/s")
    return [*found, f"{result['duration_s']:.1f} s", f"{docking['impulse_ns']:.3f} N s", f"policy {docking['policy']}"]


def _length(metres: float) -> str:
    return f"{metres * 100:.1f} cm" if metres < 1.0 else f"{metres:.1f} m"


def _angle(radians: float) -> str:
    return f"{radians * 1000:.1f} mrad" if radians < 0.1 else f"{math.degrees(radians):.0f} degrees"


def _number(value: float | None, digits: int, unit: str) -> str:
    return "-" if value is None else f"{value:.{digits}f} {unit}"


def _spread(values: Mapping[str, float], mean: str, std: str, digits: int, unit: str) -> str:
    if mean not in values:
        return "-"
    return f"{values[mean]:.{digits}f} ± {values[std]:.{digits}f} {unit}"


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."
