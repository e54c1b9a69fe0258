from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from companion.preflight.finding import Verdict
from companion.preflight.parameters import RangingLimits
from companion.preflight.ranging import RangingReport, judge_ranging
from companion.ranging.decoder import RangingStatistics
from companion.ranging.survey_file import load_survey
from companion.ranging.wire import Fault

ROOT = Path(__file__).resolve().parents[3]
LIMITS = RangingLimits()
GOOD = RangingReport(
    input="udp://0.0.0.0:14660",
    needed=True,
    survey=load_survey(ROOT / "config/anchors/pad_four.yaml"),
    seconds=6.0,
    silence=0.02,
    statistics=RangingStatistics(messages=300, readings=300, missed=1, faults={}, by_anchor=(75, 75, 75, 75)),
)


def verdicts(report: RangingReport) -> dict[str, Verdict]:
    return {finding.check: finding.verdict for finding in judge_ranging(report, LIMITS)}


def test_good_ranges_are_fine() -> None:
    assert set(verdicts(GOOD).values()) == {Verdict.FINE}


def test_no_input_matters_only_where_the_mission_needs_ranges() -> None:
    assert judge_ranging(RangingReport(input="none", needed=False), LIMITS) == []
    (finding,) = judge_ranging(RangingReport(input="none", needed=True), LIMITS)
    assert finding.verdict is Verdict.NOT_FINE
    assert "ranging.input" in str(finding)


@pytest.mark.parametrize(
    ("change", "check", "word"),
    [
        ({"statistics": None, "failure": "no such device"}, "ranges", "no such device"),
        ({"silence": 1.2, "remarks": ["the survey has no anchor 0x99"]}, "ranges", "no ranges for 1.2 s; the survey"),
        ({"seconds": 60.0}, "ranges", "5.0 a second"),
        (
            {"statistics": replace(GOOD.statistics, faults={Fault.CHECKSUM: 200})},
            "ranges",
            "200 wrong checksum",
        ),
        (
            {"statistics": replace(GOOD.statistics, by_anchor=(100, 100, 100, 0))},
            "anchors",
            "3 of 4 heard, not 0x5431",
        ),
    ],
)
def test_what_is_wrong_is_told(change, check: str, word: str) -> None:
    finding = next(f for f in judge_ranging(replace(GOOD, **change), LIMITS) if f.check == check)
    assert finding.verdict is Verdict.NOT_FINE
    assert word in str(finding)


def test_anchors_in_one_plane_are_said_but_no_refusal() -> None:
    plane = replace(GOOD, survey=load_survey(ROOT / "config/anchors/cubesat_mothership.yaml"))
    finding = judge_ranging(plane, LIMITS)[-1]
    assert finding.verdict is Verdict.FINE
    assert "one plane" in finding.found
