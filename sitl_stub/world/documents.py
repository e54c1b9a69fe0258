"""Strict reading of the simulator's own YAML files: nothing unknown, nothing infinite, every complaint in place."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

MAX_BYTES = 1_000_000


class WorldFileError(ValueError):
    """A world, pad or vehicle file that cannot be used; the message says where, what is wrong and what is right."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A closed range from which a value is drawn per seed; a plain number in a file is a range of width zero."""

    low: float
    high: float

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a value uniformly. Always takes one number from `rng`, so that widths do not shift later draws."""
        return self.low + (self.high - self.low) * float(rng.random())


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a number may be; None: unbounded on that side."""

    low: float | None = None
    high: float | None = None
    above: float | None = None  # exclusive lower bound

    def refuses(self, value: float) -> str:
        """Say what would be right, or "" where `value` is."""
        if not math.isfinite(value):
            return "must be a finite number"
        if self.above is not None and value <= self.above:
            return f"must be greater than {self.above:g}"
        if self.low is not None and value < self.low:
            return f"must be at least {self.low:g}"
        if self.high is not None and value > self.high:
            return f"must be at most {self.high:g}"
        return ""


ANY = Bounds()
POSITIVE = Bounds(above=0.0)
NOT_NEGATIVE = Bounds(low=0.0)
FRACTION = Bounds(low=0.0, high=1.0)
DEGREES = Bounds(low=-360.0, high=360.0)

Place = tuple[str | int, ...]
Marks = Mapping[Place, tuple[int, int]]


class Section:
    """One mapping of a file, read key by key; `finish` refuses the keys that nobody asked for."""

    def __init__(self, values: Any, *, where: str, place: Place = (), marks: Marks | None = None) -> None:
        self.where = where
        self._place = place
        self._marks: Marks = marks or {}
        if not isinstance(values, Mapping):
            raise self.error(None, "must be a mapping of keys to values")
        self._values: Mapping[Any, Any] = values
        self._asked: set[str] = set()

    def error(self, key: str | int | None, complaint: str) -> WorldFileError:
        """Make the error for `key` (None: the section itself)."""
        place = self._place if key is None else (*self._place, key)
        mark = self._marks.get(place)
        at = f"{self.where}:{mark[0]}:{mark[1]}" if mark else self.where
        name = ".".join(str(part) for part in place)
        return WorldFileError(f"{at}: {name}: {complaint}" if name else f"{at}: {complaint}")

    def has(self, key: str) -> bool:
        """Whether `key` is there."""
        return key in self._values

    def _take(self, key: str, default: Any) -> Any:
        self._asked.add(key)
        value = self._values.get(key, default)
        if value is None:
            raise self.error(None if key not in self._values else key, f"'{key}' is missing")
        return value

    def number(self, key: str, default: float | None = None, bounds: Bounds = ANY) -> float:
        """Read a number."""
        return self._number(key, self._take(key, default), bounds)

    def _number(self, key: str | int, value: Any, bounds: Bounds) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"{value!r} is no number")
        number = float(value)
        complaint = bounds.refuses(number)
        if complaint:
            raise self.error(key, f"{value!r} {complaint}")
        return number

    def integer(self, key: str, default: int | None = None, bounds: Bounds = ANY) -> int:
        """Read a whole number."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, f"{value!r} is no whole number")
        self._number(key, value, bounds)
        return value

    def boolean(self, key: str, default: bool | None = None) -> bool:
        """Read true or false."""
        value = self._take(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"{value!r} must be true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Read a text that is not empty."""
        value = self._take(key, default)
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"{value!r} must be a text that is not empty")
        return value

    def choice(self, key: str, options: Sequence[str], default: str | None = None) -> str:
        """Read one of `options`."""
        value = self.text(key, default)
        if value not in options:
            raise self.error(key, f"{value!r} must be one of {', '.join(options)}")
        return value

    def interval(self, key: str, default: Interval | None = None, bounds: Bounds = ANY) -> Interval:
        """Read a number, or [low, high]."""
        value = self._take(key, default)
        if isinstance(value, Interval):
            return value
        if isinstance(value, list):
            if len(value) != 2:
                raise self.error(key, f"{value!r} must be a number or [low, high]")
            low, high = (self._number(key, part, bounds) for part in value)
            if low > high:
                raise self.error(key, f"{value!r}: the first must not be greater than the second")
            return Interval(low, high)
        number = self._number(key, value, bounds)
        return Interval(number, number)

    def vector(
        self, key: str, length: int, default: Sequence[float] | None = None, bounds: Bounds = ANY
    ) -> tuple[float, ...]:
        """Read a list of exactly `length` numbers."""
        value = self._take(key, list(default) if default is not None else None)
        if not isinstance(value, list) or len(value) != length:
            raise self.error(key, f"{value!r} must be a list of {length} numbers")
        return tuple(self._number(key, part, bounds) for part in value)

    def section(self, key: str) -> Section:
        """Enter the mapping at `key`; an absent one is empty."""
        self._asked.add(key)
        return Section(self._values.get(key, {}), where=self.where, place=(*self._place, key), marks=self._marks)

    def sections(self, key: str) -> tuple[Section, ...]:
        """Enter the list of mappings at `key`; an absent one is empty."""
        self._asked.add(key)
        value = self._values.get(key, [])
        if not isinstance(value, list):
            raise self.error(key, f"{value!r} must be a list")
        return tuple(
            Section(part, where=self.where, place=(*self._place, key, index), marks=self._marks)
            for index, part in enumerate(value)
        )

    def finish(self) -> None:
        """Refuse what is left over."""
        for key in self._values:
            if key not in self._asked:
                raise self.error(key, f"unknown key; known here: {', '.join(sorted(self._asked))}")


def file_of(path_or_name: str | Path, folder: Path, *, what: str) -> Path:
    """Give the path of a file, or of the one in `folder` that has this name.

    Args:
        path_or_name: a path ends in .yaml or .yml.
        folder: where the files with names are.
        what: the file is, in words.

    Raises `WorldFileError` where there is none of that name.
    """
    path, name = Path(path_or_name), str(path_or_name)
    if path.suffix in (".yaml", ".yml"):
        return path
    known = sorted(file.stem for file in folder.glob("*.yaml"))
    if name in known:
        return folder / f"{name}.yaml"
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.75)
    right = f"did you mean {' or '.join(near)}?"
    if not near:
        right = f"give a file that ends in .yaml, or one of {', '.join(known)}"
    raise WorldFileError(f"no {what} '{name}': {right}")


def read_document(path: Path) -> Section:
    """Read a YAML file as one mapping.

    Raises `WorldFileError` where it cannot be read, is no YAML, is too large, repeats a key or uses aliases (which can
    grow without bound).
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise WorldFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > MAX_BYTES:
        raise WorldFileError(f"{path}: is larger than {MAX_BYTES} bytes")
    marks: dict[Place, tuple[int, int]] = {}
    try:
        text = data.decode("utf-8")
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.events.AliasEvent):
                mark = event.start_mark
                at = f":{mark.line + 1}:{mark.column + 1}" if mark is not None else ""
                raise WorldFileError(f"{path}{at}: aliases (*{event.anchor}) are not allowed")
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        values = yaml.safe_load(text)
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise WorldFileError(f"{path}: is no YAML: {' '.join(str(error).split())}") from error
    if node is not None:
        _collect_marks(node, (), marks, path)
    return Section(values, where=str(path), marks=marks)


def _collect_marks(node: yaml.Node, place: Place, marks: dict[Place, tuple[int, int]], path: Path) -> None:
    marks.setdefault(place, (node.start_mark.line + 1, node.start_mark.column + 1))
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            here = (*place, key.value)
            line, column = key.start_mark.line + 1, key.start_mark.column + 1
            if here in marks:
                raise WorldFileError(f"{path}:{line}:{column}: {key.value}: stands twice")
            marks[here] = (line, column)
            _collect_marks(value, here, marks, path)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            _collect_marks(value, (*place, index), marks, path)
