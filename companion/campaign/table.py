"""What a campaign shows: figures of each case, beside what is required."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from companion.campaign.consistency import Consistency, consistency
from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord
from companion.campaign.spec import Case, CaseKind
from companion.recording import to_plain

_FIGURES: Mapping[str, Callable[[FlightResult], float | None]] = {
    "position_error_m": lambda r: r.position_error_m,
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

    what: str
    value: float | None  # None: no flight has the figure
    required: str  # such as "<= 0.040"
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
    """Lay the figures out for a terminal."""
    table = Table(title="mean / median / max over the flights", title_justify="left")
    for heading in ("case", "success", "position error [m]", "angular error [rad]", "station [m]", "touchdown [m/s]"):
        table.add_column(heading, justify="left" if heading == "case" else "right")
    table.add_column("required")
    table.add_column("")
    for report in reports:
        table.add_row(
            report.name,
            f"{report.successes}/{report.flights}",
            *(
                _cell(report.figures.get(name), digits)
                for name, digits in (
                    ("position_error_m", 3),
                    ("angular_error_rad", 4),
                    ("station_position_m", 2),
                    ("touchdown_speed_mps", 2),
                )
            ),
            "\n".join(_check_text(check) for check in report.checks),
            "[green]pass[/]" if report.passed else "[red]FAIL[/]",
        )
    return table


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
            checks.append(Check(what=f"mean {name}", value=mean, required=f"<= {most:g}", passed=passed))
    if required.inside_fraction is not None:
        value = None if truthful is None else truthful.inside
        checks.append(_at_least("NEES inside its 95 % bounds", value, required.inside_fraction))
    return checks


def _at_least(what: str, value: float | None, least: float) -> Check:
    return Check(what=what, value=value, required=f">= {least:g}", passed=value is not None and value >= least)


def _cell(figure: Figure | None, digits: int) -> str:
    if figure is None:
        return "-"
    return f"{figure.mean:.{digits}f} / {figure.median:.{digits}f} / {figure.largest:.{digits}f}"


def _check_text(check: Check) -> str:
    value = "none" if check.value is None else f"{check.value:.4g}"
    return f"{check.what} {value} ({check.required})"
