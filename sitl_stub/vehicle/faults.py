"""Faults that can be put into the autopilot, at the start or in flight, to see how a companion takes them.

A fault is a word, `NAME`, `NAME=VALUE` or either with `@SECONDS` behind it (simulation time at which it happens).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sitl_stub.truth import Vector
from sitl_stub.vehicle.notices import CRITICAL, ERROR, Event, number

VEHICLE_TYPES = {"multirotor": 2, "fixed_wing": 1, "rover": 10, "vtol": 22, "helicopter": 4}
"""MAV_TYPE of HEARTBEAT."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthProblem:
    """Something that PX4 would refuse to arm for."""

    text: str
    """STATUSTEXT for ground stations."""
    event: Event
    """EVENT that names it."""
    sensor_bit: int
    """Bit of SYS_STATUS.onboard_control_sensors_health that goes out."""


def _problem(text: str, name: str, level: int, arguments: str, sensor_bit: int) -> HealthProblem:
    event = Event(number=number(name), level=level, internal=level, arguments=bytes.fromhex(arguments))
    return HealthProblem(text=f"Preflight Fail: {text}", event=event, sensor_bit=sensor_bit)


HEALTH_PROBLEMS = {
    "gps": _problem("GPS fix too low", "check_estimator_gps_fix_too_low", ERROR, "7ed17e0003", 0x20),
    "heading": _problem(
        "heading estimate not stable", "check_estimator_heading_not_stable", ERROR, "7ed17e0011", 0x4000
    ),
    "position": _problem("No valid position estimate", "check_modes_local_pos", ERROR, "7ed17e0011", 0x4000),
    "battery": _problem("Low battery", "check_battery_low", CRITICAL, "ffffffff0b", 0x2000000),
}


class FaultError(ValueError):
    """A fault that the simulator does not know."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault, read from its word."""

    name: str
    value: str | float | Vector | None = None
    t: float = 0.0
    """Simulation time [s] at which it happens; 0: at once."""

    @classmethod
    def parse(cls, word: str) -> "Fault":
        """Read one fault.

        Raises `FaultError` for anything that is none; the message lists what there is.
        """
        stem, at, when = word.partition("@")
        name, equals, value = stem.partition("=")
        try:
            t = float(when) if at else 0.0
            read = _READERS[name](value) if equals or value else _READERS[name]("")
        except (KeyError, ValueError):
            raise FaultError(f"unknown fault {word!r}; known: {KNOWN}") from None
        if not math.isfinite(t) or t < 0.0:
            raise FaultError(f"fault {word!r} at a time that is none; the time after @ is seconds, from 0 on")
        return cls(name=name, value=read, t=t)


def _nothing(value: str) -> None:
    if value:
        raise ValueError(value)


def _one_of(choices: Sequence[str], default: str = "") -> Callable[[str], str]:
    def read(value: str) -> str:
        chosen = value or default
        if chosen not in choices:
            raise ValueError(value)
        return chosen

    return read


def _number(low: float, high: float) -> Callable[[str], float]:
    def read(value: str) -> float:
        amount = float(value)
        if not low <= amount <= high:
            raise ValueError(value)
        return amount

    return read


def _vector(value: str) -> Vector:
    north, east, down = (float(part) for part in value.split(","))
    if not all(map(math.isfinite, (north, east, down))):
        raise ValueError(value)
    return (north, east, down)


_READERS: dict[str, Callable[[str], str | float | Vector | None]] = {
    "no_heartbeat": _nothing,
    "refuse_arming": _one_of(tuple(HEALTH_PROBLEMS), "gps"),
    "vehicle_type": _one_of(tuple(VEHICLE_TYPES)),
    "gnss_lost": _nothing,
    "gnss_back": _nothing,
    "vision_lost": _nothing,
    "vision_back": _nothing,
    "position_jump": _vector,
    "heading_jump": _number(-180.0, 180.0),
    "battery": _number(0.0, 100.0),
    "kill": _nothing,
    "unkill": _nothing,
    "reboot": _nothing,
}
KNOWN = (
    "no_heartbeat, "
    f"refuse_arming=({'|'.join(HEALTH_PROBLEMS)}), vehicle_type=({'|'.join(VEHICLE_TYPES)}), gnss_lost, gnss_back, "
    "vision_lost, vision_back, "
    "position_jump=NORTH,EAST,DOWN [m], heading_jump=DEGREES, battery=PERCENT, kill, unkill, reboot; "
    "each with @SECONDS behind it if it shall happen later"
)


@dataclass(slots=True, kw_only=True)
class Faults:
    """Lasting faults that are in force."""

    refuse_arming: HealthProblem | None = None
    heartbeat: bool = True
    vehicle_type: int | None = None
    """MAV_TYPE that HEARTBEAT pretends; None: the vehicle's own."""
    gnss: bool = True
    vision: bool = True
    """External vision arrives, on a vehicle that flies on it."""

    @classmethod
    def parse(cls, words: Sequence[str]) -> "Faults":
        """Read faults and return those that are in force from the start.

        Raises `FaultError` for a word that is no fault; the message lists what there is.
        """
        faults = cls()
        for fault in map(Fault.parse, words):
            if fault.t == 0.0:
                faults.apply(fault)
        return faults

    def apply(self, fault: Fault) -> bool:
        """Put a lasting fault in force; False when it is an incident and none of these."""
        if fault.name == "no_heartbeat":
            self.heartbeat = False
        elif fault.name == "refuse_arming":
            self.refuse_arming = HEALTH_PROBLEMS[str(fault.value)]
        elif fault.name == "vehicle_type":
            self.vehicle_type = VEHICLE_TYPES[str(fault.value)]
        elif fault.name in ("gnss_lost", "gnss_back"):
            self.gnss = fault.name == "gnss_back"
        elif fault.name in ("vision_lost", "vision_back"):
            self.vision = fault.name == "vision_back"
        else:
            return False
        return True
