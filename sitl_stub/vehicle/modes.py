"""PX4's flight modes as MAVLink shows them, and what each needs."""

from enum import Enum


class Mode(Enum):
    """A mode; the value is PX4's (main mode, sub mode)."""

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

    @property
    def custom_mode(self) -> int:
        """`custom_mode` of HEARTBEAT."""
        main, sub = self.value
        return int(main) << 16 | int(sub) << 24

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
    }
)
NO_ARMING = frozenset({Mode.AUTO_RTL, Mode.AUTO_LAND, Mode.AUTO_PRECLAND})
"""Modes in which PX4 refuses to arm, and to which it does not return after disarming."""

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
    Mode.TERMINATION: "Termination",
}


def known_main_mode(main: int) -> bool:
    """Whether PX4 knows a mode of this main number."""
    return any(mode.value[0] == main for mode in Mode)


def find_mode(main: int, sub: int) -> Mode | None:
    """Return the mode of DO_SET_MODE's numbers; None when there is none. The sub mode counts in AUTO only."""
    for mode in Mode:
        if mode.value[0] == main and (main != 4 or mode.value[1] == sub):
            return mode
    return None
