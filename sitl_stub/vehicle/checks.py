"""What the commander looks at: signals, estimate, battery, fence; what of it is wrong, and who is told."""

import math
from collections.abc import Mapping

from sitl_stub.vehicle import geofence, health
from sitl_stub.vehicle.failsafe_actions import FailsafeFlags
from sitl_stub.vehicle.faults import Faults, HealthProblem
from sitl_stub.vehicle.ground_link import HEARTBEAT_TIMEOUT
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.system_state import Surroundings


class Checks:
    """PX4's health and arming checks; times are simulation time [s], `booted_at` is that of the last boot."""

    def __init__(
        self, parameters: Mapping[str, float], faults: Faults, surroundings: Surroundings, booted_at: float
    ) -> None:
        self._parameters = parameters
        self._faults = faults
        self._surroundings = surroundings
        self._booted_at = booted_at
        self._reporter = health.HealthReporter(booted_at)
        self._failed: list[health.Check] = []
        self._setpoint_time = -math.inf
        self._setpoint_needs = (False, False, False)
        self._ground_station_time = -math.inf
        self.flags = FailsafeFlags()
        self.can_arm = False
        """Whether arming would be accepted now."""

    @property
    def problem(self) -> HealthProblem | None:
        """The health problem that a fault has put in."""
        return self._faults.refuse_arming

    @property
    def ever_had_setpoint(self) -> bool:
        """Whether a setpoint has arrived since the boot."""
        return self._setpoint_time > -math.inf

    def setpoint_arrived(self, t: float, needs: tuple[bool, bool, bool]) -> None:
        """An offboard setpoint that counts has come; whether it sets position, velocity, acceleration."""
        self._setpoint_time, self._setpoint_needs = t, needs

    def ground_station_heard(self, t: float) -> None:
        """A ground station's heartbeat has come."""
        self._ground_station_time = t

    def offboard_signal(self, t: float) -> bool:
        """Whether setpoints arrive (COM_OF_LOSS_T) and the estimate they need is valid."""
        if t - self._setpoint_time >= self._parameters["COM_OF_LOSS_T"]:
            return False
        position, velocity, _ = self._setpoint_needs
        if position and self.flags.position_invalid:
            return False
        return position or not (velocity and self.flags.velocity_invalid)

    def update(self, t: float, *, intended: Mode, mode: Mode, armed: bool, in_air: bool) -> None:
        """Look at everything; the sticks' flag is the commander's."""
        seen, flags = self._surroundings, self.flags
        estimate = seen.estimate
        flags.position_invalid = flags.velocity_invalid = not estimate.position_valid
        flags.global_position_invalid = not estimate.position_valid
        flags.altitude_invalid = not estimate.heading_stable
        flags.home_invalid = not estimate.ever_had_position
        booting = t - self._booted_at <= HEARTBEAT_TIMEOUT
        flags.ground_station_lost = booting or t - self._ground_station_time >= self._parameters["COM_DL_LOSS_T"]
        flags.offboard_signal_lost = not self.offboard_signal(t)
        flags.battery_warning = seen.battery.warning
        breach = geofence.breach(self._parameters, seen.position, seen.home) if in_air else ""
        flags.geofence_breached = bool(breach)
        condition = health.Condition(
            flags=flags,
            intended=intended,
            terminated=mode is Mode.TERMINATION,
            armed=armed,
            heading_stable=estimate.heading_stable,
            gnss_missing=not (self._faults.gnss or estimate.gnss_used),
            geofence=breach,
            charge=seen.battery.reported,
            problem=self.problem,
        )
        self._failed = health.failed_checks(condition, self._parameters)
        self.can_arm = health.can_arm(self._failed, intended)

    def report(self, t: float, intended: Mode, *, force: bool = False) -> list[Notice]:
        """Tell what has changed, if it is time for that; or everything."""
        return self._reporter.update(t, self._failed, intended, force=force)

    def flush(self, t: float, intended: Mode) -> list[Notice]:
        """Tell now what has changed and has not been told."""
        return self._reporter.flush(t, self._failed, intended)
