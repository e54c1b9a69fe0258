from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from companion.campaign.result import StationKeeping
from companion.campaign.run import RunRecord
from companion.campaign.versions import project_root
from companion.errors import InputError
from companion.papers.choice import choose
from companion.papers.console import summary_of, table_of
from companion.papers.intervals import mean_interval, rate_interval
from companion.papers.metrics import METRICS, SUCCESS
from companion.papers.rows import Row, rows_of
from companion.papers.spec import Exhibit, Paper, PaperCase, Trials, load_paper

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "campaign"))

from campaign_results import made_result


@pytest.fixture(scope="module")
def paper() -> Paper:
    return load_paper(project_root() / "config" / "papers" / "patel.yaml")


def exhibit_of(paper: Paper, label: str) -> Exhibit:
    return next(exhibit for exhibit in paper.exhibits if exhibit.label == label)


def record(seed: int, *, error: float | None, station: float | None = None, success: bool = True) -> RunRecord:
    keeping = None
    if station is not None:
        keeping = StationKeeping(position_mean_m=station, position_std_m=0.1, angle_mean_rad=0.02, angle_std_rad=0.01)
    result = made_result(
        seed,
        success=success,
        position_error_m=error,
        angular_error_rad=None if error is None else 0.001,
        station_keeping=keeping,
        duration_s=90.0,
    )
    return RunRecord(mission="m", seed=seed, result=result)


def row(rows: Sequence[Row], metric: str) -> Row:
    [found] = [r for r in rows if r.metric == metric]
    return found


def test_the_bootstrap_covers_the_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        interval = mean_interval(rng.normal(0.5, 0.1, 30).tolist(), rng)
        assert interval is not None
        covered += interval[0] <= 0.5 <= interval[1]
    assert 0.88 <= covered / 200 <= 0.99


def test_a_mean_s_interval_needs_two_values_and_shrinks_with_more() -> None:
    rng = np.random.default_rng(2)
    assert mean_interval([0.1], rng) is None
    few = mean_interval([0.0, 1.0] * 2, rng)
    many = mean_interval([0.0, 1.0] * 50, rng)
    assert few is not None
    assert many is not None
    assert few[1] - few[0] > 2.0 * (many[1] - many[0])
    assert many[0] < 0.5 < many[1]


def test_a_rate_s_interval_is_wilson_s() -> None:
    assert rate_interval(0, 0) is None
    low, high = rate_interval(10, 10) or (math.nan, math.nan)
    assert (low, high) == pytest.approx((1.0 / (1.0 + 1.959964**2 / 10.0), 1.0))  # for p = 1 it is n / (n + z²)
    assert rate_interval(3, 10) == pytest.approx((0.10779, 0.60322), abs=1e-5)  # Newcombe, 1998, scaled by symmetry
    assert rate_interval(7, 10) == pytest.approx((1.0 - 0.60322, 1.0 - 0.10779), abs=1e-5)


def test_rows_hold_ours_beside_the_published(paper: Paper) -> None:
    table4 = exhibit_of(paper, "table 4")
    case = table4.cases[1]  # published: 0.066 m after landing, 0.971 m ± 0.177 in station-keeping, 7 of 10
    rows = rows_of(table4, case, [record(1, error=0.05, station=1.0), record(2, error=0.06, station=1.2)])
    final, station, success = (
        row(rows, "position error"),
        row(rows, METRICS["station_position_m"].words),
        row(rows, SUCCESS),
    )
    assert (final.ours, final.published, final.better) == (pytest.approx(0.055), 0.066, True)
    assert final.low is not None
    assert final.high is not None
    assert 0.05 <= final.low <= 0.055 <= final.high <= 0.06
    assert (station.better, station.published_std, station.ours_std) == (False, 0.177, pytest.approx(0.1))
    assert (success.ours, success.published, success.better) == (1.0, 0.7, True)
    assert rows == rows_of(table4, case, [record(1, error=0.05, station=1.0), record(2, error=0.06, station=1.2)])


def test_a_failed_trial_counts_and_a_missing_figure_does_not(paper: Paper) -> None:
    table4 = exhibit_of(paper, "table 4")
    flown = [
        record(1, error=0.02, station=0.1),
        record(2, error=3.0, station=5.0, success=False),  # landed beside the pad
        record(3, error=None, station=None, success=False),  # never landed
        RunRecord(mission="m", seed=4, crash="Traceback\nValueError: x"),
    ]
    rows = rows_of(table4, table4.cases[0], flown)
    assert row(rows, "position error").ours == pytest.approx(1.51)
    assert row(rows, "position error").better is False
    success = row(rows, SUCCESS)
    assert (success.successes, success.trials, success.better) == (1, 4, False)


def test_without_trials_nothing_is_claimed(paper: Paper) -> None:
    table4 = exhibit_of(paper, "table 4")
    for each in rows_of(table4, table4.cases[0], []):
        assert (each.ours, each.low, each.better, each.trials) == (None, None, None, 0)


def test_a_row_as_json_has_the_keys_that_are_promised(paper: Paper) -> None:
    table3 = exhibit_of(paper, "table 3")
    for each in rows_of(table3, table3.cases[0], [record(1, error=0.01)]):
        promised = "table case metric unit ours low high published better trials successes"
        assert list(each.as_json()) == promised.split()


def test_the_console_marks_the_better_one_and_fits_80_columns(paper: Paper, capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    [chosen] = choose(paper, tables=[4])
    rows = [
        each
        for case in chosen.cases
        for each in rows_of(
            chosen.exhibit, case, [record(1, error=0.01, station=0.7), record(2, error=0.3, station=0.8)]
        )
    ]
    Console(width=80).print(table_of(chosen, rows))
    said = capsys.readouterr().out
    assert all(len(line) <= 80 for line in said.splitlines() if not line.startswith("case"))
    assert "…" not in said
    case2 = said.split("case 2")[1].split("case 3")[0]
    marks = {line.split()[0]: line.split()[-1] for line in case2.splitlines()[1:] if line.strip()}
    assert marks == {"position": "published", "angular": "ours", "station-keeping": "published", "success": "ours"}
    assert "0.971 ± 0.177" in case2
    assert summary_of(rows).startswith("12 of 28 figures better than published")


def test_the_paper_is_quoted_in_full(paper: Paper) -> None:
    """Figures of the simulated cases of all tables: 78, as the project has set itself; and those of the hardware."""
    tables = [exhibit for exhibit in paper.exhibits if exhibit.table is not None]
    assert [exhibit.table for exhibit in tables] == [1, 2, 3, 4, 5]
    assert [exhibit.figure for exhibit in paper.exhibits if exhibit.figure is not None] == [8, 10, 11]

    def figures(case: PaperCase) -> int:
        return sum(getattr(case.published, name) is not None for name in METRICS)

    cases = [case for exhibit in tables for case in exhibit.cases]
    assert sum(figures(case) for case in cases if case.trials is Trials.SIMULATED) == 78
    assert all(case.published.trials for case in cases)
    table4 = exhibit_of(paper, "table 4")
    assert [case.published.successes for case in table4.cases] == [10, 7, 9, 10, 9, 9, 9]
    assert [case.published.position_error_m for case in table4.cases] == [
        0.045,
        0.066,
        0.036,
        0.087,
        0.091,
        0.167,
        0.049,
    ]


def test_a_case_that_cannot_be_flown_is_refused_with_what_can(paper: Paper) -> None:
    first, *others = paper.exhibits
    grounded = dataclasses.replace(first.cases[0], mission=None)
    lacking = dataclasses.replace(first, cases=(grounded, *first.cases[1:]))
    less = dataclasses.replace(paper, exhibits=(lacking, *others))
    can = r"this can be flown: --table 2 --table 3 .*--figure 11"
    for tables in ((1,), (1, 4), ()):
        with pytest.raises(InputError, match=rf"table 1 \(rover\), case 1: there is no vehicle.*; {can}"):
            choose(less, tables=tables)
    assert [part.exhibit.label for part in choose(less, tables=(4,))] == ["table 4"]
