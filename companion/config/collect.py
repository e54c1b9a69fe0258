"""Reading several files at once, so that the problems of all of them are reported together."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from companion.documents import Document, nearest, split_override
from companion.documents.files import NO_SUCH_FILE, hint_for_missing
from companion.errors import InputError, Problem

T = TypeVar("T")


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
