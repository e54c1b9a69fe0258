from __future__ import annotations

from pathlib import Path

import pytest

from companion.clock import MonotonicClock
from companion.preflight.computer import ComputerState, disk_free_gb, judge_computer, read_computer
from companion.preflight.finding import Verdict
from companion.preflight.parameters import ComputerLimits

BEFORE = ComputerState(t=10.0, unix=1_800_000_000.0, busy=1000.0, total=5000.0)


def not_fine(*, t: float = 16.0, unix: float = 1_800_000_006.0, busy: float = 1100.0, free: float = 20.0) -> set[str]:
    after = ComputerState(t=t, unix=unix, busy=busy, total=6000.0)
    findings = judge_computer(BEFORE, after, free, Path("recordings"), ComputerLimits())
    return {finding.check for finding in findings if finding.verdict is Verdict.NOT_FINE}


@pytest.mark.parametrize(
    ("change", "rows"),
    [
        ({}, set()),
        ({"free": 1.0}, {"disk"}),
        ({"busy": 1990.0}, {"CPU load"}),
        ({"unix": 1_800_000_007.0}, {"clock"}),
        ({"unix": 1_800_000_005.9}, {"clock"}),
    ],
)
def test_each_trouble_has_its_row(change: dict[str, float], rows: set[str]) -> None:
    assert not_fine(**change) == rows


def test_a_clock_that_was_never_set() -> None:
    before = ComputerState(t=1.0, unix=60.0, busy=0.0, total=0.0)
    after = ComputerState(t=7.0, unix=66.0, busy=0.0, total=0.0)
    disk, clock, load = judge_computer(before, after, 20.0, Path("x"), ComputerLimits())
    assert disk.verdict is Verdict.FINE
    assert "never set" in clock.found
    assert load.verdict is Verdict.NOT_CHECKED


def test_this_computer_can_be_read(tmp_path: Path) -> None:
    state = read_computer(MonotonicClock())
    assert 0.0 <= state.busy <= state.total
    assert disk_free_gb(tmp_path / "not" / "yet" / "there") > 0.0
