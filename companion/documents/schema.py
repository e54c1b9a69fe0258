"""JSON Schema of a dataclass tree, for editors: keys, types, ranges, defaults, and the comments beside the fields."""

from __future__ import annotations

import inspect
import io
import re
import tokenize
from functools import lru_cache
from typing import Any

from companion.documents.defaults import is_infinite
from companion.documents.expectation import bare, hints_of, is_dataclass_type
from companion.documents.validate import adapter_of

DRAFT = "http://json-schema.org/draft-07/schema#"  # what yaml-language-server understands best
_BOUNDS = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
_FIELD = re.compile(r"^    ([a-z_][a-z0-9_]*):")


def json_schema(type_: type, *, title: str) -> dict[str, Any]:
    """Build the schema of documents of `type_`.

    Args:
        type_: a frozen dataclass.
        title: the schema's title.
    """
    whole = adapter_of(type_).json_schema()
    _settle_bounds(whole)
    definitions: dict[str, Any] = whole.get("$defs", {})
    comments = {name: comment for name, comment in _all_comments(type_).items() if name in definitions}
    for name, definition in definitions.items():
        _describe_definition(definition, comments.get(name, {}))
    root = whole["items"]
    if "$ref" in root:
        root = definitions.pop(root["$ref"].rsplit("/", 1)[-1])
    else:
        _describe_definition(root, field_comments(type_))
    schema = {"$schema": DRAFT, "title": title, **{k: v for k, v in root.items() if k != "title"}}
    if definitions:
        schema["$defs"] = definitions
    return schema


@lru_cache(maxsize=256)
def field_comments(type_: type) -> dict[str, str]:
    """Give the comment beside (or above) each field of a dataclass; needs its source."""
    try:
        source = inspect.getsource(type_)
    except (OSError, TypeError):
        return {}
    comments: dict[str, str] = {}
    lines = source.splitlines()
    trailing = _trailing_comments(source)
    for index, line in enumerate(lines):
        match = _FIELD.match(line)
        if match is None:
            continue
        above: list[str] = []
        cursor = index - 1
        while cursor >= 0 and lines[cursor].startswith("    # "):
            above.insert(0, lines[cursor].strip().lstrip("# "))
            cursor -= 1
        beside = _comment_of_statement(index, lines, trailing)
        text = beside or " ".join(above)  # above a commented field stands the heading of a group
        if text:
            comments[match.group(1)] = text
    return comments


def _comment_of_statement(index: int, lines: list[str], trailing: dict[int, str]) -> str | None:
    """A field that the formatter broke over several lines has its comment on the last, or inside."""
    depth = 0
    for number in range(index, len(lines)):
        code = lines[number].split("#", 1)[0]
        depth += sum(code.count(c) for c in "([{") - sum(code.count(c) for c in ")]}")
        if number in trailing:
            return trailing[number]
        if depth <= 0:
            return None
    return None


def _trailing_comments(source: str) -> dict[int, str]:
    found: dict[int, str] = {}
    for token in tokenize.generate_tokens(io.StringIO(inspect.cleandoc(source)).readline):
        if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip():
            found[token.start[0] - 1] = token.string.lstrip("# ")
    return found


def _all_comments(type_: Any) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}

    def visit(candidate: Any) -> None:
        candidate = bare(candidate)
        if is_dataclass_type(candidate):
            if candidate.__name__ in found:
                return
            found[candidate.__name__] = field_comments(candidate)
            for hint in hints_of(candidate).values():
                visit(hint)
        else:
            for argument in getattr(candidate, "__args__", ()):
                visit(argument)

    visit(type_)
    return found


def _settle_bounds(schema: Any) -> None:
    """Write the bounds of numbers as floats, those of integers as integers.

    pydantic keeps equal constraints once, so a bound of 0.0 may come out as the 0 of a type that was built earlier.
    """
    if isinstance(schema, dict):
        kind = {"number": float, "integer": int}.get(str(schema.get("type")))
        for bound in _BOUNDS:
            if kind is not None and isinstance(schema.get(bound), int | float):
                schema[bound] = kind(schema[bound])
    for inner in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        _settle_bounds(inner)


def _describe_definition(definition: dict[str, Any], comments: dict[str, str]) -> None:
    definition.pop("title", None)
    for name, property_ in definition.get("properties", {}).items():
        property_.pop("title", None)
        if is_infinite(property_.get("default")):
            del property_["default"]  # infinity: no bound; JSON cannot write it
        if name in comments:
            property_["description"] = comments[name]
