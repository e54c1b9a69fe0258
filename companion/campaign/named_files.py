"""The files that a flight is told to use, wherever they lie: the mission, and what it and the overrides name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from companion.documents.nodes import MappingNode, Node, ScalarNode
from companion.documents.parse import parse_document
from companion.errors import InputError

_LARGEST = 4_000_000  # [byte] nothing that a mission names is larger


def named_files(mission: Path, overrides: Sequence[str]) -> str:
    """Hash the mission and all files that it, the overrides and those files name: 16 hexadecimal digits.

    Args:
        mission: the mission file.
        overrides: texts `a.b=value`; a value is YAML, as for `--set`.
    """
    values = [text for override in overrides for text in _texts(override.partition("=")[2].encode())]
    waiting = [mission, *(folder / _expanded(text) for text in values for folder in (mission.parent, Path()))]
    found: dict[Path, bytes] = {}
    while waiting:
        path, content = _opened(waiting.pop())
        if content is None or path in found:
            continue
        found[path] = content
        waiting += (path.parent / _expanded(text) for text in _texts(content))
    digest = hashlib.sha256()
    for path in sorted(found):
        digest.update(f"{path}\n".encode())
        digest.update(found[path])
    return digest.hexdigest()[:16]


def _opened(path: Path) -> tuple[Path, bytes | None]:
    """Give a file's content, None where there is none: texts are tried that name no file at all."""
    try:
        path = path.resolve()
        if path.is_file() and path.stat().st_size <= _LARGEST:
            return path, path.read_bytes()
    except (OSError, ValueError, RuntimeError):
        pass
    return path, None


def _expanded(text: str) -> Path:
    try:
        return Path(text).expanduser()
    except RuntimeError:  # of a user whom nobody knows
        return Path(text)


@lru_cache(maxsize=256)
def _texts(content: bytes) -> tuple[str, ...]:
    """Give all texts in a document, each once; none where it is not one, which is for the reader of missions to say."""
    try:
        return tuple(dict.fromkeys(_walk(parse_document(content.decode(errors="replace"), source="").root)))
    except InputError:
        return ()


def _walk(node: Node) -> Iterator[str]:
    if isinstance(node, ScalarNode):
        if isinstance(node.value, str):
            yield node.value
        return
    below = [entry.value for entry in node.entries.values()] if isinstance(node, MappingNode) else node.items
    for each in below:
        yield from _walk(each)
