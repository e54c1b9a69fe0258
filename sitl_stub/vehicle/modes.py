"""PX4's flight modes as MAVLink shows them, and what each needs."""

from enum import Enum


class Mode(Enum):
    """A mode; the value begins with PX4's (main mode, sub mode) of `custom_mode`."""

    MANUAL = (1, 0)
    ALTCTL = (2, 0)
    POSCTL = (3, 0)
    AUTO_TAKEOFF = (4, 2)
    AUTO_LOITER = (4, 3)
    AUTO_MISSION = (4, 4)
    AUTO_RTL = (4, 5)
    AUTO_LAND = (4, 6)
    AUTO_PRECLAND = (4, 9)
    ACRO = (5, 0)
    OFFBOARD = (6, 0)
    STABILIZED = (7, 0)
    TERMINATION = (10, 0)
    DESCEND = (4, 6, "descend")
    """Failsafe without a position: sinks with level attitude. On MAVLink it cannot be told from AUTO_LAND."""

    @property
    def main(self) -> int:
        """PX4's main mode number."""
        return int(self.value[0])

    @property
    def sub(self) -> int:
        """PX4's sub mode number (AUTO only, otherwise 0)."""
        return int(self.value[1])

    @property
    def custom_mode(self) -> int:
        """`custom_mode` of HEARTBEAT."""
        return self.main << 16 | self.sub << 24

    @property
    def navigation_state(self) -> int:
        """PX4's internal number of the mode, as it appears in events."""
        return NAVIGATION_STATES[self]


NAVIGATION_STATES = {
    Mode.MANUAL: 0,
    Mode.ALTCTL: 1,
    Mode.POSCTL: 2,
    Mode.AUTO_MISSION: 3,
    Mode.AUTO_LOITER: 4,
    Mode.AUTO_RTL: 5,
    Mode.ACRO: 10,
    Mode.DESCEND: 12,
    Mode.TERMINATION: 13,
    Mode.OFFBOARD: 14,
    Mode.STABILIZED: 15,
    Mode.AUTO_TAKEOFF: 17,
    Mode.AUTO_LAND: 18,
    Mode.AUTO_PRECLAND: 20,
}

NEEDS_STICKS = frozenset({Mode.MANUAL, Mode.ALTCTL, Mode.POSCTL, Mode.ACRO, Mode.STABILIZED})
AUTO = frozenset(
    {
        Mode.AUTO_TAKEOFF,
        Mode.AUTO_LOITER,
        Mode.AUTO_MISSION,
        Mode.AUTO_RTL,
        Mode.AUTO_LAND,
        Mode.AUTO_PRECLAND,
        Mode.DESCEND,
    }
)
PREVENTS_ARMING = frozenset({Mode.AUTO_RTL, Mode.AUTO_LAND, Mode.AUTO_PRECLAND, Mode.DESCEND, Mode.TERMINATION})
"""Modes in which PX4 refuses to arm; it does not return to them after disarming (TERMINATION excepted)."""

# What PX4 asks of the estimate and of others before a mode may run (commander/ModeUtil/mode_requirements.cpp).
NEEDS_POSITION = frozenset(
    {
        Mode.POSCTL,
        Mode.AUTO_TAKEOFF,
        Mode.AUTO_LOITER,
        Mode.AUTO_MISSION,
        Mode.AUTO_RTL,
        Mode.AUTO_LAND,
        Mode.AUTO_PRECLAND,
    }
)
NEEDS_GLOBAL_POSITION = frozenset({Mode.AUTO_LOITER, Mode.AUTO_MISSION, Mode.AUTO_RTL})
NEEDS_HOME = frozenset({Mode.AUTO_RTL})
NEEDS_ALTITUDE = NEEDS_POSITION | {Mode.ALTCTL}
NEEDS_SETPOINTS = frozenset({Mode.OFFBOARD})
NEEDS_MISSION = frozenset({Mode.AUTO_MISSION})

TITLES = {
    Mode.MANUAL: "Manual",
    Mode.ALTCTL: "Altitude",
    Mode.POSCTL: "Position",
    Mode.AUTO_TAKEOFF: "Takeoff",
    Mode.AUTO_LOITER: "Hold",
    Mode.AUTO_MISSION: "Mission",
    Mode.AUTO_RTL: "Return",
    Mode.AUTO_LAND: "Land",
    Mode.AUTO_PRECLAND: "Precision Landing",
    Mode.ACRO: "Acro",
    Mode.OFFBOARD: "Offboard",
    Mode.STABILIZED: "Stabilized",
    Mode.DESCEND: "Descend",
    Mode.TERMINATION: "Termination",
}

MODE_SLOT_VALUES = {
    0: Mode.MANUAL,
    1: Mode.ALTCTL,
    2: Mode.POSCTL,
    3: Mode.AUTO_MISSION,
    4: Mode.AUTO_LOITER,
    5: Mode.AUTO_RTL,
    6: Mode.ACRO,
    7: Mode.OFFBOARD,
    8: Mode.STABILIZED,
    10: Mode.AUTO_TAKEOFF,
    11: Mode.AUTO_LAND,
    13: Mode.AUTO_PRECLAND,
}
"""Values of COM_FLTMODE1 to COM_FLTMODE6 (manual_control/ManualControl.cpp); others leave the mode as it is."""


def known_main_mode(main: int) -> bool:
    """Whether PX4 knows a mode of this main number."""
    return any(mode.main == main for mode in Mode)


def find_mode(main: int, sub: int) -> Mode | None:
    """Return the mode of DO_SET_MODE's numbers; None when there is none. The sub mode counts in AUTO only."""
    for mode in Mode:
        if mode.main == main and (main != Mode.AUTO_LOITER.main or mode.sub == sub):
            return mode
    return None
