"""Write the page on which every key stands: `python -m companion.config.reference [FILE]`.

By default to `docs/configuration.md`; from the same schemas as editors use, so nothing is declared twice.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from companion.config.load import config_schema, docking_config_schema

PAGE = Path("docs") / "configuration.md"

Schema = Mapping[str, Any]

_INTRODUCTION = """# Configuration: every key

Written by `make schema` from the program's own declarations. What belongs together, and why, is told in
[the components' pages](components/config.md); a mission's keys are in [missions.md](missions.md).
`companion check MISSION.yaml --dump` prints the values that a flight would have.

A key that a file leaves out has its default; `needed`: the file must say it. Explanations run on from one line to the
next where keys belong together; a key without one is explained by its name, or by the lines above. Units are SI, angles
in radians, unless a key's name or its line says otherwise.
"""


def reference() -> str:
    """Give the page, in Markdown."""
    parts = [_INTRODUCTION, *_page("A vehicle's file", config_schema())]
    parts += _page("The file of a spacecraft that docks", docking_config_schema())
    return "\n".join(parts)


def _page(title: str, schema: Schema) -> Iterator[str]:
    yield f"## {title}\n"
    yield from _section("", schema, schema, "")


def _section(path: str, section: Schema, whole: Schema, what: str) -> Iterator[str]:
    """Give a mapping's own keys as a table, then the mappings in it."""
    inner = []
    rows = []
    for name, raw in section.get("properties", {}).items():
        node = _resolved(raw, whole)
        if "properties" in node:
            inner.append((f"{path}.{name}".lstrip("."), node, str(raw.get("description", node.get("description", "")))))
        else:
            needed = name in section.get("required", ())
            rows.append(f"| `{name}` | {_default(raw, needed=needed)} | {_allowed(node)} | {_cell(raw)} |")
    if path:
        yield f"### {path}\n"
        if what:
            yield f"{what[:1].upper()}{what[1:].rstrip('.')}.\n"
    if rows:
        yield "| key | default | allowed | what |\n|---|---|---|---|"
        yield "\n".join(rows) + "\n"
    for name, node, text in inner:
        yield from _section(name, node, whole, text)


def _resolved(node: Schema, whole: Schema) -> Schema:
    """Follow a reference."""
    reference_ = node.get("$ref")
    return node if reference_ is None else whole["$defs"][reference_.rpartition("/")[2]]


def _default(node: Schema, *, needed: bool) -> str:
    if "const" in node:
        return _value(node["const"])
    if "default" not in node:
        return "needed" if needed else "none"
    return _value(node["default"])


def _value(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    if isinstance(value, list):
        return f"`[{', '.join(_value(part).strip('`') for part in value)}]`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _allowed(node: Schema) -> str:
    """Give what a value may be, in words."""
    if "enum" in node:
        return ", ".join(f"`{choice}`" for choice in node["enum"])
    if "const" in node:
        return _value(node["const"])
    for other in node.get("anyOf", ()):
        if other.get("type") != "null":
            return f"{_allowed(other)}, or `null`"
    kind = node.get("type")
    if kind == "array":
        count = node.get("minItems")
        return f"{count} numbers" if count is not None and count == node.get("maxItems") else "a list"
    if kind in ("number", "integer"):
        word = "whole number" if kind == "integer" else ""
        return f"{word} {_range(node)}".strip() or "any"
    words = {"boolean": "`true`, `false`", "string": "text", "object": "a mapping"}
    return words.get(str(kind), "")


def _range(node: Schema) -> str:
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    parts = [
        f"{word} {bound:g}"
        for word, bound in (("at least", low), ("above", above), ("at most", high), ("below", below))
        if bound is not None
    ]
    return ", ".join(parts)


def _cell(node: Schema) -> str:
    return str(node.get("description", "")).replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    page = Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE
    page.write_text(reference(), encoding="utf-8")
    sys.stdout.write(f"{page}\n")
