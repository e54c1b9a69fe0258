"""`companion campaign`: fly many simulated missions and hold the statistics against what is required."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from companion.campaign.run import RunFlight, RunRecord, Task
from companion.campaign.runner import Options, run_tasks, tasks_of
from companion.campaign.seeds import parse_seeds
from companion.campaign.spec import Campaign, load_campaign
from companion.campaign.table import CaseReport, as_json, report_case, table_of
from companion.campaign.versions import current_commit, fingerprint, project_root
from companion.cli.overrides import add_overrides
from companion.errors import InputError

DEFAULT = Path("config/campaigns/first_flight.yaml")
SHOWN_FAILURES = 10
_PLAIN: dict[str, Any] = {"highlight": False, "markup": False, "soft_wrap": True}  # reasons hold brackets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion campaign`."""
    parser.add_argument(
        "campaign", metavar="CAMPAIGN.yaml", nargs="?", help=f"the campaign file (default: the project's {DEFAULT})"
    )
    parser.add_argument(
        "--seeds",
        default="auto",
        metavar="SEEDS",
        help="auto (drawn from the commit's hash, as many as each case says), auto:30, 1,2,3 or 5..20",
    )
    parser.add_argument(
        "--case", action="append", default=[], metavar="NAME", help="only cases whose name contains this; repeatable"
    )
    parser.add_argument("--camera", choices=("rendered", "corners"), help="instead of the cases' own")
    add_overrides(parser)
    parser.add_argument(
        "--processes", type=int, default=min(2, os.cpu_count() or 1), metavar="N", help="flights at the same time"
    )
    parser.add_argument("--record", metavar="DIR", type=Path, help="leave a recording of every flight here")
    parser.add_argument(
        "--store", metavar="DIR", type=Path, default=Path("runs/campaign"), help="where finished flights are kept"
    )
    parser.add_argument("--fresh", action="store_true", help="fly again what has been flown")
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Fly the campaign; 0 where every requirement is met (by one version of the code), else 1."""
    from companion.campaign.flight import run_flight

    return fly(args, run_flight)


def fly(args: argparse.Namespace, run_flight: RunFlight) -> int:
    """Fly the campaign with a given way to fly one mission; see `run`."""
    console = Console(stderr=args.json)
    root = project_root()
    campaign = _chosen(load_campaign(args.campaign or root / DEFAULT), args.case)
    if args.processes < 1:
        raise InputError.single(source=f"--processes {args.processes}", wrong="not a number of processes", right=">= 1")
    choice = parse_seeds(args.seeds)
    code = fingerprint(root)
    commit = None
    if choice.needs_commit:
        found = current_commit(root)
        commit = found.hash
        if found.changed:
            console.print(
                "[yellow]The checkout has changes that are not committed: the seeds are those of the commit.[/]"
            )
    options = Options(
        processes=args.processes,
        store=None if args.fresh else args.store / code,
        record_dir=args.record,
        camera=args.camera,
        overrides=tuple(args.overrides),
        code_is_the_same=lambda: fingerprint(root) == code,
    )
    tasks = tasks_of(campaign, choice, commit, options)
    console.print(f"{campaign.name}: {len(tasks)} runs, code {code}, commit {commit or '(seeds given)'}")
    records = _fly_all(console, tasks, run_flight, options)
    reports = [
        report_case(case, [record for task, record in records.items() if task.case == case.name])
        for case in campaign.cases
    ]
    _show(console, reports)
    changed = not options.code_is_the_same()
    if changed:
        console.print("[red]The code changed while the campaign was flown: the runs do not belong together.[/]")
    if args.json:
        print(json.dumps({**as_json(reports, commit=commit, fingerprint=code), "code_changed": changed}))
    return 0 if all(report.passed for report in reports) and not changed else 1


def _chosen(campaign: Campaign, wanted: list[str]) -> Campaign:
    if not wanted:
        return campaign
    cases = tuple(case for case in campaign.cases if any(word.lower() in case.name.lower() for word in wanted))
    if not cases:
        names = ", ".join(f'"{case.name}"' for case in campaign.cases)
        raise InputError.single(source="--case", wrong=f"no case has {wanted} in its name", right=f"there are {names}")
    return dataclasses.replace(campaign, cases=cases)


def _fly_all(console: Console, tasks: list[Task], run_flight: RunFlight, options: Options) -> dict[Task, RunRecord]:
    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )
    with progress:
        bar = progress.add_task("flying", total=len(tasks))
        failed = 0

        def on_done(task: Task, record: RunRecord) -> None:
            nonlocal failed
            if not record.success:
                failed += 1
                progress.console.print(
                    f"failed: {task.case}, {record.mission}, seed {task.seed}: {record.reason}", **_PLAIN
                )
            progress.update(bar, advance=1, description=f"flying, {failed} failed" if failed else "flying")

        return run_tasks(tasks, run_flight, options, on_done)


def _show(console: Console, reports: list[CaseReport]) -> None:
    console.print(table_of(reports))
    for report in reports:
        if report.consistency is not None:
            found = report.consistency
            console.print(
                f"{report.name}: {found.runs} runs, {found.epochs} epochs, NEES per degree of freedom "
                f"{found.mean:.2f}; inside {found.inside:.1%}, below {found.below:.1%}, above {found.above:.1%}",
                **_PLAIN,
            )
        for mission, seed, reason in report.failures[:SHOWN_FAILURES]:
            console.print(f"{report.name}: {mission}, seed {seed}: {reason}", **_PLAIN)
        if len(report.failures) > SHOWN_FAILURES:
            console.print(f"{report.name}: and {len(report.failures) - SHOWN_FAILURES} more", **_PLAIN)
