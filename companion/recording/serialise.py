"""Messages to plain values that JSON can hold, and to text.

Plain: a dataclass becomes a mapping of its fields, an array nested lists, an Enum its value, a tuple a list.
Numbers are written with the fewest digits that give the same bits back, so equal bits give equal text.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

import numpy as np

_STRICT = json.JSONEncoder(separators=(",", ":"), allow_nan=False, ensure_ascii=False)
_AS_IT_IS = frozenset((float, int, str, bool, type(None)))
_converters: dict[type, Callable[[Any], Any]] = {}


def to_record(message: object) -> dict[str, Any]:
    """Turn a message (a dataclass instance) into a mapping of plain values.

    Raises:
        TypeError: `message` is no dataclass instance, or holds something that has no plain form.
    """
    if not dataclasses.is_dataclass(message) or isinstance(message, type):
        raise TypeError(f"expected a dataclass instance, got {type(message).__name__}")
    plain: dict[str, Any] = to_plain(message)
    return plain


def to_plain(value: Any) -> Any:
    """Turn any value that a message may hold into plain values.

    Raises:
        TypeError: it has no plain form.
    """
    kind = type(value)
    if kind in _AS_IT_IS:
        return value
    converter = _converters.get(kind)
    if converter is None:
        converter = _converters[kind] = _converter_of(kind)
    return converter(value)


def encode_json(data: Mapping[str, object]) -> bytes:
    """Write a mapping as compact UTF-8 JSON; what is not finite becomes null (JSON has no other numbers).

    Raises:
        TypeError: a value has no plain form.
    """
    try:
        return _STRICT.encode(data).encode()
    except (ValueError, TypeError):
        return _STRICT.encode(_finite(to_plain(data))).encode()


def _converter_of(kind: type) -> Callable[[Any], Any]:
    if dataclasses.is_dataclass(kind):
        return _dataclass_converter(kind)
    for base, converter in _BY_BASE:
        if issubclass(kind, base):
            return converter
    raise TypeError(f"{kind.__name__} has no plain form; record numbers, text, arrays, enums or dataclasses")


def _dataclass_converter(kind: type) -> Callable[[Any], Any]:
    names = tuple(field.name for field in dataclasses.fields(kind))

    def convert(message: Any) -> dict[str, Any]:
        plain = {}
        for name in names:
            value = getattr(message, name)
            kind = type(value)
            if kind is np.ndarray:
                plain[name] = value.tolist()
            elif kind in _AS_IT_IS:
                plain[name] = value
            else:
                plain[name] = to_plain(value)
        return plain

    return convert


def _mapping(value: Mapping[Any, Any]) -> dict[str, Any]:
    return {str(key): to_plain(item) for key, item in value.items()}


def _sequence(value: Any) -> list[Any]:
    return [item if type(item) in _AS_IT_IS else to_plain(item) for item in value]


_BY_BASE: tuple[tuple[type, Callable[[Any], Any]], ...] = (
    (Enum, lambda value: to_plain(value.value)),
    (np.ndarray, lambda value: value.tolist()),
    (np.generic, lambda value: value.item()),
    (Mapping, _mapping),
    (list, _sequence),
    (tuple, _sequence),
    (bool, bool),
    (int, int),
    (float, float),
    (str, str),
)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return value
