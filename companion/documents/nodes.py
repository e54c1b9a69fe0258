"""A YAML document as plain data in which every key and value knows where it stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from companion.errors import Problem

Scalar = str | int | float | bool | None
Plain = Scalar | list["Plain"] | dict[str, "Plain"]
Path = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Where something stands."""

    source: str  # file name as the user gave it, or the option, such as "--set a.b=1"
    line: int | None = None  # first line is 1; None outside a file
    column: int | None = None  # first column is 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ScalarNode:
    """One number, text, boolean or nothing."""

    position: Position
    value: Scalar


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceNode:
    """A list."""

    position: Position
    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One key of a mapping with its value."""

    key_position: Position
    value: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingNode:
    """Keys with values, in the order of the document."""

    position: Position
    entries: Mapping[str, Entry]


Node = ScalarNode | SequenceNode | MappingNode


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A parsed document."""

    source: str  # file name as the user gave it
    root: Node
    problems: tuple[Problem, ...] = field(default=())  # found while parsing; `validate` reports them with its own

    def position(self, path: Path) -> Position:
        """Give the position of the value at `path`, or of the nearest enclosing value that exists."""
        node = self.root
        for step in path:
            child = child_of(node, step)
            if child is None:
                return node.position
            node = child
        return node.position

    def key_position(self, path: Path) -> Position:
        """Give the position of the key at the end of `path`; of the value where it has no key (list items)."""
        parent = node_at(self.root, path[:-1])
        if path and isinstance(parent, MappingNode) and isinstance(path[-1], str) and path[-1] in parent.entries:
            return parent.entries[path[-1]].key_position
        return self.position(path)

    def problem(self, path: Path, *, wrong: str, right: str) -> Problem:
        """Build the problem with the value at `path`."""
        return problem_at(self.position(path), dotted(path), wrong=wrong, right=right)


def child_of(node: Node, step: str | int) -> Node | None:
    """Give the value under a key or an index, None where there is none."""
    if isinstance(node, MappingNode) and isinstance(step, str):
        entry = node.entries.get(step)
        return None if entry is None else entry.value
    if isinstance(node, SequenceNode) and isinstance(step, int) and 0 <= step < len(node.items):
        return node.items[step]
    return None


def node_at(node: Node, path: Path) -> Node | None:
    """Give the value at `path` below `node`, None where there is none."""
    found: Node | None = node
    for step in path:
        if found is None:
            return None
        found = child_of(found, step)
    return found


def plain(node: Node) -> Plain:
    """Give the data without positions: dict, list, str, int, float, bool, None."""
    if isinstance(node, MappingNode):
        return {key: plain(entry.value) for key, entry in node.entries.items()}
    if isinstance(node, SequenceNode):
        return [plain(item) for item in node.items]
    return node.value


def dotted(path: Sequence[str | int]) -> str:
    """Write a path as `a.b.0.c`."""
    return ".".join(str(step) for step in path)


def problem_at(position: Position, key: str, *, wrong: str, right: str) -> Problem:
    """Build the problem at a position."""
    return Problem(
        source=position.source, line=position.line, column=position.column, key=key, wrong=wrong, right=right
    )
