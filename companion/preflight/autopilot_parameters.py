"""The autopilot's parameters on which the safety of a flight in OFFBOARD rests: read and judged, never changed.

Sources, PX4 v1.17: commander/commander_params.c, commander/failsafe/failsafe.cpp, navigator/geofence_params.c.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated

from annotated_types import Interval

from companion.preflight.finding import Finding, Verdict, judged

_ANY = "any value"
Bits = Annotated[int, Interval(ge=0, le=65535)]
Seconds = Annotated[float, Interval(ge=0.0, le=60.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedBits:
    """Which bits a parameter must have. Both 0: any value will do."""

    bits_set: Bits  # sum of the bits that must be set
    bits_clear: Bits  # sum of the bits that must not be set

    def accepts(self, value: float) -> bool:
        """Tell whether a value will do."""
        if not math.isfinite(value):
            return False
        return int(value) & self.bits_set == self.bits_set and not int(value) & self.bits_clear

    def __str__(self) -> str:
        """Say what will do."""
        words = [f"bit {k} set" for k in range(16) if self.bits_set >> k & 1]
        words += [f"bit {k} not set" for k in range(16) if self.bits_clear >> k & 1]
        return " and ".join(words) or _ANY


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedChoice:
    """Which values a parameter may have."""

    values: tuple[int, ...]  # acceptable; an empty list accepts any

    def accepts(self, value: float) -> bool:
        """Tell whether a value will do."""
        return not self.values or value in self.values

    def __str__(self) -> str:
        """Say what will do."""
        return " or ".join(map(str, self.values)) or _ANY


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedRange:
    """Between which limits a parameter must lie."""

    least: Seconds  # [s]
    most: Seconds  # [s]

    def accepts(self, value: float) -> bool:
        """Tell whether a value will do."""
        return math.isfinite(value) and self.least - 1e-6 <= value <= self.most + 1e-6

    def __str__(self) -> str:
        """Say what will do."""
        return f"{self.least:g} to {self.most:g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedValue:
    """The value that a parameter must have, as the configuration has it too."""

    value: float
    tolerance: float = 0.02  # of the value

    def accepts(self, value: float) -> bool:
        """Tell whether a value will do."""
        return math.isfinite(value) and abs(value - self.value) <= self.tolerance * abs(self.value) + 1e-4

    def __str__(self) -> str:
        """Say what will do."""
        return f"{self.value:g}"


Wanted = WantedBits | WantedChoice | WantedRange | WantedValue
Rules = Mapping[str, Wanted]  # by PX4's name of the parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedParameters:
    """What each parameter must be, by PX4's names; a vehicle with another value is not armed."""

    # moving the sticks ends OFFBOARD (bit 1; PX4's default is without it); multicopters only
    COM_RC_OVERRIDE: WantedBits = field(default_factory=lambda: WantedBits(bits_set=2, bits_clear=0))
    # when our setpoints stop and a transmitter is there: Position, Return, Land or Hold
    COM_OBL_RC_ACT: WantedChoice = field(default_factory=lambda: WantedChoice(values=(0, 3, 4, 5)))
    # [s] after which our setpoints count as lost
    COM_OF_LOSS_T: WantedRange = field(default_factory=lambda: WantedRange(least=0.3, most=2.0))
    # losing the transmitter counts in OFFBOARD too (bit 2 would ignore it)
    COM_RCL_EXCEPT: WantedBits = field(default_factory=lambda: WantedBits(bits_set=0, bits_clear=4))
    # when the transmitter is lost: Hold, Return or Land
    NAV_RCL_ACT: WantedChoice = field(default_factory=lambda: WantedChoice(values=(1, 2, 3)))
    # at the geofence: Hold, Return or Land
    GF_ACTION: WantedChoice = field(default_factory=lambda: WantedChoice(values=(2, 3, 5)))

    @property
    def rules(self) -> Rules:
        """What each parameter must be, by its name."""
        return {item.name: getattr(self, item.name) for item in fields(self)}


_RETURNS = {3: "Return", 4: "Land", 5: "Hold"}
_MEANINGS: dict[str, dict[int, str]] = {
    "COM_OBL_RC_ACT": {0: "Position", 1: "Altitude", 2: "Stabilized", **_RETURNS, 6: "Terminate", 7: "Disarm"},
    "NAV_RCL_ACT": {0: "disabled", 1: "Hold", 2: "Return", 3: "Land", 5: "Terminate", 6: "Disarm"},
    "GF_ACTION": {0: "none", 1: "warning", 2: "Hold", 3: "Return", 4: "Terminate", 5: "Land"},
}
_REASONS = {
    "COM_RC_OVERRIDE": "so that moving the sticks ends OFFBOARD",
    "COM_OBL_RC_ACT": "what the vehicle does when setpoints stop",
    "COM_OF_LOSS_T": "seconds until setpoints count as lost",
    "COM_RCL_EXCEPT": "so that a lost transmitter counts in OFFBOARD",
    "NAV_RCL_ACT": "what the vehicle does when the transmitter is lost",
    "GF_ACTION": "what the vehicle does at its geofence",
    "COM_RC_IN_MODE": "so that a transmitter counts before this program's sticks",
    "COM_RC_LOSS_T": "seconds until sticks count as lost",
}
_SAME = "as vehicle.rover.drive of the configuration has it"
_MEANINGS["COM_RC_IN_MODE"] = {
    0: "transmitter only",
    1: "MAVLink only",
    2: "either, the first",
    3: "the first until reboot",
    4: "no sticks",
    5: "transmitter first",
    6: "MAVLink first",
    7: "transmitter first",
    8: "MAVLink first",
}


def judge_parameters(rules: Rules, values: Mapping[str, float | None]) -> list[Finding]:
    """Judge the values that the autopilot has given.

    Args:
        rules: what will do.
        values: by name; None, or no entry: the autopilot has given none.
    """
    return [_judge(name, wanted, values.get(name)) for name, wanted in rules.items()]


def _judge(name: str, wanted: Wanted, value: float | None) -> Finding:
    words = str(wanted)
    if words != _ANY:
        words += f"{_meant(name, wanted)}, {_REASONS.get(name, _SAME)}"
    if value is None:
        return judged(name, False, "not given by the autopilot", words, {"value": None})
    meaning = _MEANINGS.get(name, {}).get(int(value)) if math.isfinite(value) else None
    found = f"{value:g}" + (f" ({meaning})" if meaning else "")
    return judged(name, wanted.accepts(value), found, words, {"value": value if math.isfinite(value) else None})


def _meant(name: str, wanted: Wanted) -> str:
    meanings = _MEANINGS.get(name, {})
    if not isinstance(wanted, WantedChoice):
        return ""
    words = [meanings[value] for value in wanted.values if value in meanings]
    return f" ({', '.join(words)})" if words else ""


class ParameterGate:
    """Collects the answers of the autopilot, and says what stands against flying."""

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._values: dict[str, float | None] = {}

    def take(self, name: str, value: float | None) -> None:
        """Take an answer; None: the autopilot has given no value."""
        if name in self._rules:
            self._values[name] = value

    def forget(self) -> None:
        """Begin anew: it may be another autopilot, or the same with other values."""
        self._values.clear()

    @property
    def complete(self) -> bool:
        """Whether every parameter has been answered."""
        return len(self._values) == len(self._rules)

    def findings(self) -> list[Finding]:
        """Judge what has been answered so far."""
        return judge_parameters(self._rules, self._values)

    def objections(self) -> list[str]:
        """Say what stands against flying: each parameter's name, its value, and the wanted value."""
        return [
            f"{finding.check} is {finding.found}, wanted: {finding.wanted}"
            for finding in self.findings()
            if finding.verdict is not Verdict.FINE
        ]
