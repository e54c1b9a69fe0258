"""Take-off and landing as the commander sees them, and the disarming that follows (Commander::handleAutoDisarm)."""

from collections.abc import Mapping

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.system_state import BY_LANDING, BY_PREFLIGHT_TIMEOUT


class LandingWatch:
    """Follows the land detector; times are simulation time [s]."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.landed = True
        self._has_flown = False
        self._landed_since = self._armed_since = 0.0

    def armed(self, t: float) -> None:
        """The vehicle has been armed at `t`."""
        self._armed_since, self._has_flown = t, False

    def update(self, t: float, *, landed: bool, armed: bool) -> list[Notice]:
        """Take the land detector's word at `t`; gives what is to be said."""
        said = []
        if landed and not self.landed:
            self._landed_since = t
            if armed:
                said.append(notices.LANDING_DETECTED)
        elif not landed and self.landed:
            self._has_flown = True
            said.append(notices.TAKEOFF_DETECTED)
        self.landed = landed
        return said

    def disarm_reason(self, t: float) -> int | None:
        """Why an armed vehicle is to be disarmed at `t`: it has landed (COM_DISARM_LAND) or never took off."""
        if not self.landed:
            return None
        since, setting, reason = (
            (self._landed_since, "COM_DISARM_LAND", BY_LANDING)
            if self._has_flown
            else (self._armed_since, "COM_DISARM_PRFLT", BY_PREFLIGHT_TIMEOUT)
        )
        wait = self._parameters[setting]
        return reason if wait > 0.0 and t - since >= wait else None
