"""Why the autopilot does not arm: its arming check report, put into words.

PX4 reports its checks as EVENT messages between a "commander_arming_check_summary" and a "commander_health_summary",
and only when something has changed. So on a refusal the link asks for a fresh report (RUN_PREARM_CHECKS) and waits
for it a moment. The first four bytes of a check's arguments are a mask of the modes that it blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

from companion.link import incoming
from companion.link.commands import result_text
from companion.link.event_names import event_name, event_text
from companion.link.events import ArmingRefused, AutopilotEvent
from companion.link.modes import mode_group_bit
from companion.messages.ownship import FlightMode

_ALL_MODES = 0xFFFFFFFF
_WARNING, _PROTOCOL = 4, 8
_EVENTS_KEPT = 64
_PREARM_BIT = 1 << 28

TRANSMITTER = "remote control receiver"
_SENSORS = (
    "gyroscope",
    "accelerometer",
    "magnetometer",
    "barometer",
    "airspeed sensor",
    "GPS",
    "optical flow",
    "vision position",
    "laser position",
    "external ground truth",
    "angular rate control",
    "attitude stabilisation",
    "yaw position",
    "altitude control",
    "horizontal position control",
    "motor outputs",
    TRANSMITTER,
    "second gyroscope",
    "second accelerometer",
    "second magnetometer",
    "geofence",
    "attitude estimate",
    "terrain",
    "reverse motor",
    "logging",
    "battery",
    "proximity sensor",
    "satellite communication",
    "pre-arm checks",
    "obstacle avoidance",
    "propulsion",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmingParameters:
    """How long the reasons of a refusal are collected."""

    collect: Annotated[float, Gt(0.0)] = 0.6  # [s] after the refusal


def unhealthy_sensors(status: incoming.SysStatus) -> tuple[str, ...]:
    """Give the plain names of what SYS_STATUS says is enabled and not healthy; the pre-arm bit is always looked at."""
    bits = (status.enabled | _PREARM_BIT) & ~status.health
    return tuple(name for index, name in enumerate(_SENSORS) if bits >> index & 1)


def transmitter_heard(status: incoming.SysStatus) -> bool:
    """Tell whether sticks are heard: PX4 says "present" only then (rcAndDataLinkCheck.cpp)."""
    bit = 1 << _SENSORS.index(TRANSMITTER)
    return bool(status.present & status.health & bit)


class RefusalCollector:
    """Keeps the newest arming check report, and makes of it the reasons of a refusal."""

    def __init__(self, parameters: ArmingParameters) -> None:
        self._parameters = parameters
        self._report: dict[int, incoming.Event] = {}
        self._denials: dict[int, incoming.Event] = {}
        self._texts: list[str] = []
        self._t_refused: float | None = None
        self._result: int | None = None
        self._reported_anew = False

    def requested(self) -> None:
        """An arm command goes out: what is said from now on belongs to it."""
        self._denials.clear()
        self._texts.clear()
        self._t_refused = None

    def refused(self, result: int | None, t: float) -> None:
        """The arm command was refused."""
        self._t_refused = t
        self._result = result
        self._reported_anew = False

    def take_text(self, text: str) -> None:
        """Take a STATUSTEXT."""
        if len(self._texts) < _EVENTS_KEPT:
            self._texts.append(text)

    def take_event(self, event: incoming.Event) -> None:
        """Take an EVENT."""
        name = event_name(event.id)
        if name == "commander_arming_check_summary":
            self._report.clear()
        elif name == "commander_health_summary":
            self._reported_anew = True
        elif name is not None and name.startswith("commander_arm_denied"):
            self._denials[event.id] = event
        elif name is not None and name.startswith("check_") and len(self._report) < _EVENTS_KEPT:
            self._report[event.id] = event
        elif name is None and event.log_level <= _WARNING and len(self._denials) < _EVENTS_KEPT:
            self._denials[event.id] = event

    def due(self, t: float, status: incoming.SysStatus | None, mode: FlightMode) -> ArmingRefused | None:
        """Give the refusal once its reasons have come, or the time for them is over."""
        if self._t_refused is None:
            return None
        complete = self._reported_anew and self._denials
        if not complete and t - self._t_refused < self._parameters.collect:
            return None
        self._t_refused = None
        failed = [event for event in self._report.values() if event.log_level <= _WARNING]
        # A refusal that no check of this mode explains is explained by all that have failed.
        blocking = [event for event in self._report.values() if _concerns(event, mode)] or failed
        events = sorted((*self._denials.values(), *blocking), key=_severity)
        return ArmingRefused(
            t=t,
            result=result_text(self._result),
            unhealthy=() if status is None else unhealthy_sensors(status),
            autopilot_events=tuple(_describe(event) for event in events),
            status_texts=tuple(self._texts),
        )


def _concerns(event: incoming.Event, mode: FlightMode) -> bool:
    modes = int.from_bytes(event.arguments[:4], "little")
    if modes == _ALL_MODES:  # PX4 marks checks that block nothing this way too
        return event.log_level <= _WARNING
    return event.log_level < _PROTOCOL and bool(modes & mode_group_bit(mode))


def _severity(event: incoming.Event) -> tuple[bool, int, bool, int]:
    """Order: checks by level, what has a name first; the general denial, which says nothing new, comes last."""
    name = event_name(event.id)
    general = name is not None and name.startswith("commander_")
    return general, event.log_level, name is None, event.sequence


def _describe(event: incoming.Event) -> AutopilotEvent:
    name = event_name(event.id)
    return AutopilotEvent(id=event.id, name=name, text=event_text(name), log_level=event.log_level)
