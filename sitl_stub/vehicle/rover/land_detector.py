"""PX4's rover land detector: on the ground when disarmed, when told to land, and when Return has arrived."""

from sitl_stub.vehicle.modes import Mode

LEAVE_TIME = 0.5
"""Time [s] after which an armed rover no longer counts as landed."""


class RoverLandDetector:
    """Holds the one stage a rover has."""

    __slots__ = ("_moving_for", "landed")

    def __init__(self) -> None:
        self.landed = True
        """Whether the rover counts as landed."""
        self._moving_for = 0.0

    def update(self, mode: Mode, *, armed: bool, home_distance: float, acceptance_radius: float, dt: float) -> bool:
        """Advance by `dt` [s]; distances in metres. Returns `landed`."""
        if mode in (Mode.AUTO_LAND, Mode.DESCEND):
            wanted = True
        elif mode is Mode.AUTO_RTL:
            wanted = home_distance < acceptance_radius
        else:
            wanted = not armed
        if wanted:
            self.landed, self._moving_for = True, 0.0
        elif self.landed:
            self._moving_for += dt
            self.landed = self._moving_for < LEAVE_TIME
        return self.landed
