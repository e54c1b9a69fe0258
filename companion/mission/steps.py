"""Steps of a mission's file in their short forms."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Mapping
from typing import Any

from companion.documents import Document, apply_overrides, load_document, nearest
from companion.documents.expectation import hints_of
from companion.documents.nodes import Entry, MappingNode, Node, ScalarNode, SequenceNode, dotted, problem_at
from companion.errors import Problem


def open_steps(path: str | os.PathLike[str], overrides: Iterable[str], kinds: Mapping[str, type[Any]]) -> Document:
    """Read a mission's file, its steps in full, without checking their values.

    Args:
        path: the file.
        overrides: texts `a.b=value`, as from `--set`.
        kinds: the steps that such a mission may have, by their keys.

    Raises:
        InputError: it cannot be read or is not YAML.
    """
    return with_whole_steps(apply_overrides(with_whole_steps(load_document(path), kinds), overrides), kinds)


def with_whole_steps(document: Document, kinds: Mapping[str, type[Any]]) -> Document:
    """Write `- land` and `- land:` as `- land: {}`, and report steps that have not exactly one key.

    Args:
        document: a mission's file.
        kinds: the steps that such a mission may have, by their keys.
    """
    root = document.root
    if not isinstance(root, MappingNode) or "steps" not in root.entries:
        return document
    steps = root.entries["steps"]
    if not isinstance(steps.value, SequenceNode):
        return document
    problems: list[Problem] = []
    items = tuple(_whole_step(item, index, kinds, problems) for index, item in enumerate(steps.value.items))
    whole = dataclasses.replace(steps, value=dataclasses.replace(steps.value, items=items))
    entries = {**root.entries, "steps": whole}
    return dataclasses.replace(
        document,
        root=dataclasses.replace(root, entries=entries),
        problems=tuple(dict.fromkeys((*document.problems, *problems))),
    )


def _whole_step(item: Node, index: int, kinds: Mapping[str, type[Any]], problems: list[Problem]) -> Node:
    key = dotted(("steps", index))
    if isinstance(item, ScalarNode) and isinstance(item.value, str):
        if item.value not in kinds:
            meant = nearest(item.value, kinds)
            right = f"did you mean {meant}?" if meant else f"a step is one of {', '.join(kinds)}"
            problems.append(problem_at(item.position, key, wrong=f'no such step "{item.value}"', right=right))
            return MappingNode(position=item.position, entries={})
        return _step_node(item, item.value, MappingNode(position=item.position, entries={}))
    if not isinstance(item, MappingNode):
        return item
    entries = item.entries
    if len(entries) != 1 and item.position.line is not None:
        problems.append(problem_at(item.position, key, wrong=_wrong_keys(item), right=_right_keys(item, kinds)))
        return MappingNode(position=item.position, entries={name: e for name, e in entries.items() if name in kinds})
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


def _right_keys(item: MappingNode, kinds: Mapping[str, type[Any]]) -> str:
    names = list(item.entries)
    steps = [name for name in names if name in kinds]
    if len(steps) == 1:
        inside = [name for name in names if name in hints_of(kinds[steps[0]])]
        if inside:
            return f"indent {', '.join(inside)} further, below {steps[0]}"
    if len(steps) > 1:
        return "begin each step on its own line with `- `"
    return f"a step has one key, one of {', '.join(kinds)}"
