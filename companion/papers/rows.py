"""Ours beside the published figures, one row each."""

from __future__ import annotations

import dataclasses
import hashlib
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.campaign.run import RunRecord
from companion.papers.intervals import mean_interval, rate_interval
from companion.papers.metrics import METRICS, SUCCESS, Metric, published_value
from companion.papers.spec import Exhibit, PaperCase


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One figure of one case."""

    table: int | None  # one of table, figure and study is given
    figure: int | None
    case: str
    metric: str
    unit: str
    ours: float | None  # mean over the trials that have it, or the rate; None: none has it
    low: float | None  # ends of its 95 % interval; None: too few trials
    high: float | None
    published: float | None
    better: bool | None  # ours than the published; None: equal, or nothing to compare
    trials: int
    successes: int
    ours_std: float | None = None  # within a trial, mean over the trials
    published_std: float | None = None
    shown: str = ""  # the metric's short name, for narrow tables
    study: str | None = None
    compared: bool = True  # False: the published is of a vehicle unlike ours, and only shown

    def as_json(self) -> dict[str, Any]:
        """Give plain values: the number of the table or of the figure or the study's name, and the rest."""
        wheres = {"table": self.table, "figure": self.figure, "study": self.study}
        numbered = {kind: where for kind, where in wheres.items() if where is not None}
        names = ("case", "metric", "unit", "ours", "low", "high", "published", "better", "trials", "successes")
        row = {**numbered, **{name: getattr(self, name) for name in names}}
        if self.ours_std is not None or self.published_std is not None:
            row |= {"ours_std": self.ours_std, "published_std": self.published_std}
        return row


def rows_of(exhibit: Exhibit, case: PaperCase, records: Sequence[RunRecord]) -> tuple[Row, ...]:
    """Sum up the trials of one case.

    Every trial that has a figure counts, failed ones too. The dice of the bootstrap are drawn by the case's name, so
    the same trials give the same intervals.

    Args:
        exhibit: the table or figure.
        case: its case.
        records: its trials.
    """
    rng = dice(f"{exhibit.label} {case.name}")
    rows = [
        _row(exhibit, case, name, metric, records, rng)
        for name, metric in METRICS.items()
        if exhibit.measured(case, name)
    ]
    return (*rows, _success_row(exhibit, case, records))


def _row(
    exhibit: Exhibit,
    case: PaperCase,
    name: str,
    metric: Metric,
    records: Sequence[RunRecord],
    rng: np.random.Generator,
) -> Row:
    results = [record.result for record in records if record.result is not None]
    pick, spread = metric.of_flight, metric.spread
    values = [] if pick is None else [v for v in map(pick, results) if v is not None]
    spreads = [] if spread is None else [v for v in map(spread, results) if v is not None]
    ours = statistics.fmean(values) if values else None
    low, high = mean_interval(values, rng) or (None, None)
    return dataclasses.replace(
        measured_row(exhibit, case, name, ours),
        low=low,
        high=high,
        trials=len(records),
        successes=sum(record.success for record in records),
        ours_std=statistics.fmean(spreads) if spreads else None,
        published_std=None if metric.spread_key is None else published_value(case.published, metric.spread_key),
    )


def _success_row(exhibit: Exhibit, case: PaperCase, records: Sequence[RunRecord]) -> Row:
    trials, successes = len(records), sum(record.success for record in records)
    ours = successes / trials if trials else None
    low, high = rate_interval(successes, trials) or (None, None)
    theirs = case.published
    published = theirs.successes / theirs.trials if theirs.successes is not None and theirs.trials else None
    return Row(
        table=exhibit.table,
        figure=exhibit.figure,
        study=exhibit.study,
        case=case.name,
        metric=SUCCESS,
        unit="1",
        ours=ours,
        low=low,
        high=high,
        published=published,
        better=None if ours is None or published is None or ours == published else ours > published,
        trials=trials,
        successes=successes,
    )


def measured_row(exhibit: Exhibit, case: PaperCase, name: str, ours: float | None) -> Row:
    """Give the row of a figure that was measured once, and so has no interval.

    Args:
        exhibit: the table or figure.
        case: its case.
        name: of the published figure.
        ours: the figure, in the metric's unit; None: there is none.
    """
    metric, published = METRICS[name], published_value(case.published, name)
    compared = name not in exhibit.not_compared
    return Row(
        table=exhibit.table,
        figure=exhibit.figure,
        study=exhibit.study,
        case=case.name,
        metric=metric.words,
        unit=metric.unit,
        ours=ours,
        low=None,
        high=None,
        published=published,
        better=None if not compared or ours is None or published is None or ours == published else ours < published,
        trials=1,
        successes=1,
        shown=metric.short or metric.words,
        compared=compared,
    )


def dice(name: str) -> np.random.Generator:
    """Give the dice of a name: the same trials give the same intervals."""
    return np.random.default_rng(int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big"))
