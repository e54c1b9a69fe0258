"""Read a mission file."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from companion.documents import (
    Document,
    apply_overrides,
    in_order,
    json_schema,
    load_document,
    nearest,
    validate,
)
from companion.documents.expectation import hints_of
from companion.documents.nodes import Entry, MappingNode, Node, ScalarNode, SequenceNode, dotted, node_at, problem_at
from companion.errors import InputError, Problem
from companion.mission.checks import check_output, check_steps
from companion.mission.schema import STEP_TYPES, Mission, MissionDocument

_KINDS = ", ".join(STEP_TYPES)


def load_mission(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Mission:
    """Read and check a mission.

    Args:
        path: the mission file.
        overrides: texts `a.b=value`, as from `--set`; paths in them count from the current directory.

    Raises:
        InputError: with every problem of the file.
    """
    return mission_from(open_mission(path, overrides))


def open_mission(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Document:
    """Read a mission file without checking its values.

    Raises:
        InputError: it cannot be read or is not YAML.
    """
    return _with_whole_steps(apply_overrides(_with_whole_steps(load_document(path)), overrides))


def mission_from(document: Document) -> Mission:
    """Check an opened mission.

    Raises:
        InputError: with every problem of the file.
    """
    written = validate(document, MissionDocument)
    steps = tuple(entry.step for entry in written.steps)
    problems = [*check_steps(document, steps), *check_output(document, written.output, steps)]
    if problems:
        raise InputError(in_order(problems))
    return Mission(
        source=document.source,
        name=written.name,
        config=_resolved(document, ("config",), written.config),
        pad=_resolved(document, ("target", "pad"), written.target.pad),
        world=_world(document, written.simulation.world),
        wind_mps=written.simulation.wind_mps,
        dropout_s=written.simulation.dropout_s,
        interval_s=written.simulation.interval_s,
        corrupted_fraction=written.simulation.corrupted_fraction,
        limits=written.limits,
        on_target_lost=written.on_target_lost,
        output=written.output,
        steps=steps,
    )


def named_file(document: Document, path: tuple[str, ...]) -> Path | None:
    """Give the file that an opened mission names at `path`, None where no text stands there."""
    node = node_at(document.root, path)
    if isinstance(node, ScalarNode) and isinstance(node.value, str):
        return _resolved(document, path, Path(node.value))
    return None


def named_world(document: Document) -> str | None:
    """Give the simulation's world that an opened mission names, None where it names none."""
    node = node_at(document.root, ("simulation", "world"))
    return _world(document, node.value) if isinstance(node, ScalarNode) and isinstance(node.value, str) else None


def mission_schema() -> dict[str, Any]:
    """Build the JSON Schema of mission files."""
    schema = json_schema(MissionDocument, title="Mission")
    entry = schema["$defs"]["StepEntry"]
    for property_ in entry["properties"].values():
        property_.pop("default", None)
    entry.update(minProperties=1, maxProperties=1)
    names = {
        "type": "string",
        "enum": list(STEP_TYPES),
        "description": "the step with all its values at their defaults",
    }
    schema["properties"]["steps"]["items"] = {"anyOf": [names, {"$ref": "#/$defs/StepEntry"}]}
    return schema


def _resolved(document: Document, path: tuple[str, ...], value: Path) -> Path:
    """Paths in the file count from its folder; paths from `--set` from the current directory."""
    base = Path(document.source).parent if document.position(path).source == document.source else Path()
    return Path(os.path.normpath(base / value.expanduser()))


def _world(document: Document, world: str) -> str:
    if world.endswith((".yaml", ".yml")) or "/" in world:
        return str(_resolved(document, ("simulation", "world"), Path(world)))
    return world


def _with_whole_steps(document: Document) -> Document:
    """Write `- land` and `- land:` as `- land: {}`, and report steps that have not exactly one key."""
    root = document.root
    if not isinstance(root, MappingNode) or "steps" not in root.entries:
        return document
    steps = root.entries["steps"]
    if not isinstance(steps.value, SequenceNode):
        return document
    problems: list[Problem] = []
    items = tuple(_whole_step(item, index, problems) for index, item in enumerate(steps.value.items))
    whole = dataclasses.replace(steps, value=dataclasses.replace(steps.value, items=items))
    entries = {**root.entries, "steps": whole}
    return dataclasses.replace(
        document,
        root=dataclasses.replace(root, entries=entries),
        problems=tuple(dict.fromkeys((*document.problems, *problems))),
    )


def _whole_step(item: Node, index: int, problems: list[Problem]) -> Node:
    key = dotted(("steps", index))
    if isinstance(item, ScalarNode) and isinstance(item.value, str):
        if item.value not in STEP_TYPES:
            meant = nearest(item.value, STEP_TYPES)
            right = f"did you mean {meant}?" if meant else f"a step is one of {_KINDS}"
            problems.append(problem_at(item.position, key, wrong=f'no such step "{item.value}"', right=right))
            return MappingNode(position=item.position, entries={})
        return _step_node(item, item.value, MappingNode(position=item.position, entries={}))
    if not isinstance(item, MappingNode):
        return item
    entries = item.entries
    if len(entries) != 1 and item.position.line is not None:
        problems.append(problem_at(item.position, key, wrong=_wrong_keys(item), right=_right_keys(item)))
        return MappingNode(
            position=item.position, entries={name: e for name, e in entries.items() if name in STEP_TYPES}
        )
    for name, entry in entries.items():
        if isinstance(entry.value, ScalarNode) and entry.value.value is None:
            return dataclasses.replace(
                item,
                entries={
                    name: dataclasses.replace(entry, value=MappingNode(position=entry.value.position, entries={}))
                },
            )
    return item


def _step_node(item: Node, name: str, value: Node) -> MappingNode:
    return MappingNode(position=item.position, entries={name: Entry(key_position=item.position, value=value)})


def _wrong_keys(item: MappingNode) -> str:
    if not item.entries:
        return "an empty step"
    return f"one step with {len(item.entries)} keys: {', '.join(item.entries)}"


def _right_keys(item: MappingNode) -> str:
    names = list(item.entries)
    steps = [name for name in names if name in STEP_TYPES]
    if len(steps) == 1:
        inside = [name for name in names if name in hints_of(STEP_TYPES[steps[0]])]
        if inside:
            return f"indent {', '.join(inside)} further, below {steps[0]}"
    if len(steps) > 1:
        return "begin each step on its own line with `- `"
    return f"a step has one key, one of {_KINDS}"
