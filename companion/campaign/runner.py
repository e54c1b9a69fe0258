"""Flies the runs of a campaign in several processes, and does not fly again what it has flown."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from joblib import Parallel, delayed, parallel_config

from companion.campaign.run import RunFlight, RunRecord, Task, perform
from companion.campaign.seeds import SeedChoice, drawn_seeds
from companion.campaign.spec import Camera, Campaign, Case
from companion.errors import InputError
from companion.recording import write_json

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a campaign is flown."""

    processes: int = 2
    store: Path | None = None  # finished runs are kept here and not flown again; None: not kept
    record_dir: Path | None = None  # every flight leaves its recording below; then nothing is taken from `store`
    camera: Camera | None = None  # instead of the cases' own
    overrides: tuple[str, ...] = ()  # besides the cases' own
    keep_paths: bool = False  # the way that vehicle and target took stays with each result
    code_is_the_same: Callable[[], bool] = lambda: True  # whether a run that ends now may be kept


def tasks_of(campaign: Campaign, choice: SeedChoice, commit: str | None, options: Options) -> list[Task]:
    """List the runs.

    Args:
        campaign: its cases.
        choice: of the seeds.
        commit: the commit's full hash; needed where seeds are drawn.
        options: camera, overrides and where recordings go.
    """
    tasks = []
    for case in campaign.cases:
        for mission in case.missions:
            for seed in _seeds(case, mission, choice, commit):
                folder = options.record_dir
                tasks.append(
                    Task(
                        case=case.name,
                        kind=case.kind,
                        mission=mission,
                        seed=seed,
                        camera=options.camera or case.camera,
                        overrides=(*case.overrides, *options.overrides),
                        record_dir=None if folder is None else folder / case.name / f"{mission.stem}-{seed}",
                        keep_path=options.keep_paths,
                    )
                )
    return tasks


def run_tasks(
    tasks: Sequence[Task], run_flight: RunFlight, options: Options, on_done: Callable[[Task, RunRecord], None]
) -> dict[Task, RunRecord]:
    """Fly what has not been flown yet. An interruption loses only the runs that are in the air.

    Args:
        tasks: the runs.
        run_flight: flies one; it must be importable by another process.
        options: processes and store.
        on_done: called in this process with each finished run, kept ones first.

    Raises:
        InputError: a mission, a configuration or an override is wrong; the remaining runs are dropped.
    """
    records: dict[Task, RunRecord] = {}
    names = {task: task.file_name for task in tasks}
    for task in tasks:
        kept = _load(names[task], options)
        if kept is not None:
            records[task] = kept
            on_done(task, kept)
    missing = [task for task in tasks if task not in records]
    for task, record in each_in_processes(partial(_perform, run_flight), missing, options.processes):
        if record.problems:
            raise InputError(record.problems)
        if task.file_name == names[task]:  # what it names was not edited meanwhile
            _save(names[task], record, options)
        records[task] = record
        on_done(task, record)
    return {task: records[task] for task in tasks}


def _seeds(case: Case, mission: Path, choice: SeedChoice, commit: str | None) -> tuple[int, ...]:
    if choice.given is not None:
        return choice.given
    if commit is None:
        raise ValueError("seeds are drawn from a commit, but none is given")
    name = case.seeds_of or case.name
    label = name if len(case.missions) == 1 else f"{name}/{mission.stem}"
    return drawn_seeds(commit, label, choice.count or case.seeds)


def each_in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], processes: int
) -> Iterator[tuple[Item, Result]]:
    """Do the same to each item, in several processes; give each with its result, in the order in which they end.

    Args:
        work: must be importable by another process.
        items: what is worked on.
        processes: how many at the same time; 1: in this one.
    """
    if processes <= 1:
        for item in items:
            yield item, work(item)
        return
    with parallel_config(backend="loky", n_jobs=processes, inner_max_num_threads=1):
        parallel = Parallel(return_as="generator_unordered", batch_size=1)
        yield from parallel(delayed(_with_item)(work, item) for item in items)


def _perform(run_flight: RunFlight, task: Task) -> RunRecord:
    return perform(task, run_flight)


def _with_item(work: Callable[[Item], Result], item: Item) -> tuple[Item, Result]:
    return item, work(item)


def _load(name: str, options: Options) -> RunRecord | None:
    if options.store is None or options.record_dir is not None:
        return None
    try:
        return RunRecord.from_json(json.loads((options.store / name).read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError):  # not flown yet, or written by something else: fly it
        return None


def _save(name: str, record: RunRecord, options: Options) -> None:
    if options.store is not None and record.crash is None and options.code_is_the_same():
        write_json(options.store / name, record.as_json())
