"""`companion campaign`: fly many simulated missions and hold the statistics against what is required."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

from rich.console import Console

from companion.campaign.run import RunFlight
from companion.campaign.runner import tasks_of
from companion.campaign.spec import Campaign, load_campaign
from companion.campaign.table import CaseReport, as_json, report_case, table_of
from companion.campaign.versions import project_root
from companion.cli.flights import PLAIN, add_flight_arguments, fly_all, open_session
from companion.cli.overrides import add_overrides
from companion.errors import InputError

DEFAULT = Path("config/campaigns/first_flight.yaml")
SHOWN_FAILURES = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion campaign`."""
    parser.add_argument(
        "campaign", metavar="CAMPAIGN.yaml", nargs="?", help=f"the campaign file (default: the project's {DEFAULT})"
    )
    parser.add_argument(
        "--case", action="append", default=[], metavar="NAME", help="only cases whose name contains this; repeatable"
    )
    parser.add_argument("--camera", choices=("rendered", "corners"), help="instead of the cases' own")
    add_overrides(parser)
    add_flight_arguments(parser)
    parser.add_argument("--record", metavar="DIR", type=Path, help="leave a recording of every flight here")
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Fly the campaign; 0 where every requirement is met (by one version of the code), else 1."""
    from companion.campaign.mission import run_mission

    return fly(args, run_mission)


def fly(args: argparse.Namespace, run_flight: RunFlight) -> int:
    """Fly the campaign with a given way to fly one mission; see `run`."""
    console = Console(stderr=args.json)
    campaign = _chosen(load_campaign(args.campaign or project_root() / DEFAULT), args.case)
    session = open_session(console, args, overrides=args.overrides, camera=args.camera, record_dir=args.record)
    console.print(campaign.name, **PLAIN)
    tasks = tasks_of(campaign, session.choice, session.commit, session.options)
    records = fly_all(console, tasks, run_flight, session)
    reports = [
        report_case(case, [record for task, record in records.items() if task.case == case.name])
        for case in campaign.cases
    ]
    _show(console, reports)
    changed = session.changed
    if args.json:
        whole = as_json(reports, commit=session.commit, fingerprint=session.code)
        print(json.dumps({**whole, "code_changed": changed}))
    return 0 if all(report.passed for report in reports) and not changed else 1


def _chosen(campaign: Campaign, wanted: list[str]) -> Campaign:
    if not wanted:
        return campaign
    cases = tuple(case for case in campaign.cases if any(word.lower() in case.name.lower() for word in wanted))
    if not cases:
        names = ", ".join(f'"{case.name}"' for case in campaign.cases)
        raise InputError.single(source="--case", wrong=f"no case has {wanted} in its name", right=f"there are {names}")
    return dataclasses.replace(campaign, cases=cases)


def _show(console: Console, reports: list[CaseReport]) -> None:
    console.print(table_of(reports))
    for report in reports:
        if report.consistency is not None:
            found = report.consistency
            console.print(
                f"{report.name}: {found.runs} runs, {found.epochs} epochs, NEES per degree of freedom "
                f"{found.mean:.2f}; inside {found.inside:.1%}, below {found.below:.1%}, above {found.above:.1%}",
                **PLAIN,
            )
        for mission, seed, reason in report.failures[:SHOWN_FAILURES]:
            console.print(f"{report.name}: {mission}, seed {seed}: {reason}", **PLAIN)
        if len(report.failures) > SHOWN_FAILURES:
            console.print(f"{report.name}: and {len(report.failures) - SHOWN_FAILURES} more", **PLAIN)
