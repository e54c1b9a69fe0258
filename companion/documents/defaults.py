"""Dataclasses back to plain data, and what a document leaves out of a section that has a default of its own."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from companion.documents.expectation import bare, hints_of, is_dataclass_type


def completed(value: Any, type_: Any) -> Any:
    """Give plain data with what it leaves out of a section that is given in part.

    A field may default to an instance with values of its own: a planner's weights as one user needs them. Naming one
    of them changes that one; the others stay as that field's default has them, not as the class has them.

    Args:
        value: plain data as it stands in a document.
        type_: the dataclass that it is meant for; anything else is given back as it is.
    """
    if not (is_dataclass_type(type_) and isinstance(value, dict)):
        return value
    result = dict(value)
    hints = hints_of(type_)
    for field in dataclasses.fields(type_):
        part = result.get(field.name)
        if field.name not in hints or not isinstance(part, dict):
            continue
        inner, default = bare(hints[field.name]), _default_of(field)
        if dataclasses.is_dataclass(default) and type(default) is inner:
            result[field.name] = _merged(default, part)
        else:
            result[field.name] = completed(part, inner)
    return result


def _merged(default: Any, part: dict[str, Any]) -> dict[str, Any]:
    """Give a section's part with the default's values for what it leaves out, where the class has others."""
    result = dict(part)
    for field in dataclasses.fields(default):
        own = getattr(default, field.name)
        inner = part.get(field.name)
        if field.name not in part:
            if field.init and own != _default_of(field):
                result[field.name] = to_plain(own)
        elif isinstance(inner, dict) and dataclasses.is_dataclass(own):
            result[field.name] = _merged(own, inner)
    return result


def _default_of(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def to_plain(value: Any) -> Any:
    """Turn a validated dataclass tree back into plain data, as it would stand in a document.

    Defaults of infinity (no bound) are left out: a document cannot hold them.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        values = {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
        return {name: item for name, item in values.items() if not is_infinite(item)}
    if isinstance(value, tuple | list):
        return [to_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: to_plain(item) for key, item in value.items()}
    if hasattr(value, "value") and type(value).__module__ != "builtins" and not callable(value):
        return value.value
    return value if isinstance(value, str | int | float | bool) or value is None else str(value)


def is_infinite(value: Any) -> bool:
    """Say whether a value is no bound at all."""
    return isinstance(value, float) and math.isinf(value)
