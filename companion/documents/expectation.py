"""Plain words for what a field accepts, read from its type: "a number greater than 0 and at most 5"."""

from __future__ import annotations

import dataclasses
import enum
import types
from functools import lru_cache
from pathlib import PurePath
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import annotated_types

_SIMPLE = {
    float: "a number",
    int: "a whole number",
    str: "text",
    bool: "true or false",
    type(None): "nothing",
}
_EXAMPLES: dict[Any, str] = {float: "1.0", int: "1", str: "text", bool: "true", type(None): "null"}


@dataclasses.dataclass(frozen=True, slots=True)
class Example:
    """Put into `Annotated`, it says what messages show as an example of the value."""

    text: str


def hints_of(type_: Any) -> dict[str, Any]:
    """Give the types of a dataclass's fields, annotations kept."""
    return _hints_of(type_)


@lru_cache(maxsize=512)
def _hints_of(type_: Any) -> dict[str, Any]:
    hints = get_type_hints(type_, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(type_) if field.init}


def is_dataclass_type(type_: Any) -> bool:
    """Tell whether `type_` is a dataclass (not an instance of one)."""
    return isinstance(type_, type) and dataclasses.is_dataclass(type_)


def bare(type_: Any) -> Any:
    """Strip `Annotated` and `| None`."""
    if get_origin(type_) is Annotated:
        return bare(get_args(type_)[0])
    members = union_members(type_)
    if len(members) > 1:
        kept = [member for member in members if member is not type(None)]
        return bare(kept[0]) if len(kept) == 1 else type_
    return type_


def union_members(type_: Any) -> tuple[Any, ...]:
    """Give the members of a union, or the type alone."""
    return get_args(type_) if get_origin(type_) in (Union, types.UnionType) else (type_,)


def type_at(type_: Any, path: tuple[str | int, ...]) -> Any | None:
    """Give the type of the value at `path` in a document of type `type_`, None where the type has no such place."""
    for step in path:
        type_ = bare(type_)
        type_ = hints_of(type_).get(str(step)) if is_dataclass_type(type_) else _element(type_, step)
        if type_ is None:
            return None
    return type_


def _element(type_: Any, step: str | int) -> Any | None:
    origin, arguments = get_origin(type_), get_args(type_)
    if origin is dict:
        return arguments[1]
    if origin in (list, tuple) and isinstance(step, int):
        if origin is list or arguments[-1] is Ellipsis:
            return arguments[0]
        return arguments[step] if step < len(arguments) else None
    return None


def describe(type_: Any) -> str:
    """Say what a value of this type looks like. That a key may be left out (null) goes without saying."""
    if get_origin(type_) is Annotated:
        inner, *constraints = get_args(type_)
        return _with_range(inner, constraints)
    members = union_members(type_)
    if len(members) > 1:
        return ", or ".join(describe(member) for member in members if member is not type(None))
    return _describe_bare(type_)


def _describe_bare(type_: Any) -> str:
    origin, arguments = get_origin(type_), get_args(type_)
    if origin is Literal:
        return one_of([str(value) for value in arguments])
    if origin is dict:
        return f"a mapping of words to {describe(arguments[1])}"
    if origin is list or (origin is tuple and arguments[-1] is Ellipsis):
        return f"a list, each item {describe(arguments[0])}"
    if origin is tuple:
        same = len(set(arguments)) == 1
        items = describe(arguments[0]) if same else "; ".join(describe(item) for item in arguments)
        return f"a list of {len(arguments)}: {'each ' if same else ''}{items}"
    if isinstance(type_, type):
        if type_ in _SIMPLE:
            return _SIMPLE[type_]
        if issubclass(type_, enum.Enum):
            return one_of([str(member.value) for member in type_])
        if issubclass(type_, PurePath):
            return "the path of a file"
        if is_dataclass_type(type_):
            return f"a mapping with {listed(list(hints_of(type_)), 'the key', 'the keys')}"
    return "another kind of value"


def example(type_: Any) -> str:
    """Give a value that the type accepts, as one would write it in YAML."""
    if get_origin(type_) is Annotated:
        return _example_in_range(*get_args(type_))
    type_ = bare(type_)
    origin, arguments = get_origin(type_), get_args(type_)
    if get_origin(type_) is Annotated:
        return example(type_)
    if origin is Literal:
        return str(arguments[0])
    if origin is list or (origin is tuple and arguments[-1] is Ellipsis):
        return f"[{example(arguments[0])}]"
    if origin is tuple:
        return "[" + ", ".join(example(item) for item in arguments) + "]"
    if isinstance(type_, type):
        return _example_of_class(type_)
    return "..."


def _example_of_class(type_: type) -> str:
    if issubclass(type_, enum.Enum):
        return str(next(iter(type_)).value)
    if issubclass(type_, PurePath):
        return "folder/file.yaml"
    if is_dataclass_type(type_):
        needed = [name for name, required in required_fields(type_).items() if required]
        return "{" + ", ".join(f"{name}: {example(hints_of(type_)[name])}" for name in needed) + "}"
    return _EXAMPLES.get(type_, "...")


def required_fields(type_: type) -> dict[str, bool]:
    """Tell for each field of a dataclass whether a document must give it."""
    return {
        field.name: field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        for field in dataclasses.fields(type_)
        if field.init
    }


def one_of(names: list[str]) -> str:
    """Write `a`, `a or b`, `one of a, b, c`."""
    if len(names) <= 2:
        return " or ".join(names)
    return "one of " + ", ".join(names)


def listed(names: list[str], singular: str, plural: str) -> str:
    """Write `the key a` or `the keys a, b, c`."""
    return f"{singular if len(names) == 1 else plural} {', '.join(names)}"


def _bounds(constraints: list[Any]) -> tuple[list[str], tuple[Any, Any], tuple[int | None, int | None]]:
    words: list[str] = []
    low: Any = None
    high: Any = None
    length: tuple[int | None, int | None] = (None, None)
    flat = [part for item in constraints for part in (item if isinstance(item, annotated_types.Interval) else (item,))]
    for part in flat:
        if isinstance(part, annotated_types.Gt):
            words.append(f"greater than {part.gt:g}")
            low = part.gt
        elif isinstance(part, annotated_types.Ge):
            words.append(f"at least {part.ge:g}")
            low = part.ge
        elif isinstance(part, annotated_types.Lt):
            words.append(f"less than {part.lt:g}")
            high = part.lt
        elif isinstance(part, annotated_types.Le):
            words.append(f"at most {part.le:g}")
            high = part.le
        elif isinstance(part, annotated_types.MultipleOf):
            words.append(f"a multiple of {part.multiple_of}")
        elif isinstance(part, annotated_types.Len | annotated_types.MinLen | annotated_types.MaxLen):
            length = (getattr(part, "min_length", length[0]), getattr(part, "max_length", length[1]))
    return words, (low, high), length


def _with_range(inner: Any, constraints: list[Any]) -> str:
    words, _, (shortest, longest) = _bounds(constraints)
    text = describe(inner)
    if words:
        text += " " + " and ".join(words)
    if bare(inner) is str and shortest == 1:
        return text + ", not empty"
    unit = "characters" if bare(inner) is str else "items"
    if shortest and longest:
        return text + f", {shortest} to {longest} {unit}"
    if shortest:
        return text + f"; at least {shortest} {unit if shortest > 1 else unit[:-1]}"
    return text + (f"; at most {longest} {unit}" if longest else "")


def _example_in_range(inner: Any, *constraints: Any) -> str:
    for constraint in constraints:
        if isinstance(constraint, Example):
            return constraint.text
    _, (low, high), _ = _bounds(list(constraints))
    number = bare(inner)
    if number not in (int, float) or (low is None and high is None):
        return example(inner)
    if low is not None and high is not None:
        middle = (low + high) / 2
        return str(int(middle)) if number is int else f"{middle:g}"
    shifted = low + 1 if low is not None else high - 1
    return str(int(shifted)) if number is int else str(float(shifted))
