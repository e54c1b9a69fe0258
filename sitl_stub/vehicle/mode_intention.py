"""The mode the user wants, and the one after disarming (commander/UserModeIntention.cpp of PX4 v1.17)."""

import math

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.modes import PREVENTS_ARMING, TITLES, Mode
from sitl_stub.vehicle.notices import Notice

REFUSAL_INTERVAL = 1.0
"""A refused mode is told at most once in so long [s]."""


class ModeIntention:
    """Remembers what was asked for."""

    def __init__(self) -> None:
        self.mode = Mode.AUTO_LOITER
        """The mode the user asked for last."""
        self.chosen = False
        """Whether anybody has asked for a mode since the boot."""
        self._after_disarm = Mode.AUTO_LOITER
        self._asked = False
        self._refused_at = -math.inf

    def change(self, mode: Mode) -> None:
        """A mode was asked for and may be."""
        self.mode = mode
        self._asked = self.chosen = True
        if (mode not in PREVENTS_ARMING and mode is not Mode.AUTO_TAKEOFF) or mode is Mode.TERMINATION:
            self._after_disarm = mode

    def take_asked(self) -> bool:
        """Whether a mode was asked for since the last call, the same one included."""
        asked, self._asked = self._asked, False
        return asked

    def disarmed(self) -> None:
        """Go back to the last mode in which the vehicle may be armed."""
        self.mode = self._after_disarm

    def refusal(self, mode: Mode, t: float) -> list[Notice]:
        """Say at `t` [s] that a mode cannot be had, unless one was refused just before."""
        if t - self._refused_at <= REFUSAL_INTERVAL:
            return []
        self._refused_at = t
        return [notices.mode_not_available(TITLES[mode], mode.navigation_state)]
