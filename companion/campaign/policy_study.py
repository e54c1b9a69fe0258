"""Learning the optimal switching policy: dockings to explore by, and flights by fixed distances for the scales."""

from __future__ import annotations

import hashlib
import json
import statistics
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from companion.campaign.exploration import explore, log_as_json, log_from_json
from companion.campaign.named_files import named_files
from companion.campaign.run import RunRecord, Task
from companion.campaign.runner import Options, each_in_processes
from companion.campaign.spec import CaseKind
from companion.errors import InputError
from companion.guidance.decision_process.approach_log import LoggedApproach
from companion.guidance.decision_process.solve import CostWeights
from companion.recording import write_json


def explorations(
    mission: Path,
    overrides: tuple[str, ...],
    seeds: Sequence[int],
    options: Options,
    on_done: Callable[[LoggedApproach], None],
) -> tuple[LoggedApproach, ...]:
    """Fly what has not been flown yet, each with a switching of its own; give the logs in the seeds' order.

    Args:
        mission: a docking mission.
        overrides: texts `a.b=value`.
        seeds: of the flights.
        options: processes and store.
        on_done: called in this process with each finished flight, kept ones first.

    Raises:
        InputError: mission, configuration or an override is wrong.
    """
    name = _folder(mission, overrides)
    folder = None if options.store is None else options.store / name
    logs: dict[int, LoggedApproach] = {}
    for seed in seeds:
        kept = None if folder is None else _kept(folder / f"{seed}.json")
        if kept is not None:
            logs[seed] = kept
            on_done(kept)
    missing = [seed for seed in seeds if seed not in logs]
    for seed, log in each_in_processes(partial(explore, mission, overrides), missing, options.processes):
        if folder is not None and _folder(mission, overrides) == name and options.code_is_the_same():
            write_json(folder / f"{seed}.json", log_as_json(log))
        logs[seed] = log
        on_done(log)
    return tuple(logs[seed] for seed in seeds)


def weights_of(records: Iterable[RunRecord], *, impulse_weight: float, inaccuracy_weight: float) -> CostWeights:
    """Measure time and impulse by the means of some flights: those of fixed distances.

    Args:
        records: the flights.
        impulse_weight: of the impulse, the time having 1.
        inaccuracy_weight: of a contact at the edge of what counts as docked.

    Raises:
        InputError: none of them docked.
    """
    docked = [record.result for record in records if record.result is not None and record.result.success]
    impulses = [result.docking.impulse_ns for result in docked if result.docking is not None]
    if not impulses:
        raise InputError.single(
            source="companion study policy",
            wrong="no flight by fixed distances has docked, so that there is no scale for time and impulse",
            right="a mission that docks: try it with `companion sim`",
        )
    return CostWeights(
        time_scale=round(statistics.fmean(result.duration_s for result in docked), 3),
        impulse_scale=round(statistics.fmean(impulses), 5),
        impulse_weight=impulse_weight,
        inaccuracy_weight=inaccuracy_weight,
    )


def policy_tasks(mission: Path, overrides: tuple[str, ...], seeds: Sequence[int], *, policy: str) -> list[Task]:
    """List flights of one policy."""
    return [
        Task(
            case=policy,
            kind=CaseKind.FLIGHTS,
            mission=mission,
            seed=seed,
            camera="corners",
            overrides=(*overrides, f"steps.0.dock.policy={policy}"),
            record_dir=None,
        )
        for seed in seeds
    ]


def _folder(mission: Path, overrides: Sequence[str]) -> str:
    settings = "\n".join((mission.as_posix(), *overrides, named_files(mission, overrides)))
    return f"exploration/{mission.stem}-{hashlib.sha256(settings.encode()).hexdigest()[:8]}"


def _kept(path: Path) -> LoggedApproach | None:
    try:
        return log_from_json(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError):  # not flown yet, or written by something else: fly it
        return None
