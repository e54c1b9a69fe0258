"""Cases that were flown with the same seeds, compared flight by flight."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.campaign.run import RunRecord
from companion.geometry.arrays import Array
from companion.papers.intervals import RESAMPLES
from companion.papers.metrics import METRICS, published_value
from companion.papers.rows import dice
from companion.papers.spec import Exhibit, PaperCase

COMPARED = ("duration_s", "impulse_ns", "approach_s", "energy_kj")
_BATCH = 500  # resamples at a time: 500 pairs of 10 000 resamples at once would be 40 MB


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """By how much less of a figure one case needs than another one, on the same seeds."""

    case: str
    against: str
    metric: str
    pairs: int  # seeds on which both have the figure
    ours: float | None  # 1 - mean / mean of the other; None: no pairs
    low: float | None  # ends of its 95 % interval; None: too few pairs
    high: float | None
    published: float | None  # from the published means

    def as_json(self) -> dict[str, Any]:
        """Give plain values."""
        return dataclasses.asdict(self)

    @property
    def sentence(self) -> str:
        """All of it in words."""
        if self.ours is None:
            return f"{self.case} against {self.against}, {self.metric}: no pairs"
        sign = -1.0 if self.ours < 0.0 else 1.0
        known = [sign * end for end in (self.low, self.high) if end is not None]
        interval = f" ({min(known):.1%} to {max(known):.1%})" if known else ""
        published = "" if self.published is None else f"; published {self.published:.1%}"
        share = f"{sign * self.ours:.1%} {'less' if sign > 0.0 else 'more'}"
        return f"{self.case} against {self.against}, {self.metric}: {share}{interval}{published}"


def savings_of(exhibit: Exhibit, records: Mapping[str, Sequence[RunRecord]]) -> tuple[Saving, ...]:
    """Compare each case with the first one that was flown, at the same place of the axis, where the cases are paired.

    The interval is the percentile bootstrap of the ratio of the means, whole pairs resampled (Efron and Tibshirani,
    1993, section 13.3); the dice come from the case's name.

    Args:
        exhibit: the table or figure.
        records: its flights, by case.
    """
    cases = [case for case in exhibit.cases if case.name in records]
    if not exhibit.paired:
        return ()
    first = {case.at: case for case in reversed(cases)}
    return tuple(
        _saving(exhibit, case, first[case.at], name, records)
        for case in cases
        for name in COMPARED
        if case is not first[case.at] and exhibit.measured(case, name) and exhibit.measured(first[case.at], name)
    )


def _saving(
    exhibit: Exhibit, case: PaperCase, against: PaperCase, name: str, records: Mapping[str, Sequence[RunRecord]]
) -> Saving:
    own, other = _values(records[case.name], name), _values(records[against.name], name)
    seeds = sorted(own.keys() & other.keys())
    pairs = np.array([(own[seed], other[seed]) for seed in seeds]).reshape(-1, 2)
    theirs, reference = published_value(case.published, name), published_value(against.published, name)
    low, high = _interval(pairs, f"{exhibit.label} {case.name} {against.name} {name}") or (None, None)
    return Saving(
        case=case.name,
        against=against.name,
        metric=METRICS[name].words,
        pairs=len(seeds),
        ours=float(_ratio(pairs)) if len(seeds) else None,
        low=low,
        high=high,
        published=None if theirs is None or not reference else 1.0 - theirs / reference,
    )


def _values(records: Sequence[RunRecord], name: str) -> dict[int, float]:
    pick = METRICS[name].of_flight
    found = {}
    for record in records:
        value = None if pick is None or record.result is None else pick(record.result)
        if value is not None:
            found[record.seed] = value
    return found


def _ratio(pairs: Array) -> Any:
    """Give 1 - mean of the first / mean of the second, over the last but one axis."""
    means = pairs.mean(axis=-2)
    return 1.0 - means[..., 0] / means[..., 1]


def _interval(pairs: Array, name: str) -> tuple[float, float] | None:
    if len(pairs) < 2:
        return None
    rng = dice(name)
    drawn = [_ratio(pairs[rng.integers(0, len(pairs), size=(_BATCH, len(pairs)))]) for _ in range(RESAMPLES // _BATCH)]
    low, high = np.quantile(np.concatenate(drawn), (0.025, 0.975))
    return float(low), float(high)
