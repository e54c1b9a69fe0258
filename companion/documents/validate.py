"""Check a document against a tree of frozen dataclasses and report everything that is wrong with it, in plain words."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, TypeVar, get_args

from pydantic import ConfigDict, TypeAdapter, ValidationError

from companion.documents.defaults import completed
from companion.documents.expectation import (
    bare,
    describe,
    example,
    hints_of,
    is_dataclass_type,
    listed,
    required_fields,
    type_at,
)
from companion.documents.nearest import nearest
from companion.documents.nodes import (
    Document,
    MappingNode,
    Node,
    Path,
    ScalarNode,
    SequenceNode,
    dotted,
    node_at,
    plain,
    problem_at,
)
from companion.documents.override import apply_overrides
from companion.documents.parse import MAX_PROBLEMS, load_document
from companion.errors import InputError, Problem

T = TypeVar("T")
_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
_UNKNOWN_KEY = ("unexpected_keyword_argument", "extra_forbidden")
_MISSING = ("missing", "missing_argument", "missing_keyword_only_argument")


def load_validated(path: str | os.PathLike[str], type_: type[T], overrides: Iterable[str] = ()) -> T:
    """Read a YAML file into a dataclass.

    Args:
        path: the file.
        type_: a frozen dataclass; nested dataclasses, tuples, enums, literals and `Annotated` ranges are checked.
        overrides: texts `a.b=value` that replace values, as from `--set`.

    Raises:
        InputError: with every problem found.
    """
    return validate(apply_overrides(load_document(path), overrides), type_)


def adapter_of(type_: Any) -> TypeAdapter[Any]:
    """Give pydantic's strict adapter of `list[type_]`: inside a list, standard dataclasses inherit the strictness."""
    return _adapter_of(type_)


@lru_cache(maxsize=64)
def _adapter_of(type_: Any) -> TypeAdapter[Any]:
    return TypeAdapter(list[type_], config=_STRICT)


def validate(document: Document, type_: type[T]) -> T:
    """Build `type_` from a document.

    Raises:
        InputError: with the document's own problems and every problem of its values, in the order of the file.
    """
    if isinstance(document.root, ScalarNode | SequenceNode) and is_dataclass_type(type_):
        found = problem_at(
            document.root.position, "", wrong=_found(document.root), right="the file must hold `key: value` lines"
        )
        raise InputError([*document.problems, found])
    try:
        value: T = adapter_of(type_).validate_json(json.dumps([completed(plain(document.root), type_)]))[0]
    except ValidationError as error:
        problems = _translate(document, type_, error)
    else:
        problems = []
    if problems or document.problems:
        raise InputError(_readable(in_order([*document.problems, *problems])))
    return value


def _readable(problems: list[Problem]) -> list[Problem]:
    if len(problems) <= MAX_PROBLEMS:
        return problems
    more = Problem(
        source=problems[-1].source,
        line=None,
        column=None,
        key="",
        wrong=f"{len(problems) - MAX_PROBLEMS} more problems",
        right="correct those above first",
    )
    return [*problems[:MAX_PROBLEMS], more]


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Sort problems by place, sources in their order of appearance; keep the first of those at one place and key."""
    first_at: dict[tuple[str, int | None, int | None, str], Problem] = {}
    sources: dict[str, int] = {}
    for problem in problems:
        sources.setdefault(problem.source, len(sources))
        first_at.setdefault((problem.source, problem.line, problem.column, problem.key), problem)
    return sorted(first_at.values(), key=lambda p: (sources[p.source], p.line or 0, p.column or 0))


def _translate(document: Document, type_: Any, error: ValidationError) -> list[Problem]:
    details = error.errors(include_url=False)
    missing = {_real_path(document, d["loc"][1:], keep_last=True) for d in details if d["type"] in _MISSING}
    problems: list[Problem] = []
    explained: set[Path] = set()  # missing keys for which a misspelt one stands
    # a list counts as too short when its items are wrong: that they are wrong is said already
    wrong_inside = {_real_path(document, d["loc"][1:])[:depth] for d in details for depth in range(len(d["loc"][1:]))}
    for detail in details:
        if detail["type"] in _UNKNOWN_KEY:
            path = _real_path(document, detail["loc"][1:])
            problem, meant = _unknown_key(document, type_, path)
            problems.append(problem)
            if meant is not None and (*path[:-1], meant) in missing:
                explained.add((*path[:-1], meant))
    for detail in details:
        if detail["type"] in _UNKNOWN_KEY:
            continue
        if detail["type"] in _MISSING:
            path = _real_path(document, detail["loc"][1:], keep_last=True)
            if path not in explained:
                problems.append(_missing(document, type_, path))
        else:
            path = _real_path(document, detail["loc"][1:])
            if detail["type"] == "too_short" and path in wrong_inside:
                continue
            problems.append(_wrong_value(document, type_, path, detail))
    return problems


def _real_path(document: Document, location: Sequence[str | int], *, keep_last: bool = False) -> Path:
    """Drop the names that pydantic inserts for members of unions: keep the steps that exist in the document."""
    path: list[str | int] = []
    node: Node | None = document.root
    for index, step in enumerate(location):
        child = None if node is None else node_at(node, (step,))
        if child is not None:
            path.append(step)
            node = child
        elif keep_last and index == len(location) - 1:
            path.append(step)
    return tuple(path)


def _unknown_key(document: Document, type_: Any, path: Path) -> tuple[Problem, str | None]:
    owner = bare(type_at(type_, path[:-1]))
    known = list(hints_of(owner)) if is_dataclass_type(owner) else []
    position = document.key_position(path)
    meant = nearest(str(path[-1]), known)
    right = f"did you mean {meant}?" if meant else f"{listed(known, 'the only key here is', 'the keys here are')}"
    return problem_at(position, dotted(path), wrong="no such key", right=right), meant


def _missing(document: Document, type_: Any, path: Path) -> Problem:
    wanted = type_at(type_, path)
    parent = document.position(path[:-1])
    if isinstance(path[-1], int):
        owner = type_at(type_, path[:-1])
        node = node_at(document.root, path[:-1])
        return problem_at(parent, dotted(path[:-1]), wrong=_found(node), right=f"it must be {describe(owner)}")
    name = str(path[-1])
    shown = example(wanted) if wanted is not None else "..."
    return problem_at(parent, dotted(path), wrong="the key is missing", right=f"add, for example, `{name}: {shown}`")


def _wrong_value(document: Document, type_: Any, path: Path, detail: Any) -> Problem:
    node = node_at(document.root, path)
    position = document.position(path)
    wanted = type_at(type_, path)
    if detail["type"] in ("value_error", "assertion_error"):  # a dataclass's own check
        reason = str(detail.get("ctx", {}).get("error", detail["msg"]))
        return problem_at(position, dotted(path), wrong=reason, right="change these values")
    if wanted is None:
        return problem_at(position, dotted(path), wrong=_found(node), right=str(detail["msg"]).lower())
    return problem_at(position, dotted(path), wrong=_found(node), right=f"it must be {_describe_wanted(wanted, node)}")


def _describe_wanted(wanted: Any, node: Node | None) -> str:
    target = bare(wanted)
    if is_dataclass_type(target):
        needed = [name for name, required in required_fields(target).items() if required]
        if isinstance(node, ScalarNode) and needed:
            return f"{describe(wanted)}, for example `{example(target)}`"
    text = describe(wanted)
    if target is str and isinstance(node, ScalarNode) and node.value is not None and not isinstance(node.value, str):
        return f"{text}; text that looks like a number stands in quotes"
    numeric = target in (int, float) or all(isinstance(value, int) for value in get_args(target) or ("",))
    if numeric and isinstance(node, ScalarNode):
        if isinstance(node.value, str) and _is_number(node.value):
            return f"{text}, without quotes"
        if isinstance(node.value, float) and not math.isfinite(node.value):
            return text.replace("a number", "a finite number", 1)
        if target is int and isinstance(node.value, float):
            return f"{text}, without a decimal point"
    return text


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _found(node: Node | None) -> str:
    if isinstance(node, MappingNode):
        return (
            f"found a mapping with {listed(list(node.entries)[:6], 'the key', 'the keys')}"
            if node.entries
            else ("found an empty mapping")
        )
    if isinstance(node, SequenceNode):
        return f"found a list of {len(node.items)}" if node.items else "found an empty list"
    value = None if node is None else node.value
    if value is None:
        return "found nothing"
    if isinstance(value, bool):
        return f"found {str(value).lower()}"
    if isinstance(value, str):
        short = value if len(value) <= 60 else value[:57] + "..."
        return f'found the text "{short}"'
    if isinstance(value, float) and not math.isfinite(value):
        return "found not-a-number" if math.isnan(value) else "found infinity"
    text = str(value)
    return f"found {text if len(text) <= 40 else text[:37] + '...'}"
