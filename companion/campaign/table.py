"""What a campaign shows: figures of each case, beside what is required."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from companion.campaign.consistency import Consistency, consistency
from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord
from companion.campaign.spec import Case, CaseKind
from companion.recording import to_plain

_FIGURES: Mapping[str, Callable[[FlightResult], float | None]] = {
    "position_error_m": lambda r: r.position_error_m,
    "along_error_m": lambda r: r.along_error_m,
    "cross_error_m": lambda r: r.cross_error_m,
    "angular_error_rad": lambda r: r.angular_error_rad,
    "station_position_m": lambda r: None if r.station_keeping is None else r.station_keeping.position_mean_m,
    "station_angle_rad": lambda r: None if r.station_keeping is None else r.station_keeping.angle_mean_rad,
    "touchdown_speed_mps": lambda r: r.touchdown_speed_mps,
    "duration_s": lambda r: r.duration_s,
    "wall_s": lambda r: r.wall_s,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure over the flights of a case that have it."""

    count: int
    mean: float
    median: float
    largest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One requirement."""

    what: str  # success, inside (consistency), or the name of a figure
    value: float | None  # None: no flight has the figure
    required: str  # such as "mean <= 0.04"
    passed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseReport:
    """What one case came to."""

    name: str
    flights: int
    successes: int
    figures: Mapping[str, Figure]
    consistency: Consistency | None
    checks: tuple[Check, ...]
    failures: tuple[tuple[str, int, str], ...]  # mission, seed, reason

    @property
    def passed(self) -> bool:
        """Whether every requirement is met."""
        return all(check.passed for check in self.checks)


def report_case(case: Case, records: Sequence[RunRecord]) -> CaseReport:
    """Sum up the runs of one case."""
    results = [record.result for record in records if record.result is not None]
    figures = {}
    for name, pick in _FIGURES.items():
        values = [value for value in map(pick, results) if value is not None]
        if values:
            figures[name] = Figure(
                count=len(values), mean=statistics.fmean(values), median=statistics.median(values), largest=max(values)
            )
    series = [record.nees for record in records if record.nees is not None]
    truthful = consistency(series) if case.kind is CaseKind.CONSISTENCY and series else None
    successes = sum(record.success for record in records)
    return CaseReport(
        name=case.name,
        flights=len(records),
        successes=successes,
        figures=figures,
        consistency=truthful,
        checks=tuple(_checks(case, records, successes, figures, truthful)),
        failures=tuple((r.mission, r.seed, r.reason) for r in records if not r.success),
    )


def as_json(reports: Sequence[CaseReport], *, commit: str | None, fingerprint: str) -> dict[str, Any]:
    """Give plain values of a whole campaign."""
    return {
        "passed": all(report.passed for report in reports),
        "commit": commit,
        "code": fingerprint,
        "cases": [{**to_plain(report), "passed": report.passed} for report in reports],
    }


def table_of(reports: Sequence[CaseReport]) -> Table:
    """Lay the figures out for a terminal of 80 columns: one row for each figure of each case."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("", no_wrap=True)
    for heading in ("mean", "median", "max"):
        table.add_column(heading, justify="right", no_wrap=True, min_width=6)
    table.add_column("required", no_wrap=True)
    table.add_column("", no_wrap=True, min_width=4)
    for report in reports:
        table.add_section()
        checks = {check.what: check for check in report.checks}
        table.add_row(f"[bold]{escape(report.name)}[/]", "", "", "", "", _verdict(report.passed))
        _add_row(table, "flights that succeed", (f"{report.successes}/{report.flights}", "", ""), checks.get("success"))
        for name, (words, digits) in _SHOWN.items():
            figure = report.figures.get(name)
            if figure is not None or name in checks:
                _add_row(table, words, _cells(figure, digits), checks.get(name))
        found = report.consistency
        if found is not None or "inside" in checks:
            inside = "-" if found is None else f"{found.inside:.1%}"
            _add_row(table, "NEES inside its 95 % bounds", (inside, "", ""), checks.get("inside"))
    return table


_SHOWN: Mapping[str, tuple[str, int]] = {
    "position_error_m": ("position error [m]", 3),
    "along_error_m": ("along-track error [m]", 3),
    "cross_error_m": ("cross-track error [m]", 3),
    "angular_error_rad": ("angular error [rad]", 4),
    "station_position_m": ("station-keeping [m]", 3),
    "station_angle_rad": ("station-keeping [rad]", 4),
    "touchdown_speed_mps": ("touchdown speed [m/s]", 2),
    "duration_s": ("duration [s]", 1),
}


def _add_row(table: Table, words: str, cells: tuple[str, str, str], check: Check | None) -> None:
    required, verdict = ("", "") if check is None else (check.required, _verdict(check.passed))
    table.add_row(escape(f"  {words}"), *cells, required, verdict)


def _cells(figure: Figure | None, digits: int) -> tuple[str, str, str]:
    if figure is None:
        return "-", "-", "-"
    return f"{figure.mean:.{digits}f}", f"{figure.median:.{digits}f}", f"{figure.largest:.{digits}f}"


def _verdict(passed: bool) -> str:
    return "[green]pass[/]" if passed else "[red]FAIL[/]"


def _checks(
    case: Case,
    records: Sequence[RunRecord],
    successes: int,
    figures: Mapping[str, Figure],
    truthful: Consistency | None,
) -> list[Check]:
    required, checks = case.required, []
    if required.success_fraction is not None:
        value = successes / len(records) if records else None
        checks.append(_at_least("success", value, required.success_fraction))
    for name, most in (
        ("position_error_m", required.mean_position_error_m),
        ("angular_error_rad", required.mean_angular_error_rad),
    ):
        if most is not None:
            figure = figures.get(name)
            mean = None if figure is None else figure.mean
            passed = mean is not None and mean <= most
            checks.append(Check(what=name, value=mean, required=f"mean <= {most:g}", passed=passed))
    if required.inside_fraction is not None:
        value = None if truthful is None else truthful.inside
        checks.append(_at_least("inside", value, required.inside_fraction))
    return checks


def _at_least(what: str, value: float | None, least: float) -> Check:
    return Check(
        what=what,
        value=value,
        required="all" if least == 1.0 else f">= {least:.0%}",
        passed=value is not None and value >= least,
    )
