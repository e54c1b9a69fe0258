"""Take-off ramp and hover thrust estimate around the position controller, as in PX4's mc_pos_control."""

from collections.abc import Mapping
from enum import IntEnum

from sitl_stub.vehicle.rigid_body import GRAVITY

STATE_DELAY = 0.02
"""From arming until the first cycle in which the controller knows it [s]: the commander's loop, and its own."""


class TakeoffState(IntEnum):
    """PX4's take-off states."""

    DISARMED = 1
    SPOOL_UP = 2
    READY = 3
    RAMP_UP = 4
    FLIGHT = 5


class Takeoff:
    """Spool up, wait for a setpoint that wants to climb, then raise the allowed climb rate over the ramp time."""

    __slots__ = ("_armed_for", "_ramp_time", "_spool_up_time", "_start_rate", "progress", "state")

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.state = TakeoffState.DISARMED
        self.progress = 0.0
        self._armed_for = -STATE_DELAY
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over times from the autopilot's parameters."""
        self._spool_up_time = parameters["COM_SPOOLUP_TIME"]
        self._ramp_time = parameters["MPC_TKO_RAMP_T"]
        self._start_rate = -GRAVITY / max(parameters["MPC_Z_VEL_P_ACC"], 0.01)

    def update(self, *, armed: bool, landed: bool, wanted: bool, dt: float) -> TakeoffState:
        """Advance by `dt` [s]; `wanted`: the present setpoint asks to climb."""
        self._armed_for = self._armed_for + dt if armed else -STATE_DELAY
        if not armed:
            self.state = TakeoffState.DISARMED
            return self.state
        if self.state == TakeoffState.DISARMED:
            self.state = TakeoffState.SPOOL_UP
        if self.state == TakeoffState.SPOOL_UP and self._armed_for >= self._spool_up_time:
            self.state = TakeoffState.READY
        if self.state == TakeoffState.READY and wanted:
            self.state = TakeoffState.RAMP_UP
            self.progress = 0.0
        if self.state == TakeoffState.RAMP_UP and self.progress >= 1.0:
            self.state = TakeoffState.FLIGHT
        if self.state == TakeoffState.FLIGHT and landed:
            self.state = TakeoffState.READY
        return self.state

    def skip(self) -> None:
        """Count as flying at once (modes without altitude control)."""
        self.state = TakeoffState.FLIGHT

    def climb_limit(self, climb_max: float, dt: float) -> float:
        """Climb rate [m/s] the controller may ask for now; starts so low that the thrust is zero."""
        if self.state < TakeoffState.RAMP_UP:
            return self._start_rate
        if self.state == TakeoffState.RAMP_UP:
            self.progress = self.progress + dt / self._ramp_time if self._ramp_time > dt else 1.0
            if self.progress < 1.0:
                return self._start_rate + self.progress * (climb_max - self._start_rate)
        return climb_max


class HoverThrust:
    """Estimate of the thrust that holds the vehicle: thrust over specific force, low-passed while flying.

    thrust_hover = thrust * g / (g - a_down), a_down from the estimated velocity.
    """

    __slots__ = ("value",)

    TIME_CONSTANT = 4.0
    """Of the low-pass [s]."""

    def __init__(self, start: float) -> None:
        self.value = start

    def update(self, thrust: float, acceleration_down: float, dt: float) -> float:
        """Take one sample; `thrust` 0 to 1 along the vertical, `acceleration_down` [m/s^2]."""
        felt = GRAVITY - acceleration_down
        if felt > 0.3 * GRAVITY:
            sample = max(0.1, min(0.9, thrust * GRAVITY / felt))
            self.value += (sample - self.value) * min(1.0, dt / self.TIME_CONSTANT)
        return self.value
