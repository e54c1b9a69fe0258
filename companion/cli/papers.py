"""`companion papers`: fly the experiments of a paper and hold what comes of them against its figures."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

from rich.console import Console

from companion.campaign.run import RunFlight, RunRecord, Task
from companion.campaign.runner import tasks_of
from companion.campaign.versions import project_root
from companion.cli.flights import PLAIN, Session, add_flight_arguments, fly_all, open_session
from companion.cli.overrides import add_overrides
from companion.errors import InputError
from companion.papers.choice import Chosen, campaign_of, choose
from companion.papers.console import summary_of, table_of
from companion.papers.findings import Findings, findings_of
from companion.papers.rows import Row
from companion.papers.spec import load_paper
from companion.recording import write_json

FOLDER = Path("config/papers")  # NAME.yaml is the paper NAME
OUT = Path("runs/papers")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion papers`."""
    parser.add_argument("paper", metavar="PAPER", help=f"which one: {', '.join(_known())}")
    parser.add_argument("--table", type=int, action="append", default=[], metavar="N", help="only this one; repeatable")
    parser.add_argument(
        "--figure", type=int, action="append", default=[], metavar="N", help="only this one; repeatable"
    )
    parser.add_argument(
        "--study",
        action="append",
        default=[],
        metavar="NAME",
        help="experiments of ours that go beyond the paper, by name; flown only where asked for; repeatable",
    )
    parser.add_argument(
        "--case", action="append", default=[], metavar="NAME", help='only this case, as in "case 2"; repeatable'
    )
    parser.add_argument("--runs", type=int, metavar="N", help="flights of each case (default: as many as the paper)")
    parser.add_argument(
        "--camera", choices=("rendered", "corners"), default="rendered", help="pictures (default), or tag corners"
    )
    parser.add_argument("--wind", type=float, metavar="MPS", help="mean wind with gusts (default: calm, as the paper)")
    add_overrides(parser)
    add_flight_arguments(parser)
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help=f"where table and plots go (default: below {OUT}, by paper)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Fly; 0 where no figure is significantly worse than published and no success rate below, else 1."""
    from companion.campaign.mission import run_mission

    return fly(args, run_mission)


def fly(args: argparse.Namespace, run_flight: RunFlight) -> int:
    """Fly the paper's experiments with a given way to fly one mission; see `run`."""
    console = Console(stderr=args.json)
    if args.paper not in _known():
        raise InputError.single(
            source="companion papers",
            wrong=f'there is no paper "{args.paper}"',
            right=f"there are {', '.join(_known())}",
        )
    if args.runs is not None and args.runs < 1:
        raise InputError.single(source=f"--runs {args.runs}", wrong="not a number of flights", right=">= 1")
    paper = load_paper(project_root() / FOLDER / f"{args.paper}.yaml")
    chosen = choose(paper, tables=args.table, figures=args.figure, studies=args.study, cases=args.case)
    campaign = campaign_of(paper, chosen, camera=args.camera, runs=args.runs)
    wind = [] if args.wind is None else [f"simulation.wind_mps={args.wind:g}"]
    session = open_session(console, args, overrides=[*args.overrides, *wind], keep_paths=True)
    console.print(campaign.name, **PLAIN)
    tasks = tasks_of(campaign, session.choice, session.commit, session.options)
    flown = fly_all(console, tasks, run_flight, session) if tasks else {}
    out = args.out or OUT / args.paper
    rows: list[Row] = []
    savings: list[dict[str, object]] = []
    for part in chosen:
        records = {case.name: _of(flown, part.campaign_name(paper, case)) for case in part.cases}
        found = findings_of(part, records)
        rows += found.rows
        savings += found.savings_as_json()
        console.print(table_of(part, found.rows))
        for sentence in found.sentences:
            console.print(sentence, **PLAIN)
        _write(part, records, found, out)
    console.print(summary_of(rows), **PLAIN)
    console.print(f"tables and plots: {out}", **PLAIN)
    whole = _as_json(rows, savings, args, session)
    write_json(out / "rows.json", whole)
    if args.json:
        print(json.dumps(whole))
    return 0 if not any(_falls_short(row) for row in rows) and not session.changed else 1


def _known() -> list[str]:
    return sorted(path.stem for path in (project_root() / FOLDER).glob("*.yaml"))


def _of(flown: dict[Task, RunRecord], case: str) -> list[RunRecord]:
    return [record for task, record in flown.items() if task.case == case]


def _write(part: Chosen, records: dict[str, list[RunRecord]], found: Findings, out: Path) -> None:
    from companion.papers.plots import write_plots

    write_plots(part, records, found.rows, out)
    text = Console(file=StringIO(), width=100, record=True)
    text.print(table_of(part, found.rows))
    for sentence in (*found.sentences, *found.failures):
        text.print(sentence, **PLAIN)
    text.save_text(str(out / f"{part.exhibit.label.replace(' ', '_')}.txt"))


def _as_json(
    rows: Sequence[Row], savings: Sequence[dict[str, object]], args: argparse.Namespace, session: Session
) -> dict[str, object]:
    return {
        "paper": args.paper,
        "camera": args.camera,
        "wind_mps": args.wind,
        "commit": session.commit,
        "code": session.code,
        "code_changed": session.changed,
        "rows": [row.as_json() for row in rows],
        "paired": list(savings),
    }


def _falls_short(row: Row) -> bool:
    """Whether a success rate is below the published, or a figure is worse with 95 % confidence."""
    if row.unit == "1":
        return row.better is False
    if row.published is None or not row.compared:
        return False
    return row.ours is None or (row.low is not None and row.low > row.published)
