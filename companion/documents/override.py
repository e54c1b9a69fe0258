"""Replace single values of a document from the command line: `--set guidance.descent_mps=0.3`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

from companion.documents.nodes import Document, Entry, MappingNode, Node, Position, ScalarNode, SequenceNode, dotted
from companion.documents.parse import parse_document
from companion.errors import InputError

OPTION = "--set"


def split_override(text: str) -> tuple[tuple[str, ...], str]:
    """Split `a.b=value` into its path and the value's text.

    Raises:
        InputError: it has another form.
    """
    key, equals, value = text.partition("=")
    steps = tuple(step.strip() for step in key.split("."))
    if not equals or not all(steps):
        raise InputError.single(
            source=f"{OPTION} {text}",
            wrong="this is not `key=value`",
            right=f"write, for example, {OPTION} link.url=udp://:14540",
        )
    return steps, value


def apply_override(document: Document, text: str, *, label: str | None = None) -> Document:
    """Replace, or add, one value; list items are named by their index, counted from 0.

    Args:
        document: the document; it is not changed.
        text: `a.b.0.c=value`, the value in YAML.
        label: what messages call the option; `--set` and the text where not given.

    Raises:
        InputError: the text has another form, its value is not YAML, or the path leads nowhere.
    """
    steps, value = split_override(text)
    position = Position(source=label or f"{OPTION} {text}")
    root = _replaced(document.root, steps, _value_node(value, position), position, ())
    return dataclasses.replace(document, root=root)


def apply_overrides(document: Document, texts: Iterable[str]) -> Document:
    """Apply several; those that fail become `problems` of the document, so that `validate` reports all at once."""
    for text in texts:
        try:
            document = apply_override(document, text)
        except InputError as error:
            document = dataclasses.replace(document, problems=(*document.problems, *error.problems))
    return document


def _value_node(text: str, position: Position) -> Node:
    if not text.strip():
        return ScalarNode(position=position, value=None)
    try:
        parsed = parse_document(text, source=position.source)
    except InputError as error:
        if "empty" in str(error):
            return ScalarNode(position=position, value=None)
        raise InputError([dataclasses.replace(p, line=None, column=None) for p in error.problems]) from None
    if parsed.problems:
        raise InputError([dataclasses.replace(p, line=None, column=None) for p in parsed.problems])
    return _moved(parsed.root, position)


def _moved(node: Node, position: Position) -> Node:
    if isinstance(node, MappingNode):
        entries = {
            key: Entry(key_position=position, value=_moved(entry.value, position))
            for key, entry in node.entries.items()
        }
        return MappingNode(position=position, entries=entries)
    if isinstance(node, SequenceNode):
        return SequenceNode(position=position, items=tuple(_moved(item, position) for item in node.items))
    return ScalarNode(position=position, value=node.value)


def _replaced(node: Node, steps: Sequence[str], value: Node, position: Position, done: tuple[str, ...]) -> Node:
    if not steps:
        return value
    step, rest = steps[0], steps[1:]
    here = (*done, step)
    if isinstance(node, SequenceNode):
        if not step.isascii() or not step.isdigit() or int(step) >= len(node.items):
            raise InputError.single(
                source=position.source,
                key=dotted(here),
                wrong=f"{dotted(done)} is a list of {len(node.items)}",
                right=f"name an item by its index, 0 to {len(node.items) - 1}" if node.items else "the list is empty",
            )
        index = int(step)
        items = list(node.items)
        items[index] = _replaced(items[index], rest, value, position, here)
        return dataclasses.replace(node, items=tuple(items))
    if isinstance(node, ScalarNode) and node.value is not None:
        raise InputError.single(
            source=position.source,
            key=dotted(here),
            wrong=f"{dotted(done) or 'the document'} is a single value, nothing stands below it",
            right=f"set {dotted(done)} itself",
        )
    entries = dict(node.entries) if isinstance(node, MappingNode) else {}
    old = entries.get(step)
    below = old.value if old is not None else MappingNode(position=position, entries={})
    child = _replaced(below, rest, value, position, here)
    entries[step] = Entry(key_position=position, value=child)
    return MappingNode(position=node.position if isinstance(node, MappingNode) else position, entries=entries)
