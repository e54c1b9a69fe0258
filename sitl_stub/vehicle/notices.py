"""What the autopilot says beside telemetry: STATUSTEXT for ground stations, EVENT for everyone."""

import struct
from dataclasses import dataclass
from functools import cache

from sitl_stub.vehicle.failsafe_actions import Action, Cause, Notification

EMERGENCY, CRITICAL, ERROR, WARNING, INFO, PROTOCOL = 0, 2, 3, 4, 6, 8


@cache
def number(name: str) -> int:
    """Number of an event of PX4's own: 1 in the top byte, then 24 bits of the name's 32-bit FNV-1a hash."""
    value = 0x811C9DC5
    for byte in name.encode():
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return 1 << 24 | value & 0xFFFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One message of the MAVLink events interface; numbers as PX4 v1.17 uses them."""

    number: int
    level: int
    """Level shown to users; `internal` is the level for the log."""
    internal: int
    arguments: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """A text, an event, or both."""

    severity: int = INFO
    text: str = ""
    event: Event | None = None


def event(name: str, level: int, internal: int | None = None, arguments: bytes = b"") -> Event:
    """An event by its name in PX4's source."""
    return Event(
        number=number(name), level=level, internal=level if internal is None else internal, arguments=arguments
    )


ARM_DENIED = Notice(
    severity=CRITICAL,
    text="Arming denied: Resolve system health failures first\t",
    event=event("commander_arm_denied_resolve_failures", CRITICAL, INFO),
)
ARM_DENIED_CALIBRATING = Notice(
    severity=CRITICAL,
    text="Arming denied: calibrating\t",
    event=event("commander_arm_denied_calibrating", CRITICAL, INFO),
)
DISARM_DENIED = Notice(
    severity=CRITICAL,
    text="Disarming denied: not landed\t",
    event=event("commander_disarm_denied_not_landed", CRITICAL, INFO),
)
TAKEOFF_DETECTED = Notice(text="Takeoff detected\t", event=event("commander_takeoff_detected", INFO))
LANDING_DETECTED = Notice(text="Landing detected\t", event=event("commander_landing_detected", INFO))
STICKS_TOOK_OVER = Notice(text="Pilot took over using sticks\t", event=event("commander_rc_override", INFO))
STICKS_ENDED_FAILSAFE = Notice(event=event("failsafe_rc_override", INFO))
STICKS_LOST = Notice(event=event("commander_rc_lost", INFO))
UNKNOWN_MAIN_MODE = Notice(
    severity=CRITICAL, text="Unsupported main mode\t", event=event("commander_unsupported_main_mode", ERROR)
)
UNKNOWN_AUTO_MODE = Notice(
    severity=CRITICAL, text="Unsupported auto mode\t", event=event("commander_unsupported_auto_mode", ERROR)
)
UNKNOWN_BASE_MODE = Notice(
    severity=CRITICAL, text="Unsupported base mode\t", event=event("commander_unsupported_base_mode", ERROR)
)
KILL_RELEASED = Notice(text="Kill disengaged\t", event=event("commander_kill_sw_disengaged", INFO))
GNSS_FUSION_STOPPED = Notice(event=event("check_estimator_gnss_fusion_stopped", INFO))
GNSS_FUSION_STARTED = Notice(event=event("check_estimator_gnss_fusion_started", INFO))
NO_SHUTDOWN = Notice(
    severity=CRITICAL,
    text="System does not support shutdown\t",
    event=event("commander_low_bat_shutdown_failed", EMERGENCY, ERROR),
)
RETURN_ASKED = Notice(text="Returning to launch\t", event=event("commander_rtl", INFO))
LANDING_ASKED = Notice(text="Landing at current position\t", event=event("commander_landing_current_pos", INFO))
PRECISION_LANDING_ASKED = Notice(text="Precision landing\t", event=event("commander_landing_prec_land", INFO))
RETURN_LANDS = Notice(text="RTL: land at destination\t", event=event("rtl_land_at_destination", INFO))


def killed(landed: bool) -> Notice:
    """The pilot's kill switch stops the motors."""
    severity = INFO if landed else CRITICAL
    return Notice(severity=severity, text="Kill engaged\t", event=event("commander_kill_sw_engaged", severity, INFO))


def sticks_regained(elapsed: float) -> Notice:
    """Stick positions arrive again after `elapsed` [s]."""
    return Notice(event=event("commander_rc_regained", INFO, arguments=struct.pack("<f", elapsed)))


def return_starts(altitude: float, height: float) -> Notice:
    """Return begins, at `altitude` [m] above sea level, `height` [m] above where it leads."""
    high, above = round(altitude), round(height)
    return Notice(
        text=f"RTL: start return at {high} m ({above} m above destination)\t",
        event=event("vrtl_return_at", INFO, arguments=struct.pack("<ii", high, above).rstrip(b"\0")),
    )


def unsupported_arm_parameter(value: float) -> Notice:
    """COMPONENT_ARM_DISARM with a first parameter that is neither 0 nor 1."""
    return Notice(
        severity=CRITICAL,
        text=f"Unsupported ARM_DISARM param: {value:.3f}\t",
        event=event("commander_unsupported_arm_disarm_param", ERROR, arguments=struct.pack("<f", value)),
    )


ARM_TEXTS = {
    1: "Armed by stick gesture\t",
    2: "Armed by RC switch\t",
    4: "Armed by external command\t",
}


def armed_by(reason: int) -> Notice:
    """Armed, with PX4's number of the reason (1: stick gesture, 2: switch, 4: external command)."""
    return Notice(text=ARM_TEXTS[reason], event=event("commander_armed_by", INFO, arguments=bytes([reason])))


DISARM_TEXTS = {
    1: "Disarmed by stick gesture\t",
    2: "Disarmed by RC switch\t",
    4: "Disarmed by external command\t",
    6: "Disarmed by landing\t",
    7: "Disarmed by auto preflight disarming\t",
    8: "Disarmed by kill-switch\t",
    14: "Disarmed by failsafe\t",
}


def disarmed_by(reason: int) -> Notice:
    """Disarmed, with PX4's number of the reason (as for arming; 6: landing, 7: no take-off in time, 8: kill)."""
    return Notice(text=DISARM_TEXTS[reason], event=event("commander_disarmed_by", INFO, arguments=bytes([reason])))


_DISENGAGED = frozenset({Action.DESCEND, Action.FALLBACK_ALTITUDE, Action.FALLBACK_STABILIZED})
_WARNINGS = {
    Cause.BATTERY_LOW: ("commander_failsafe_enter_low_bat", WARNING),
    Cause.BATTERY_CRITICAL: ("commander_failsafe_enter_crit_bat_warn", CRITICAL),
    Cause.BATTERY_EMERGENCY: ("commander_failsafe_enter_crit_low_bat_warn", EMERGENCY),
}


def failsafe_entered(notification: Notification) -> Notice:
    """A failsafe began or got worse (commander/failsafe/framework.cpp: notifyUser)."""
    action, cause = notification.action, notification.cause
    mode = struct.pack("<I", notification.intended.custom_mode)
    if action is Action.HOLD and notification.delayed is not Action.NONE:
        arguments = mode + struct.pack("<BH", notification.delayed, notification.delay)
        name = "commander_failsafe_enter_generic_hold"
        if cause is not Cause.GENERIC:
            name, arguments = "commander_failsafe_enter_hold", arguments + bytes([cause])
        return Notice(
            severity=CRITICAL,
            text=f"Failsafe activated: entering Hold for {notification.delay} seconds\t",
            event=event(name, CRITICAL, WARNING, arguments),
        )
    if action is Action.WARN:
        return Notice(event=_warning(cause, mode))
    if cause is not Cause.GENERIC:
        said = event("commander_failsafe_enter", CRITICAL, WARNING, mode + bytes([action, cause]))
    elif action in _DISENGAGED:
        said = event("commander_failsafe_enter_autopilot_disengaged", CRITICAL, WARNING, mode + bytes([action]))
    else:
        said = event("commander_failsafe_enter_generic", CRITICAL, WARNING, mode + bytes([action]))
    return Notice(severity=CRITICAL, text="Failsafe activated\t", event=said)


def _warning(cause: Cause, mode: bytes) -> Event:
    if cause in _WARNINGS:
        name, level = _WARNINGS[cause]
        return event(name, level, INFO)
    if cause is Cause.GENERIC:
        return event("commander_failsafe_enter_generic_warn", WARNING, arguments=mode)
    return event("commander_failsafe_enter_warn", WARNING, arguments=mode + bytes([cause]))


def mode_not_available(title: str, navigation_state: int) -> Notice:
    """A mode was asked for in flight that cannot run now."""
    arguments = bytes([0, 0, navigation_state + 1, 0, 2])
    return Notice(
        severity=CRITICAL,
        text=f"Switching to {title} is currently not available\t",
        event=event("commander_modeswitch_not_avail", CRITICAL, INFO, arguments),
    )


def text(severity: int, message: str) -> Notice:
    """A bare text."""
    return Notice(severity=severity, text=message + "\t")
