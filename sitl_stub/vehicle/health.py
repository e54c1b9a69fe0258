"""PX4's health and arming checks: what speaks against arming in which mode, and how it is reported.

Order, numbers, levels and texts as recorded from PX4 v1.17 (commander/HealthAndArmingChecks).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.failsafe_actions import FailsafeFlags
from sitl_stub.vehicle.faults import HealthProblem
from sitl_stub.vehicle.modes import (
    NEEDS_ALTITUDE,
    NEEDS_GLOBAL_POSITION,
    NEEDS_HOME,
    NEEDS_MISSION,
    NEEDS_POSITION,
    NEEDS_SETPOINTS,
    NEEDS_STICKS,
    PREVENTS_ARMING,
    Mode,
)
from sitl_stub.vehicle.notices import CRITICAL, EMERGENCY, ERROR, INFO, PROTOCOL, WARNING, Event, Notice

REPORT_INTERVAL = 2.0
"""Shortest time [s] between two reports that nobody asked for."""
ALL_MODES = frozenset(Mode)
NO_MODES: frozenset[Mode] = frozenset()
SUMMARY_CAN_ARM = bytes.fromhex("000000100080000000b03a7f80b03a7f80")
SUMMARY_CANNOT_ARM = bytes.fromhex("000000120180000000802a0180803a0180")
HEALTH_GOOD, HEALTH_BAD = bytes.fromhex("000a1c0238"), bytes.fromhex("00020c0238")
GEOFENCE_TEXTS = {
    "distance": ("check_gf_violation_max_hor_dist", "Geofence: exceeding maximum distance to Home"),
    "altitude": ("check_gf_violation_max_alt", "Geofence: exceeding maximum altitude above Home"),
}
BATTERY_CHECKS = {
    1: ("check_battery_low", CRITICAL, "Low battery\t"),
    2: ("check_battery_critical", CRITICAL, "Critical battery\t"),
    3: ("check_battery_emergency", EMERGENCY, "Emergency battery level\t"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One failed check."""

    event: Event
    modes: frozenset[Mode]
    """Modes in which it prevents arming."""
    text: str = ""
    """STATUSTEXT that goes with it, if any."""
    severity: int = CRITICAL


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What the checks look at besides the flags."""

    flags: FailsafeFlags
    intended: Mode
    terminated: bool
    """Whether flight termination is in force."""
    armed: bool
    heading_stable: bool
    gnss_missing: bool
    geofence: str
    """Which limit is breached: "distance", "altitude" or ""."""
    charge: float
    """Reported charge of the battery, 0 to 1."""
    problem: HealthProblem | None


def _check(name: str, arguments: str, level: int, modes: frozenset[Mode], text: str = "") -> Check:
    event = Event(number=notices.number(name), level=level, internal=level, arguments=bytes.fromhex(arguments))
    return Check(event=event, modes=modes, text=text, severity=level if text else CRITICAL)


HEADING = _check(
    "check_estimator_heading_not_stable", "7ed17e0011", ERROR, ALL_MODES, "Preflight Fail: heading estimate not stable"
)
GNSS_FIX = _check("check_estimator_gps_fix_too_low", "7c007e0003", WARNING, NO_MODES, "Preflight: GPS fix too low")
CANNOT_TAKE_OFF = _check("check_modes_cannot_takeoff", "20303c0014", INFO, PREVENTS_ARMING)
POSITION = _check("check_modes_local_pos", "7c007e0011", ERROR, NEEDS_POSITION)
GLOBAL_POSITION = _check("check_modes_global_pos", "3800000018", ERROR, NEEDS_GLOBAL_POSITION)
ALTITUDE = _check("check_modes_local_alt", "7e007e0014", CRITICAL, NEEDS_ALTITUDE)
MISSION = _check("check_modes_mission", "0800000014", INFO, NEEDS_MISSION)
SETPOINTS = _check("check_modes_offboard_signal", "0040000014", ERROR, NEEDS_SETPOINTS)
HOME = _check("check_modes_home_position", "2000000014", INFO, NEEDS_HOME)
STICKS = _check("check_modes_manual_control", "ffffffff07", WARNING, NEEDS_STICKS)
GROUND_STATION = _check("check_rc_dl_no_dllink", "ffffffff0c", INFO, NO_MODES)
TERMINATED = _check(
    "check_system_flight_term_active", "ffffffff14", CRITICAL, ALL_MODES, "Preflight Fail: Flight termination active"
)


def failed_checks(condition: Condition, parameters: Mapping[str, float]) -> list[Check]:
    """All failed checks in PX4's order, also those that do not prevent arming in the present mode."""
    flags, found = condition.flags, []
    if condition.problem is not None:
        found.append(Check(event=condition.problem.event, modes=ALL_MODES, text=condition.problem.text))
    if not condition.heading_stable:
        found.append(Check(event=HEADING.event, modes=ALL_MODES, text=HEADING.text, severity=CRITICAL))
    if condition.gnss_missing and not condition.armed:
        found.append(GNSS_FIX)
    if condition.intended in PREVENTS_ARMING and not condition.armed:
        found.append(CANNOT_TAKE_OFF)
    for failed, check in (
        (flags.position_invalid, POSITION),
        (flags.global_position_invalid, GLOBAL_POSITION),
        (flags.altitude_invalid, ALTITUDE),
        (flags.mission_missing, MISSION),
        (flags.offboard_signal_lost, SETPOINTS),
        (flags.home_invalid, HOME),
        (flags.manual_control_lost, STICKS),
        (flags.ground_station_lost, _ground_station(parameters)),
    ):
        if failed:
            found.append(check)
    if condition.geofence and int(parameters["GF_ACTION"]):
        name, text = GEOFENCE_TEXTS[condition.geofence]
        event = Event(number=notices.number(name), level=ERROR, internal=ERROR, arguments=bytes.fromhex("ffffffff14"))
        found.append(Check(event=event, modes=ALL_MODES, text=text))
    found.extend(_battery(condition, parameters["COM_ARM_BAT_MIN"]))
    if condition.terminated:
        found.append(TERMINATED)
    return found


def _ground_station(parameters: Mapping[str, float]) -> Check:
    if not int(parameters["NAV_DLL_ACT"]):
        return GROUND_STATION
    return _check("check_rc_dl_no_dllink", "ffffffff0c", ERROR, ALL_MODES, "Preflight Fail: No connection to the GCS")


def _battery(condition: Condition, needed: float) -> list[Check]:
    """Critical and emergency prevent arming, low does not; COM_ARM_BAT_MIN (0 to 1) replaces that when it is set."""
    warning = condition.flags.battery_warning
    chosen = needed >= 0.0 and not condition.armed
    below = chosen and condition.charge < needed
    if not warning and not below:
        return []
    name, level, text = BATTERY_CHECKS[max(warning, 1)]
    prevents = below or (not chosen and warning > 1)
    return [_check(name, "ffffffff0b", level, ALL_MODES if prevents else NO_MODES, text)]


def can_arm(checks: list[Check], mode: Mode) -> bool:
    """Whether no check prevents arming in `mode`."""
    return not any(mode in check.modes for check in checks)


def events(checks: list[Check], mode: Mode) -> list[Notice]:
    """The checks as PX4 reports them: a summary, each check, a health summary."""
    good = can_arm(checks, mode)
    summary = SUMMARY_CAN_ARM if good else SUMMARY_CANNOT_ARM
    said = [
        Event(
            number=notices.number("commander_arming_check_summary"),
            level=PROTOCOL,
            internal=PROTOCOL,
            arguments=summary,
        ),
        *(check.event for check in checks),
        Event(
            number=notices.number("commander_health_summary"),
            level=PROTOCOL,
            internal=PROTOCOL,
            arguments=HEALTH_GOOD if good else HEALTH_BAD,
        ),
    ]
    return [Notice(event=event) for event in said]


class HealthReporter:
    """Decides when the checks are reported: on a change, but not more often than every two seconds.

    The first two seconds after the boot at `booted_at` [s] count as if a report had just been made.
    """

    def __init__(self, booted_at: float) -> None:
        self._last = booted_at
        self._seen: tuple[object, ...] | None = None
        self._pending = False

    def update(self, t: float, checks: list[Check], mode: Mode, *, force: bool = False) -> list[Notice]:
        """Notices to send at `t` [s], texts included; `force` also reports what has not changed."""
        seen = (*(check.event.number for check in checks), can_arm(checks, mode))
        self._pending |= seen != self._seen
        self._seen = seen
        if not force and (not self._pending or t < self._last + REPORT_INTERVAL):
            return []
        texts = [Notice(severity=check.severity, text=check.text) for check in checks if check.text]
        return self._send(t, checks, mode) + texts

    def flush(self, t: float, checks: list[Check], mode: Mode) -> list[Notice]:
        """Events of a change that has not been reported yet (before a failsafe is announced); no texts."""
        return self._send(t, checks, mode) if self._pending else []

    def _send(self, t: float, checks: list[Check], mode: Mode) -> list[Notice]:
        self._last, self._pending = t, False
        return events(checks, mode)
