"""What the verbs that fly many simulated flights share: seeds, kept runs, and the progress that is shown meanwhile."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from companion.campaign.run import RunFlight, RunRecord, Task
from companion.campaign.runner import Options, run_tasks
from companion.campaign.seeds import SeedChoice, parse_seeds
from companion.campaign.spec import Camera
from companion.campaign.versions import current_commit, fingerprint, project_root
from companion.errors import InputError

PLAIN: Mapping[str, Any] = {"highlight": False, "markup": False, "soft_wrap": True}  # reasons hold brackets


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """How the flights of one command are flown."""

    choice: SeedChoice
    commit: str | None  # full hash; None: seeds are given
    code: str  # fingerprint
    options: Options

    @property
    def changed(self) -> bool:
        """Whether the code has changed since: then the runs do not belong together."""
        return not self.options.code_is_the_same()


def add_flight_arguments(parser: argparse.ArgumentParser, *, seeds: bool = True) -> None:
    """Declare the arguments that `open_session` reads, but for `--camera` and `--record`.

    Args:
        parser: gets them.
        seeds: whether the help offers `--seeds`; a verb that has seeds of its own refuses what is given.
    """
    parser.add_argument(
        "--seeds",
        default="auto",
        metavar="SEEDS",
        help="auto (drawn from the commit's hash, as many as each case says), auto:30, 1,2,3 or 5..20"
        if seeds
        else argparse.SUPPRESS,
    )
    parser.add_argument(
        "--jobs",
        "--processes",
        dest="processes",
        type=int,
        default=min(2, os.cpu_count() or 1),
        metavar="N",
        help="flights at the same time",
    )
    parser.add_argument(
        "--store", metavar="DIR", type=Path, default=Path("runs/campaign"), help="where finished flights are kept"
    )
    parser.add_argument("--fresh", action="store_true", help="fly again what has been flown")


def open_session(
    console: Console,
    args: argparse.Namespace,
    *,
    overrides: Sequence[str],
    camera: Camera | None = None,
    record_dir: Path | None = None,
    keep_paths: bool = False,
) -> Session:
    """Read the arguments; say so where seeds come from a commit that is not what is flown.

    Args:
        console: for the warning.
        args: as declared by `add_flight_arguments`.
        overrides, camera, record_dir, keep_paths: see `Options`.

    Raises:
        InputError: an argument is wrong, or seeds are to be drawn and there is no commit.
    """
    if args.processes < 1:
        raise InputError.single(source=f"--jobs {args.processes}", wrong="not a number of processes", right=">= 1")
    root = project_root()
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
        record_dir=record_dir,
        camera=camera,
        overrides=tuple(overrides),
        keep_paths=keep_paths,
        code_is_the_same=lambda: fingerprint(root) == code,
    )
    return Session(choice=choice, commit=commit, code=code, options=options)


def flying_bar(console: Console) -> Progress:
    """Give a bar that shows how many flights are done, and how long the others will take."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )


def fly_all(console: Console, tasks: list[Task], run_flight: RunFlight, session: Session) -> dict[Task, RunRecord]:
    """Fly what has not been flown yet, with a progress bar and a line for each failure."""
    console.print(f"{len(tasks)} runs, code {session.code}, commit {session.commit or '(seeds given)'}")
    with flying_bar(console) as progress:
        bar = progress.add_task("flying", total=len(tasks))
        failed = 0

        def on_done(task: Task, record: RunRecord) -> None:
            nonlocal failed
            if not record.success:
                failed += 1
                progress.console.print(
                    f"failed: {task.case}, {record.mission}, seed {task.seed}: {record.reason}", **PLAIN
                )
            progress.update(bar, advance=1, description=f"flying, {failed} failed" if failed else "flying")

        records = run_tasks(tasks, run_flight, session.options, on_done)
    if session.changed:
        console.print("[red]The code changed while it was flown: the runs do not belong together.[/]")
    return records
