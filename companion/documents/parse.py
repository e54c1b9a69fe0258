"""YAML text to a document with positions, refusing what is ambiguous or could exhaust the machine.

libyaml's parser delivers events; the tree is built here, because PyYAML's own composer forgets anchors, keeps the last
of two equal keys, and lets aliases explode.
"""

from __future__ import annotations

import os
from collections.abc import Container, Iterator
from typing import Any

import yaml

from companion.documents.files import read_text
from companion.documents.nodes import (
    Document,
    Entry,
    MappingNode,
    Node,
    Path,
    Position,
    ScalarNode,
    SequenceNode,
    dotted,
    problem_at,
)
from companion.documents.scalars import TrapError, resolve_plain
from companion.documents.syntax import explain_syntax_error
from companion.errors import InputError, Problem

MAX_DEPTH = 32
MAX_PROBLEMS = 50  # then nobody reads on
MAX_NODES = 20_000  # counted after expansion of aliases
_LOADER: Any = getattr(yaml, "CLoader", yaml.Loader)


class _TooMuchError(Exception):
    """The document exceeds a limit: parsing stops here."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(str(problem))
        self.problem = problem


def load_document(path: str | os.PathLike[str], *, tags: Container[str] = ()) -> Document:
    """Read and parse a file.

    Args:
        path: the file; its name in messages is the one given here.
        tags: YAML tags to be ignored, such as "tag:yaml.org,2002:opencv-matrix"; all others are refused.

    Raises:
        InputError: the file cannot be read or is not YAML. Problems that leave the structure readable
            (duplicate keys, ambiguous words) are in `Document.problems` instead, so that `validate` can report all.
    """
    return parse_document(read_text(path), source=os.fspath(path), tags=tags)


def parse_document(text: str, *, source: str, tags: Container[str] = ()) -> Document:
    """Parse YAML text; see `load_document`."""
    composer = _Composer(source, tags)
    try:
        root = composer.document(_events(text))
    except yaml.YAMLError as error:
        raise InputError([*composer.problems, explain_syntax_error(error, text=text, source=source)]) from None
    except _TooMuchError as error:
        raise InputError([*composer.problems, error.problem]) from None
    if root is None:
        raise InputError.single(source=source, wrong="the file is empty", right="it must hold `key: value` lines")
    return Document(source=source, root=root, problems=tuple(composer.problems))


def _events(text: str) -> Iterator[Any]:
    if text.startswith("%YAML:1.0"):  # OpenCV's own spelling of the directive
        text = "#" + text[1:]
    loader = _LOADER(text)
    try:
        while loader.check_event():
            yield loader.get_event()
    finally:
        loader.dispose()


class _Composer:
    """Builds the tree from events; collects the problems that do not stop it."""

    def __init__(self, source: str, tags: Container[str]) -> None:
        self.problems: list[Problem] = []
        self._source = source
        self._tags = tags
        self._nodes = 0
        self._anchors: dict[str, tuple[Node, int]] = {}

    def document(self, events: Iterator[Any]) -> Node | None:
        root: Node | None = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    position = self._position(event)
                    self._report(position, (), "a second document begins here", "keep one document per file")
                    break
                root = self._node(next(events), events, ())
        if isinstance(root, ScalarNode) and root.value is None:
            return None
        return root

    def _node(self, event: Any, events: Iterator[Any], path: Path) -> Node:
        position = self._position(event)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, position, path)
        before = self._nodes
        self._count(1, position, path)
        self._check_tag(event, position, path)
        node: Node
        if isinstance(event, yaml.ScalarEvent):
            node = ScalarNode(position=position, value=self._scalar(event, position, path))
        elif isinstance(event, yaml.SequenceStartEvent):
            node = self._sequence(events, position, path)
        else:
            node = self._mapping(events, position, path)
        if event.anchor is not None:
            self._anchors[event.anchor] = (node, self._nodes - before)
        return node

    def _sequence(self, events: Iterator[Any], position: Position, path: Path) -> SequenceNode:
        items: list[Node] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            items.append(self._node(event, events, (*path, len(items))))
        return SequenceNode(position=position, items=tuple(items))

    def _mapping(self, events: Iterator[Any], position: Position, path: Path) -> MappingNode:
        entries: dict[str, Entry] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            key_position = self._position(event)
            key = self._key(event, events, path)
            value = self._node(next(events), events, (*path, key or "?"))
            if key is None:
                continue
            if key in entries:
                first = entries[key].key_position
                self._report(
                    key_position,
                    (*path, key),
                    f"the key stands here again (first on line {first.line})",
                    "keep one of the two",
                )
                continue
            entries[key] = Entry(key_position=key_position, value=value)
        return MappingNode(position=position, entries=entries)

    def _key(self, event: Any, events: Iterator[Any], path: Path) -> str | None:
        position = self._position(event)
        known = len(self.problems)
        node = self._node(event, events, (*path, "?"))
        if len(self.problems) > known:
            return None
        if isinstance(node, ScalarNode) and isinstance(node.value, str):
            if node.value == "<<" and not event.style:
                self._report(position, path, "`<<` (merge) is not supported", "write the keys out")
                return None
            return node.value
        found = "a list or mapping" if not isinstance(node, ScalarNode) else f"{node.value!r}"
        self._report(position, path, f"a key must be a word, found {found}", "write `word: value`, or quote the key")
        return None

    def _scalar(self, event: Any, position: Position, path: Path) -> Any:
        if event.style:  # quoted, or a block of text
            return event.value
        try:
            return resolve_plain(event.value)
        except TrapError as trap:
            self._report(position, path, trap.wrong, trap.right)
            return event.value

    def _alias(self, event: Any, position: Position, path: Path) -> Node:
        found = self._anchors.get(event.anchor)
        if found is None:
            self._report(
                position, path, f"*{event.anchor} has no complete &{event.anchor} before it", "write the value out"
            )
            return ScalarNode(position=position, value=None)
        node, size = found
        self._count(size, position, path)
        return node

    def _check_tag(self, event: Any, position: Position, path: Path) -> None:
        if event.tag is not None and event.tag not in self._tags and event.tag != "!":
            self._report(position, path, f"the tag {event.tag} is not supported", "remove it; write plain values")

    def _count(self, nodes: int, position: Position, path: Path) -> None:
        self._nodes += nodes
        if self._nodes > MAX_NODES:
            self._stop(
                position,
                path,
                f"the document has more than {MAX_NODES} values, aliases written out",
                "write a shorter document, with fewer aliases (*name)",
            )
        if len(path) > MAX_DEPTH:
            self._stop(position, path[:4], f"the document is nested deeper than {MAX_DEPTH} levels", "use fewer levels")

    def _stop(self, position: Position, path: Path, wrong: str, right: str) -> None:
        raise _TooMuchError(problem_at(position, dotted(path), wrong=wrong, right=right))

    def _report(self, position: Position, path: Path, wrong: str, right: str) -> None:
        if len(self.problems) >= MAX_PROBLEMS:
            self._stop(position, (), f"more than {MAX_PROBLEMS} problems", "correct those above first")
        self.problems.append(problem_at(position, dotted(path), wrong=wrong, right=right))

    def _position(self, event: Any) -> Position:
        mark = event.start_mark
        return Position(source=self._source, line=mark.line + 1, column=mark.column + 1)
