"""Files outside the project that a flight is told to use: a mission of one's own, and what it names in turn."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

_READ = frozenset({".yaml", ".yml", ".json"})


def named_outside(root: Path, mission: Path, overrides: Sequence[str]) -> str:
    """Hash the files outside the project that a mission and its overrides name: 16 hexadecimal digits, "" for none.

    What lies inside is covered by the fingerprint (`versions.py`).

    Args:
        root: the project's.
        mission: the mission file.
        overrides: texts `a.b=value`; a value may name a file.
    """
    values = [override.partition("=")[2] for override in overrides]
    waiting = [mission, *(folder / value for value in values for folder in (mission.parent, Path()) if value)]
    found: dict[Path, bytes] = {}
    while waiting:
        path = waiting.pop().resolve()
        if path in found or path.suffix not in _READ or path.is_relative_to(root.resolve()) or not path.is_file():
            continue
        found[path] = path.read_bytes()
        waiting += (path.parent / text for text in _texts(found[path]))
    if not found:
        return ""
    digest = hashlib.sha256()
    for path in sorted(found):
        digest.update(f"{path}\n".encode())
        digest.update(found[path])
    return digest.hexdigest()[:16]


def _texts(content: bytes) -> Iterator[str]:
    """Give all texts in a document; none where it is not one, which is for the reader of missions to say."""
    try:
        yield from _walk(yaml.safe_load(content))
    except (yaml.YAMLError, ValueError):
        return


def _walk(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    elif isinstance(node, dict | list):
        for each in node.values() if isinstance(node, dict) else node:
            yield from _walk(each)
