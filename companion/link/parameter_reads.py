"""Read the autopilot's parameters one by one, and remember them. Nothing here writes one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.link.events import ParameterRead
from companion.link.incoming import ParamError, ParamValue

_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterReadParameters:
    """How often a parameter is asked for."""

    timeout: Annotated[float, Gt(0.0)] = 0.5  # [s]
    attempts: Annotated[int, Ge(1)] = 4


@dataclass(slots=True)
class _Request:
    sent: int = 0
    t_sent: float = float("-inf")


class ParameterCache:
    """The parameters that have been read, and those that are asked for."""

    def __init__(self, parameters: ParameterReadParameters) -> None:
        self._parameters = parameters
        self._values: dict[str, float] = {}
        self._requests: dict[str, _Request] = {}
        self._answered: list[str] = []
        self._refused: list[str] = []

    def request(self, name: str) -> None:
        """Ask for a parameter; a known value is given again.

        Raises:
            ValueError: not the name of a parameter.
        """
        if _NAME.fullmatch(name) is None:
            raise ValueError(f"{name!r} is not the name of a PX4 parameter")
        if name in self._values:
            self._answered.append(name)
        else:
            self._requests.setdefault(name, _Request())

    def take(self, value: ParamValue) -> None:
        """Take a PARAM_VALUE; what nobody asked for is not kept."""
        if value.name in self._requests:
            del self._requests[value.name]
            self._answered.append(value.name)
            self._values[value.name] = value.value
        elif value.name in self._values:
            self._values[value.name] = value.value

    def refuse(self, error: ParamError) -> None:
        """Take a PARAM_ERROR: the autopilot has no such parameter."""
        if self._requests.pop(error.name, None) is not None:
            self._refused.append(error.name)

    def value(self, name: str) -> float | None:
        """Give a value that has been read, or None."""
        return self._values.get(name)

    def poll(self, t: float) -> tuple[list[str], list[ParameterRead]]:
        """Give the names to ask for at `t` [s], and the answers."""
        names: list[str] = []
        ended = [ParameterRead(t=t, name=name, value=self._values[name]) for name in self._answered]
        ended += [ParameterRead(t=t, name=name, value=None) for name in self._refused]
        self._answered.clear()
        self._refused.clear()
        for name, request in tuple(self._requests.items()):
            if t - request.t_sent < self._parameters.timeout:
                continue
            if request.sent >= self._parameters.attempts:
                del self._requests[name]
                ended.append(ParameterRead(t=t, name=name, value=None))
                continue
            request.sent += 1
            request.t_sent = t
            names.append(name)
        return names, ended

    def forget(self) -> None:
        """The autopilot has restarted: values may differ."""
        self._values.clear()
