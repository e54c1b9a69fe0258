"""Reading several files at once, so that the problems of all of them are reported together."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from companion.config.world_check import WrongWithWorld, check_world
from companion.documents import Document, nearest, split_override
from companion.documents.files import NO_SUCH_FILE, hint_for_missing
from companion.errors import InputError, Problem
from companion.mission.load import named_file, named_world

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


@dataclass(frozen=True, slots=True, kw_only=True)
class FileReaders(Generic[MissionT, TargetT, ConfigT]):
    """How the files of one kind of mission are read."""

    mission_type: type[Any]  # class of the mission's document
    open_mission: Callable[[str | os.PathLike[str], Iterable[str]], Document]  # (path, overrides)
    mission_from: Callable[[Document], MissionT]  # checks it
    target_key: tuple[str, ...]  # where it names the target's file
    load_target: Callable[[Path], TargetT]
    config_type: type[Any]
    read_config: Callable[[Path, Iterable[str]], tuple[ConfigT, Document]]  # (path, overrides)


def open_files(
    problems: list[Problem],
    readers: FileReaders[MissionT, TargetT, ConfigT],
    mission_path: str | os.PathLike[str],
    *,
    config_path: str | os.PathLike[str] | None,
    overrides: Iterable[str],
    wrong_with_world: WrongWithWorld | None,
) -> OpenedFiles[MissionT, TargetT, ConfigT]:
    """Read a mission and the files that it names, each as far as it can be.

    Args:
        problems: gets what is wrong.
        readers: for this kind of mission.
        mission_path: the mission's file.
        config_path: a configuration to be used instead of the one that the mission names.
        overrides: texts `a.b=value`, for mission and configuration.
        wrong_with_world: checks the simulation's world that the mission names; None: it is not checked.
    """
    for_mission, for_config = routed(overrides, readers.mission_type, readers.config_type, problems)
    document = collect(problems, partial(readers.open_mission, mission_path, for_mission))
    mission = None if document is None else collect(problems, partial(readers.mission_from, document))
    key = readers.target_key
    target_path = None if document is None else named_file(document, key)
    target = (
        None if target_path is None else collect(problems, partial(readers.load_target, target_path), document, key)
    )
    chosen = None if config_path is None else Path(config_path)
    namer = document if config_path is None else None
    if namer is not None:
        chosen = named_file(namer, ("config",))
    config = None
    if chosen is not None:
        config = collect(problems, partial(readers.read_config, chosen, for_config), namer, ("config",))
    if document is not None and wrong_with_world is not None:
        problems.extend(check_world(document, named_world(document), wrong_with_world))
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
