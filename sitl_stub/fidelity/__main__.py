"""Program `python -m sitl_stub.fidelity`: the stub beside recordings of PX4, figure by figure."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from sitl_stub.fidelity.differences import reasoned_differences
from sitl_stub.fidelity.experiments import Reference
from sitl_stub.fidelity.recording import RecordingError
from sitl_stub.fidelity.row import Row

OK, NOT_AS_PX4, BAD_INPUT = 0, 1, 2
ROOT = Path(__file__).parents[2]
REFERENCE = ROOT.parent / "shared" / "reference" / "px4_sih"
EXTRACT = ROOT / "tests" / "data" / "px4_sih"


def _arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m sitl_stub.fidelity",
        description="Fly recorded experiments of PX4 with the stub and compare. "
        "Exit 0: every row inside its tolerance or a reasoned difference; 1: not so; 2: bad input.",
    )
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of the recordings")
    parser.add_argument("--only", default="", metavar="q02", help="only experiments whose name begins so")
    parser.add_argument("--failing", action="store_true", help="show only rows that do not pass")
    parser.add_argument("--json", action="store_true", help="print the rows as one JSON object")
    return parser.parse_args(words)


def verdict(row: Row, reasons: dict[str, str]) -> str:
    """Give the last cell of a row."""
    if row.passed:
        return "pass"
    return "differs" if row.name in reasons else "FAIL"


def _table(rows: Sequence[Row], reasons: dict[str, str], *, failing: bool) -> Table:
    table = Table(box=None, pad_edge=False)
    for title in ("row", "stub", "PX4", "tolerance", ""):
        table.add_column(title, overflow="fold")
    for row in rows:
        if not (failing and row.passed):
            table.add_row(row.name, row.stub, row.px4, row.tolerance, verdict(row, reasons))
    return table


def main(words: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    arguments = _arguments(words)
    talk = Console(stderr=True, highlight=False, markup=False)
    folder = arguments.reference
    if not folder.is_dir():
        talk.print(f"no recordings in {folder}: the small extract in {EXTRACT.relative_to(ROOT)} is used instead")
        folder = EXTRACT
    try:
        reasons = reasoned_differences()
        rows = list(Reference(folder=folder).rows(arguments.only))
    except (RecordingError, ValueError) as error:
        talk.print(f"fidelity: {error}")
        return BAD_INPUT
    if not rows:
        which = f" that begins with {arguments.only!r}" if arguments.only else ""
        talk.print(f"fidelity: there is no experiment{which} in {folder}; q01 to q19 and r01 to r05 are known")
        return BAD_INPUT
    verdicts = [verdict(row, reasons) for row in rows]
    counts = {word: verdicts.count(word) for word in ("pass", "differs", "FAIL")}
    if arguments.json:
        lines = [{**asdict(row), "verdict": word} for row, word in zip(rows, verdicts, strict=True)]
        sys.stdout.write(json.dumps({"reference": folder.name, "counts": counts, "rows": lines}) + "\n")
    else:
        console = Console(width=None if sys.stdout.isatty() else 200, highlight=False, markup=False)
        console.print(_table(rows, reasons, failing=arguments.failing))
        console.print(f"{counts['pass']} pass, {counts['differs']} reasoned differences, {counts['FAIL']} fail")
        for row in rows:
            if not row.passed and row.name in reasons:
                console.print(f"{row.name}: {reasons[row.name]}")
    return NOT_AS_PX4 if counts["FAIL"] else OK


if __name__ == "__main__":
    sys.exit(main())
