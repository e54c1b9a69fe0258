"""`companion study policy`: learn a docking's switching table from simulated flights."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from pathlib import Path

from rich.console import Console
from rich.table import Table

from companion.campaign.runner import Options
from companion.campaign.versions import current_commit, project_root
from companion.cli.flights import PLAIN, add_flight_arguments, fly_all, flying_bar, open_session
from companion.cli.overrides import add_overrides
from companion.config.docking import load_docking
from companion.config.switching_table import save_switching_table
from companion.documents import load_document
from companion.errors import InputError
from companion.guidance.decision_process.approach_log import LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.guidance.decision_process.model import LearningParameters
from companion.guidance.decision_process.solve import CostWeights
from companion.guidance.decision_process.table import SwitchingTable, solve_table
from companion.mission.docking import is_docking

MISSION = Path("missions/papers/parikh_docking.yaml")
TABLE = Path("config/policies/docking.yaml")
BASELINE = 20  # flights by fixed distances that time and impulse are measured by


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion study policy`."""
    parser.add_argument(
        "mission", metavar="MISSION.yaml", nargs="?", type=Path, help=f"a docking (default: the project's {MISSION})"
    )
    parser.add_argument("--runs", type=int, default=400, metavar="N", help="exploratory flights (default 400)")
    parser.add_argument(
        "--out", metavar="FILE", type=Path, help=f"where the table goes (default: the project's {TABLE})"
    )
    parser.add_argument(
        "--impulse-weight",
        type=float,
        default=CostWeights().impulse_weight,
        metavar="W",
        help="what the impulse of a docking by fixed distances costs, its time costing 1 (default %(default)g)",
    )
    parser.add_argument(
        "--inaccuracy-weight",
        type=float,
        default=CostWeights().inaccuracy_weight,
        metavar="U",
        help="what a contact at the edge of what counts as docked costs, in the same measure (default %(default)g)",
    )
    add_overrides(parser)
    add_flight_arguments(parser, seeds=False)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Learn; 0 where it is done and the code has not changed meanwhile, else 1."""
    console = Console(stderr=args.json)
    if args.runs < 1:
        raise InputError.single(source=f"--runs {args.runs}", wrong="not a number of flights", right=">= 1")
    for name in ("impulse", "inaccuracy"):
        weight = getattr(args, f"{name}_weight")
        if not 0.0 <= weight < math.inf:
            raise InputError.single(
                source=f"--{name}-weight {weight:g}", wrong="not a weight", right="a finite number, >= 0"
            )
    if args.out is not None and args.out.is_dir():
        raise InputError.single(
            source=f"--out {args.out}", wrong="this is a directory", right="give the path of a file"
        )
    mission = args.mission or project_root() / MISSION
    if not is_docking(load_document(mission)):
        raise InputError.single(
            source=str(mission),
            wrong="this is no docking",
            right=f"give a mission whose step is dock, such as {MISSION}",
        )
    return _learn(console, args, mission)


def _learn(console: Console, args: argparse.Namespace, mission: Path) -> int:
    from companion.campaign.exploration import learning_seeds
    from companion.campaign.mission import run_mission
    from companion.campaign.policy_study import policy_tasks, weights_of

    if args.seeds != "auto":
        raise InputError.single(
            source=f"--seeds {args.seeds}",
            wrong="flights to learn from have seeds of their own, by which nothing is ever judged",
            right="--runs N says how many",
        )
    session = open_session(console, args, overrides=args.overrides)
    commit = _commit()  # of what flies; files may be edited meanwhile
    seeds = learning_seeds(args.runs + BASELINE)  # the same first ones whatever --runs says
    overrides = session.options.overrides
    world = load_docking(mission, overrides=(*overrides, "steps.0.dock.policy=fixed")).mission.world
    baseline = policy_tasks(mission, overrides, seeds[:BASELINE], policy="fixed")
    weights = weights_of(
        fly_all(console, baseline, run_mission, session).values(),
        impulse_weight=args.impulse_weight,
        inaccuracy_weight=args.inaccuracy_weight,
    )
    logs = _explore(console, mission, overrides, seeds[BASELINE:], session.options)
    table = solve_table(
        logs, commit=commit, grid=DecisionGrid(), learning=LearningParameters(), weights=weights, world=world
    )
    out = args.out or project_root() / TABLE
    changed = session.changed
    out.parent.mkdir(parents=True, exist_ok=True)
    save_switching_table(table, out)
    _show_table(console, table)
    console.print(f"table: {out}", **PLAIN)
    if args.json:
        expected = [
            {"carefulness": policy.carefulness, "residual": policy.residual, **dataclasses.asdict(policy.expected)}
            for policy in table.policies
        ]
        provenance = table.provenance
        print(json.dumps({"approaches": provenance.approaches, "docked": provenance.docked, "policies": expected}))
    return 1 if changed else 0


def _explore(
    console: Console, mission: Path, overrides: tuple[str, ...], seeds: tuple[int, ...], options: Options
) -> tuple[LoggedApproach, ...]:
    from companion.campaign.policy_study import explorations

    with flying_bar(console) as progress:
        bar = progress.add_task("exploring", total=len(seeds))
        return explorations(mission, overrides, seeds, options, lambda _: progress.update(bar, advance=1))


def _commit() -> str:
    commit = current_commit(project_root())
    return f"{commit.hash}, with changes" if commit.changed else commit.hash


def _show_table(console: Console, table: SwitchingTable) -> None:
    p = table.provenance
    console.print(
        f"{p.approaches} approaches in {p.world}, {p.docked} docked ({p.docked / p.approaches:.1%}); measured by "
        f"{p.weights.time_scale:.1f} s and {p.weights.impulse_scale:.3f} Ns of fixed distances",
        **PLAIN,
    )
    shown = Table(title="expected by the model")
    for head in ("carefulness", "time [s]", "impulse [Ns]", "P(miss)", "inaccuracy", "residual"):
        shown.add_column(head, justify="right")
    for policy in table.policies:
        e = policy.expected
        shown.add_row(
            f"{policy.carefulness:g}",
            f"{e.time:.1f}",
            f"{e.impulse:.3f}",
            f"{e.miss:.4f}",
            f"{e.inaccuracy:.4f}",
            f"{policy.residual:.1e}",
        )
    console.print(shown)
