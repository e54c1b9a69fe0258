"""Judge what a ranging input has given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from companion.preflight.finding import Finding, judged
from companion.preflight.parameters import RangingLimits
from companion.ranging.decoder import RangingStatistics
from companion.ranging.parameters import NO_INPUT
from companion.ranging.survey import AnchorSurvey, geometry_remarks, id_text


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingReport:
    """What a ranging input has given while it was listened to."""

    input: str  # as configured
    needed: bool  # the mission flies by ranges
    failure: str | None = None  # why it could not be opened
    survey: AnchorSurvey | None = None
    seconds: float = 0.0  # [s] for which it was listened to
    silence: float = 0.0  # [s] at the end, since the last usable range
    statistics: RangingStatistics | None = None
    remarks: Sequence[str] = ()  # of its events


def judge_ranging(report: RangingReport, limits: RangingLimits) -> list[Finding]:
    """Judge a ranging input; nothing where there is none and none is needed.

    Args:
        report: what it has given.
        limits: what is asked of it.
    """
    if report.input == NO_INPUT:
        wanted = "the mission flies by ranges: set ranging.input and ranging.survey in the configuration"
        return [judged("ranges", False, "no ranging input is configured", wanted)] if report.needed else []
    if report.failure is not None or report.statistics is None or report.survey is None:
        return [judged("ranges", False, report.failure or "not opened", f"{report.input} opens and gives ranges")]
    return [
        _rate(report, report.statistics, limits),
        _anchors(report.survey, report.statistics, limits),
        _geometry(report.survey),
    ]


def _rate(report: RangingReport, statistics: RangingStatistics, limits: RangingLimits) -> Finding:
    wanted = f"{limits.rate_least_hz:g} ranges a second or more, at most {100 * limits.unusable_most:g} % unusable"
    rate = statistics.readings / report.seconds if report.seconds > 0.0 else 0.0
    refused = sum(statistics.faults.values())
    unusable = refused / max(1, refused + statistics.readings)
    figures = {"rate_hz": rate, "unusable_share": unusable, "missed": statistics.missed, "silence_s": report.silence}
    if report.silence >= limits.silence_most_s or not statistics.readings:
        found = f"no ranges for {report.silence:.1f} s"
        return judged("ranges", False, "; ".join([found, *report.remarks]), wanted, figures)
    found = f"{rate:.1f} a second, {100 * unusable:.1f} % unusable, {statistics.missed} messages missed"
    if statistics.faults and unusable > limits.unusable_most:
        found += "".join(f"; {count} {fault.value}" for fault, count in statistics.faults.items())
    fine = rate >= limits.rate_least_hz and unusable <= limits.unusable_most
    return judged("ranges", fine, found, wanted, figures)


def _anchors(survey: AnchorSurvey, statistics: RangingStatistics, limits: RangingLimits) -> Finding:
    silent = [
        id_text(anchor.id) for anchor, count in zip(survey.anchors, statistics.by_anchor, strict=True) if not count
    ]
    heard = len(survey.anchors) - len(silent)
    found = f"{heard} of {len(survey.anchors)} heard" + (f", not {', '.join(silent)}" if silent else "")
    least = min(limits.anchors_least, len(survey.anchors))
    return judged("anchors", heard >= least, found, f"{least} or more: check their power", {"anchors_heard": heard})


def _geometry(survey: AnchorSurvey) -> Finding:
    """Say where the anchors leave a doubt; a doubt is no refusal, since the vehicle may start on a known side."""
    remarks = geometry_remarks(survey)
    figures = {"remarks": "; ".join(remarks)}
    return judged("anchor survey", True, "; ".join([survey.name, *remarks]), "anchors not all in one plane", figures)
