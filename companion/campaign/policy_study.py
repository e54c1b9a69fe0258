"""The optimal switching policy: learned from exploratory dockings, and flown over its carefulness."""

from __future__ import annotations

import hashlib
import json
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from companion.campaign.exploration import explore, log_as_json, log_from_json
from companion.campaign.run import RunFlight, RunRecord, Task
from companion.campaign.runner import Options, each_in_processes, run_tasks
from companion.campaign.spec import CaseKind
from companion.errors import InputError
from companion.guidance.decision_process.approach_log import LoggedApproach
from companion.guidance.decision_process.solve import CostWeights
from companion.recording import write_json


@dataclass(frozen=True, slots=True, kw_only=True)
class ParetoRow:
    """What a carefulness (or another policy) comes to: means over the flights that docked."""

    policy: str  # as in a mission
    carefulness: float | None  # lambda; None: the policy has none
    runs: int
    docked: int
    time_s: float | None  # None: none docked
    impulse_ns: float | None
    position_error_m: float | None
    angular_error_rad: float | None

    @property
    def miss(self) -> float:
        """Share of the flights that did not dock."""
        return 1.0 - self.docked / self.runs


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
    folder = None if options.store is None else options.store / _folder(mission, overrides)
    logs: dict[int, LoggedApproach] = {}
    for seed in seeds:
        kept = None if folder is None else _kept(folder / f"{seed}.json")
        if kept is not None:
            logs[seed] = kept
            on_done(kept)
    missing = [seed for seed in seeds if seed not in logs]
    for seed, log in each_in_processes(partial(explore, mission, overrides), missing, options.processes):
        if folder is not None and options.code_is_the_same():
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
    row = _row("fixed", None, list(records))
    if row.time_s is None or row.impulse_ns is None:
        raise InputError.single(
            source="companion study policy",
            wrong="no flight by fixed distances has docked, so that there is no scale for time and impulse",
            right="a mission that docks: try it with `companion sim`",
        )
    return CostWeights(
        time_scale=round(row.time_s, 3),
        impulse_scale=round(row.impulse_ns, 5),
        impulse_weight=impulse_weight,
        inaccuracy_weight=inaccuracy_weight,
    )


def policy_tasks(
    mission: Path, overrides: tuple[str, ...], seeds: Sequence[int], *, policy: str, carefulness: float | None = None
) -> list[Task]:
    """List flights of one policy."""
    chosen = [f"steps.0.dock.policy={policy}"]
    if carefulness is not None:
        chosen.append(f"steps.0.dock.careful={carefulness:g}")
    return [
        Task(
            case=policy if carefulness is None else f"{policy} {carefulness:g}",
            kind=CaseKind.FLIGHTS,
            mission=mission,
            seed=seed,
            camera="corners",
            overrides=(*overrides, *chosen),
            record_dir=None,
        )
        for seed in seeds
    ]


def pareto(
    mission: Path,
    overrides: tuple[str, ...],
    carefulness: Sequence[float],
    seeds: Sequence[int],
    *,
    run_flight: RunFlight,
    options: Options,
    on_done: Callable[[Task, RunRecord], None],
) -> tuple[ParetoRow, ...]:
    """Fly fixed distances, the Markov model, and the table with each carefulness, all with the same seeds.

    Args:
        mission: a docking mission whose configuration names a table.
        overrides: texts `a.b=value`.
        carefulness: lambdas.
        seeds: of the flights.
        run_flight: flies one; it must be importable by another process.
        options: processes and store.
        on_done: called in this process with each finished flight.

    Raises:
        InputError: mission, configuration, table or an override is wrong.
    """
    cases: list[tuple[str, float | None]] = [("fixed", None), ("markov", None), *(("optimal", c) for c in carefulness)]
    tasks = {case: policy_tasks(mission, overrides, seeds, policy=case[0], carefulness=case[1]) for case in cases}
    records = run_tasks([task for own in tasks.values() for task in own], run_flight, options, on_done)
    return tuple(_row(policy, c, [records[task] for task in own]) for (policy, c), own in tasks.items())


def _row(policy: str, carefulness: float | None, records: Sequence[RunRecord]) -> ParetoRow:
    docked = [record.result for record in records if record.result is not None and record.result.success]
    return ParetoRow(
        policy=policy,
        carefulness=carefulness,
        runs=len(records),
        docked=len(docked),
        time_s=_mean(result.duration_s for result in docked),
        impulse_ns=_mean(result.docking.impulse_ns for result in docked if result.docking is not None),
        position_error_m=_mean(result.position_error_m for result in docked),
        angular_error_rad=_mean(result.angular_error_rad for result in docked),
    )


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def _folder(mission: Path, overrides: Sequence[str]) -> str:
    settings = "\n".join((mission.as_posix(), *overrides))
    return f"exploration/{mission.stem}-{hashlib.sha256(settings.encode()).hexdigest()[:8]}"


def _kept(path: Path) -> LoggedApproach | None:
    try:
        return log_from_json(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError):  # not flown yet, or written by something else: fly it
        return None
