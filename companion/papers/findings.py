"""What one table or figure came to: its rows, what else is to be said of it, and every failure with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from companion.campaign.run import RunRecord
from companion.papers.choice import Chosen
from companion.papers.computer import ratio_sentence, rows_on_computer
from companion.papers.pairs import Saving, savings_of
from companion.papers.rows import Row, rows_of
from companion.papers.spec import Exhibit, PaperCase, Trials


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """All figures of one table or figure."""

    label: str
    rows: tuple[Row, ...]
    savings: tuple[Saving, ...]  # of cases flown with the same seeds
    sentences: tuple[str, ...]  # besides the rows
    failures: tuple[str, ...]  # one line for each trial that failed

    def savings_as_json(self) -> list[dict[str, object]]:
        """Give the comparisons as plain values, with the table or figure that they belong to."""
        return [{"exhibit": self.label, **saving.as_json()} for saving in self.savings]


def findings_of(chosen: Chosen, records: Mapping[str, Sequence[RunRecord]]) -> Findings:
    """Sum up one table or figure.

    Args:
        chosen: the table or figure.
        records: its flights, by case.

    Raises:
        InputError: a case that is measured on this computer is wrong.
    """
    exhibit = chosen.exhibit
    rows = tuple(row for case in exhibit.cases for row in _rows(exhibit, case, records))
    savings = savings_of(exhibit, records)
    counts = sorted({saving.pairs for saving in savings})
    spread = " to ".join(str(count) for count in dict.fromkeys((counts[0], counts[-1]))) if counts else ""
    pairs = f"same seeds, {spread} pairs:" if savings else ""
    said = (pairs, *(saving.sentence for saving in savings), ratio_sentence(rows))
    return Findings(
        label=exhibit.label,
        rows=rows,
        savings=savings,
        sentences=tuple(sentence for sentence in said if sentence),
        failures=_failures(records),
    )


def _rows(exhibit: Exhibit, case: PaperCase, records: Mapping[str, Sequence[RunRecord]]) -> tuple[Row, ...]:
    if case.trials is Trials.COMPUTER:
        return rows_on_computer(exhibit, case)
    return rows_of(exhibit, case, records[case.name]) if case.trials is Trials.SIMULATED else ()


def _failures(records: Mapping[str, Sequence[RunRecord]]) -> tuple[str, ...]:
    lines = [
        f"  {case}, seed {record.seed}: {record.reason}"
        for case, own in records.items()
        for record in own
        if not record.success
    ]
    return (f"{len(lines)} failed:" if lines else "no failures", *lines)
