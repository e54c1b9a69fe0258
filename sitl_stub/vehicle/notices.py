"""What the autopilot says beside telemetry: STATUSTEXT for ground stations, EVENT for everyone."""

from dataclasses import dataclass

CRITICAL, ERROR, WARNING, INFO, PROTOCOL = 2, 3, 4, 6, 8


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


ARM_DENIED = Notice(
    severity=CRITICAL,
    text="Arming denied: Resolve system health failures first\t",
    event=Event(number=16910493, level=CRITICAL, internal=INFO),
)
DISARM_DENIED = Notice(
    severity=CRITICAL,
    text="Disarming denied: not landed\t",
    event=Event(number=25868725, level=CRITICAL, internal=INFO),
)
TAKEOFF_DETECTED = Notice(text="Takeoff detected\t", event=Event(number=21054825, level=INFO, internal=INFO))
LANDING_DETECTED = Notice(text="Landing detected\t", event=Event(number=26622124, level=INFO, internal=INFO))
STICKS_TOOK_OVER = Notice(
    text="Pilot took over using sticks\t", event=Event(number=18523838, level=INFO, internal=INFO)
)
STICKS_LOST = Notice(text="Manual control lost\t", event=Event(number=22400324, level=INFO, internal=INFO))
UNKNOWN_MAIN_MODE = Notice(
    severity=CRITICAL, text="Unsupported main mode\t", event=Event(number=19545959, level=ERROR, internal=ERROR)
)
UNKNOWN_AUTO_MODE = Notice(
    severity=CRITICAL, text="Unsupported auto mode\t", event=Event(number=19869445, level=ERROR, internal=ERROR)
)
UNKNOWN_BASE_MODE = Notice(
    severity=CRITICAL, text="Unsupported base mode\t", event=Event(number=26932459, level=ERROR, internal=ERROR)
)


def armed_by(reason: int) -> Notice:
    """Armed, with PX4's number of the reason (4: external command)."""
    return Notice(
        text="Armed by external command\t",
        event=Event(number=26266355, level=INFO, internal=INFO, arguments=bytes([reason])),
    )


DISARM_TEXTS = {
    4: "Disarmed by external command\t",
    6: "Disarmed by landing\t",
    7: "Disarmed by auto preflight disarming\t",
}


def disarmed_by(reason: int) -> Notice:
    """Disarmed, with PX4's number of the reason (4: external command, 6: landing, 7: no take-off in time)."""
    return Notice(
        text=DISARM_TEXTS[reason],
        event=Event(number=32794487, level=INFO, internal=INFO, arguments=bytes([reason])),
    )


def failsafe_to(navigation_state: int) -> Notice:
    """A failsafe switched to another mode."""
    arguments = bytes([0, 0, 6, 0, navigation_state + 1])
    return Notice(
        severity=CRITICAL,
        text="Failsafe activated\t",
        event=Event(number=31382480, level=CRITICAL, internal=WARNING, arguments=arguments),
    )


def mode_not_available(title: str, navigation_state: int) -> Notice:
    """A mode was asked for in flight that cannot run now."""
    arguments = bytes([0, 0, navigation_state + 1, 0, 2])
    return Notice(
        severity=CRITICAL,
        text=f"Switching to {title} is currently not available\t",
        event=Event(number=27280279, level=CRITICAL, internal=INFO, arguments=arguments),
    )


def text(severity: int, message: str) -> Notice:
    """A bare text."""
    return Notice(severity=severity, text=message + "\t")
