"""What `companion study anchors` has found, as text, as JSON and as a table of the map."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from companion.cli.anchor_scene import Given
from companion.errors import RecordingError
from companion.geometry.arrays import Array
from companion.placement.area import AreaMap
from companion.placement.assessment import Corridor, Foreseen, Place
from companion.placement.search import Objective, Proposal, Quality
from companion.ranging.survey import geometry_remarks

_CHAIN = ("a11", "a22", "a32", "steady_align")
_COLUMNS = (
    *("x_m", "y_m", "z_m", "std_m", "std_x_m", "std_y_m", "std_z_m", "gdop", "mirror_m", "range_m"),
    *("seen_at_start", "seen_docking", "known_std_m", *_CHAIN, "std_proposed_m"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What has been found."""

    given: Given
    map: AreaMap
    ways: dict[str, Corridor]  # from the start, the best and the worst place to the port
    foreseen: dict[str, Foreseen]  # Algorithm 1 with the standard deviation of the best and of the worst place
    proposal: Proposal | None
    objective: Objective
    map_proposed: AreaMap | None  # None: no search, or nothing better


def lines_of(study: Study) -> list[str]:
    """Say it in lines; the last one is about the proposal."""
    given, found = study.given, study.map
    scene = given.scene
    area = found.area
    lines = [
        f"anchors   {given.survey.name}: {len(given.survey.anchors)}, frame {given.survey.frame.value}; ranges "
        f"{1000.0 * scene.noise.range_std:g} mm at {scene.range_rate:g} Hz, unknown acceleration "
        f"{scene.noise.acceleration_noise:g} m/s^2/sqrt(Hz)",
        "assumed   these figures; change them by --range-std, --range-rate, --acceleration-noise",
        *(f"remark    {text}" for text in geometry_remarks(given.survey)),
        f"map       {len(found.starts)} starts: x {area.x[0]:g} to {area.x[-1]:g}, y {area.y[0]:g} to {area.y[-1]:g}, "
        f"z {', '.join(f'{z:g}' for z in area.z)} m; std in the worst direction, by ranges alone",
        f"{'':10}{'place [m]':<24}{'std [mm]':>9}{'x':>7}{'y':>7}{'z':>7}{'GDOP':>8}{'mirror [m]':>12}",
        _place_line("best", found.best),
        _place_line("worst", found.worst),
    ]
    if "start" in study.ways:
        lines.append(_place_line("start", study.ways["start"].places[0]))
    lines += [_foreseen_line(name, one) for name, one in study.foreseen.items()]
    lines += _way_lines(study)
    return [*lines, *_proposal_lines(study)]


def as_json(study: Study) -> dict[str, Any]:
    """Give all of it; what is undetermined or not asked is null."""
    found, proposal = study.map, study.proposal
    return {
        "ok": True,
        "source": study.given.source,
        "anchors": _rounded(study.given.survey.positions),
        "remarks": list(geometry_remarks(study.given.survey)),
        "range_std_m": study.given.scene.noise.range_std,
        "range_rate_hz": study.given.scene.range_rate,
        "acceleration_noise": study.given.scene.noise.acceleration_noise,
        "map": _map_json(found),
        "foreseen": {
            name: {
                "position_std_m": _number(one.position_std),
                "least_steady_align": _number(one.least_steady_align),
                "align_range_m": one.align_range,
            }
            for name, one in study.foreseen.items()
        },
        "corridors": {
            name: {
                "reorient_range_m": way.reorient_range,
                "align_range_m": way.align_range,
                "worst": _place_json(way.worst),
                "places": [_place_json(place) for place in way.places],
            }
            for name, way in study.ways.items()
        },
        "proposal": None
        if proposal is None
        else {
            "kept": proposal.kept,
            "anchors": _rounded(proposal.anchors),
            "objective": study.objective.value,
            "improvement_percent": 100.0 * proposal.improvement(study.objective),
            "given": _quality_json(proposal.given),
            "proposed": _quality_json(proposal.proposed),
            "map": None if study.map_proposed is None else _map_json(study.map_proposed),
        },
    }


def write_table(path: Path, study: Study) -> None:
    """Write the map as comma-separated values, one line for each start.

    Raises:
        RecordingError: it cannot be written.
    """
    after = study.map_proposed
    others = [None] * len(study.map.places) if after is None else after.places
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            for place, other in zip(study.map.places, others, strict=True):
                if place is not None:
                    writer.writerow(_row(place, math.nan if other is None else other.worst_std))
    except OSError as error:
        raise RecordingError(f"{path}: the table cannot be written: {error.strerror}") from None


def _foreseen_line(name: str, one: Foreseen) -> str:
    return (
        f"if known everywhere as at the {name} place ({1000.0 * one.position_std:.1f} mm): least P(align) "
        f"{one.least_steady_align:.2f}, r1 {one.align_range:.2f} m"
    )


def _way_lines(study: Study) -> Iterator[str]:
    for name, way in study.ways.items():
        worst, first = way.worst, way.places[0]
        below = [place.chain.steady_align for place in way.places if math.isfinite(place.chain.steady_align)]
        least = f"; least P(align) {min(below):.2f}" if below else ""
        seen = sum(place.seen_docking for place in way.places)
        known = 1000.0 * worst.known_std
        yield f"way from  {name}: {first.range:.2f} m; worst at {_text(worst.position)}, {known:.1f} mm"
        yield (
            f"{'':10}Algorithm 1 with d = 1: r2 {way.reorient_range:.2f} m, r1 {way.align_range:.2f} m{least}; "
            f"port seen on {100.0 * seen / len(way.places):.0f} % of it in the docking attitude"
        )


def _proposal_lines(study: Study) -> Iterator[str]:
    proposal = study.proposal
    if proposal is None:
        return
    if proposal.kept:
        yield f"proposal  none: no better places were found ({_mm(proposal.given)}, objective {study.objective.value})"
        return
    for place in proposal.anchors:
        yield f"proposed  {_text(place, 3)}"
    if study.map_proposed is not None:
        yield _place_line("its best", study.map_proposed.best)
        yield _place_line("its worst", study.map_proposed.worst)
    yield (
        f"proposal  over starts and ways: {_mm(proposal.given)} -> {_mm(proposal.proposed)}; "
        f"{study.objective.value} {100.0 * proposal.improvement(study.objective):.1f} % less"
    )


def _mm(quality: Quality) -> str:
    return f"rms {_length(quality.rms)}, worst {_length(quality.worst)}, mean {_length(quality.mean)}"


def _length(value: float) -> str:
    return f"{1000.0 * value:.2f} mm" if math.isfinite(value) else "undetermined"


def _place_line(name: str, place: Place) -> str:
    axes = "".join(f"{1000.0 * std:>7.1f}" for std in place.axis_std)
    mirror = f"{place.mirror:.2f}" if math.isfinite(place.mirror) else "none"
    return (
        f"{name:<10}{_text(place.position):<24}{1000.0 * place.worst_std:>9.1f}{axes}{place.dilution:>8.1f}{mirror:>12}"
    )


def _text(place: Array, digits: int = 2) -> str:
    return f"({', '.join(f'{value:.{digits}f}' for value in place + 0.0)})"


def _row(place: Place, proposed_std: float) -> list[str]:
    first = [*place.position, place.worst_std, *place.axis_std, place.dilution, place.mirror, place.range]
    last = [place.known_std, *(getattr(place.chain, name) for name in _CHAIN), proposed_std]
    seen = (place.seen_at_start, place.seen_docking)
    return [*map(_cell, first), *(str(int(one)) for one in seen), *map(_cell, last)]


def _cell(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _rounded(places: Array) -> list[list[float]]:
    rounded: list[list[float]] = np.round(places, 4).tolist()
    return rounded


def _map_json(found: AreaMap) -> dict[str, Any]:
    undetermined = sum(not math.isfinite(place.worst_std) for place in found.starts)
    return {
        "starts": len(found.starts),
        "undetermined": undetermined,
        "best": _place_json(found.best),
        "worst": _place_json(found.worst),
    }


def _place_json(place: Place) -> dict[str, Any]:
    return {
        "position_m": [float(value) for value in place.position],
        "std_m": _number(place.worst_std),
        "axis_std_m": [_number(std) for std in place.axis_std],
        "gdop": _number(place.dilution),
        "mirror_m": _number(place.mirror),
        "range_m": _number(place.range),
        "seen_at_start": place.seen_at_start,
        "seen_docking": place.seen_docking,
        "known_std_m": _number(place.known_std),
        **{name: _number(getattr(place.chain, name)) for name in _CHAIN},
    }


def _quality_json(quality: Quality) -> dict[str, float | None]:
    return {
        "rms_m": _number(quality.rms),
        "worst_m": _number(quality.worst),
        "mean_m": _number(quality.mean),
    }
