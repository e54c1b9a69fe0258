"""Reading several files at once, so that the problems of all of them are reported together."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from companion.documents import Document, nearest, split_override
from companion.documents.files import NO_SUCH_FILE, hint_for_missing
from companion.errors import InputError, Problem
from companion.mission.load import named_file

T = TypeVar("T")
MissionT = TypeVar("MissionT")
TargetT = TypeVar("TargetT")
ConfigT = TypeVar("ConfigT")


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedFiles(Generic[MissionT, TargetT, ConfigT]):
    """A mission with its target's file and its configuration; None: it could not be read, and the problems say why."""

    document: Document | None  # of the mission
    mission: MissionT | None
    target: TargetT | None
    config: tuple[ConfigT, Document] | None
    config_source: str  # the configuration's file


def open_files(
    problems: list[Problem],
    *,
    open_mission: Callable[[], Document],
    mission_from: Callable[[Document], MissionT],
    target_key: tuple[str, ...],
    load_target: Callable[[Path], TargetT],
    config_path: str | os.PathLike[str] | None,
    read_config: Callable[[Path], tuple[ConfigT, Document]],
) -> OpenedFiles[MissionT, TargetT, ConfigT]:
    """Read a mission and the files that it names, each as far as it can be.

    Args:
        problems: gets what is wrong.
        open_mission: reads the mission's file.
        mission_from: checks it.
        target_key: where it names the target's file.
        load_target: reads that.
        config_path: a configuration to be used instead of the one that the mission names.
        read_config: reads the configuration.
    """
    document = collect(problems, open_mission)
    mission = None if document is None else collect(problems, partial(mission_from, document))
    target_path = None if document is None else named_file(document, target_key)
    target = None if target_path is None else collect(problems, partial(load_target, target_path), document, target_key)
    chosen = None if config_path is None else Path(config_path)
    namer = document if config_path is None else None
    if namer is not None:
        chosen = named_file(namer, ("config",))
    config = None if chosen is None else collect(problems, partial(read_config, chosen), namer, ("config",))
    return OpenedFiles(document=document, mission=mission, target=target, config=config, config_source=str(chosen))


def collect(
    problems: list[Problem], read: Callable[[], T], namer: Document | None = None, path: tuple[str, ...] = ()
) -> T | None:
    """Read, or add the problems; where a file as a whole is at fault, point at the place that names it."""
    try:
        return read()
    except InputError as error:
        for problem in error.problems:
            if namer is not None and problem.line is None and not problem.key:
                right = _hint(problem, namer, path)
                problems.append(namer.problem(path, wrong=f"{problem.source}: {problem.wrong}", right=right))
            else:
                problems.append(problem)
        return None


def _hint(problem: Problem, namer: Document, path: tuple[str, ...]) -> str:
    """Say what would be right; a path that is written in a file counts from that file's folder."""
    if problem.wrong != NO_SUCH_FILE or namer.position(path).source != namer.source:
        return problem.right
    return hint_for_missing(problem.source, f"paths in {Path(namer.source).name} count from its folder")


def routed(
    overrides: Iterable[str], mission: type[Any], config: type[Any], problems: list[Problem]
) -> tuple[list[str], list[str]]:
    """Sort `--set` texts into those for the mission and those for the configuration, by their first key.

    Args:
        overrides: the texts.
        mission: class of the mission's document.
        config: class of the configuration.
        problems: gets what is wrong.
    """
    mission_keys = [item.name for item in fields(mission)]
    config_keys = [item.name for item in fields(config)]
    routed: tuple[list[str], list[str]] = ([], [])
    for text in overrides:
        try:
            steps = split_override(text)[0]
        except InputError as error:
            problems.extend(error.problems)
            continue
        if steps[0] in mission_keys:
            routed[0].append(text)
        elif steps[0] in config_keys:
            routed[1].append(text)
        else:
            meant = nearest(steps[0], [*mission_keys, *config_keys])
            known = f"the mission has {', '.join(mission_keys)}; the configuration has {', '.join(config_keys)}"
            problems.append(
                Problem(
                    source=f"--set {text}",
                    line=None,
                    column=None,
                    key=steps[0],
                    wrong="no such key",
                    right=f"did you mean {meant}?" if meant else known,
                )
            )
    return routed
