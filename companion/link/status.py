"""The vehicle's mode and health, put together from several messages."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

from companion.link import incoming
from companion.link.modes import flight_mode
from companion.messages.ownship import FlightMode, LandedState, SystemStatus, VehicleStatus

# ESTIMATOR_STATUS_FLAGS
_ATTITUDE, _VELOCITY_HORIZONTAL, _VELOCITY_VERTICAL, _POSITION_RELATIVE, _POSITION_ABSOLUTE = 1, 2, 4, 8, 16
_NEEDED_FLAGS = _ATTITUDE | _VELOCITY_HORIZONTAL | _VELOCITY_VERTICAL

_NEVER = -math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusParameters:
    """How old a piece of status may be."""

    heartbeat_timeout: Annotated[float, Gt(0.0)] = 2.5  # [s] without a heartbeat the vehicle is lost
    estimator_timeout: Annotated[float, Gt(0.0)] = 2.5  # [s] older ESTIMATOR_STATUS says nothing
    odometry_timeout: Annotated[float, Gt(0.0)] = 0.5  # [s] without odometry the estimate is not usable


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """What the autopilot says of its parts; None: nothing yet."""

    sensors: incoming.SysStatus | None
    estimator: incoming.EstimatorStatus | None


class StatusTracker:
    """Holds the newest of each piece."""

    def __init__(self, parameters: StatusParameters) -> None:
        self._parameters = parameters
        self.armed = False
        self.mode = FlightMode.UNKNOWN
        self.sys_status: incoming.SysStatus | None = None
        self._landed = LandedState.UNDEFINED
        self._system_status = SystemStatus.UNINIT
        self._estimator: incoming.EstimatorStatus | None = None
        self._batteries: dict[int, int] = {}  # id to [%]
        self._t = _NEVER
        self._t_heartbeat = _NEVER
        self._t_estimator = _NEVER
        self._t_odometry = _NEVER

    def heartbeat(self, heartbeat: incoming.Heartbeat, t: float) -> None:
        """Take a heartbeat of the vehicle."""
        self._t = self._t_heartbeat = t
        self.armed = heartbeat.armed
        self.mode = flight_mode(heartbeat.custom_mode)
        known = 0 <= heartbeat.system_status <= SystemStatus.FLIGHT_TERMINATION.value
        self._system_status = SystemStatus(heartbeat.system_status) if known else SystemStatus.UNINIT

    def current_mode(self, custom_mode: int, t: float) -> None:
        """Take a CURRENT_MODE."""
        self._t = t
        self.mode = flight_mode(custom_mode)

    def sensors(self, status: incoming.SysStatus, t: float) -> None:
        """Take a SYS_STATUS."""
        self._t = t
        self.sys_status = status

    def landed(self, state: int, t: float) -> None:
        """Take the MAV_LANDED_STATE of an EXTENDED_SYS_STATE."""
        self._t = t
        self._landed = LandedState(state) if 0 <= state <= LandedState.LANDING.value else LandedState.UNDEFINED

    def estimator(self, estimator: incoming.EstimatorStatus, t: float) -> None:
        """Take an ESTIMATOR_STATUS."""
        self._t = self._t_estimator = t
        self._estimator = estimator

    def health_reported(self) -> Health:
        """Give the newest of what the autopilot says of its sensors and its estimator."""
        return Health(sensors=self.sys_status, estimator=self._estimator)

    def battery(self, battery: incoming.BatteryStatus, t: float) -> None:
        """Take a BATTERY_STATUS."""
        self._t = t
        if battery.id < 8:
            self._batteries[battery.id] = battery.remaining

    def odometry(self, t: float) -> None:
        """Note a usable odometry."""
        self._t = self._t_odometry = t

    def restarted(self) -> None:
        """Forget what a restarted autopilot no longer stands for: its first ON_GROUND is only a default."""
        self._landed = LandedState.UNDEFINED
        self._t_estimator = self._t_odometry = _NEVER

    def silence(self, t: float) -> float:
        """Give the time [s] since the last heartbeat; infinite before the first."""
        return t - self._t_heartbeat

    def connected(self, t: float) -> bool:
        """Tell whether a heartbeat arrived within the timeout."""
        return self.silence(t) <= self._parameters.heartbeat_timeout

    def at(self, t: float) -> VehicleStatus:
        """Give the status at `t` [s]."""
        return VehicleStatus(
            t=self._t,
            connected=self.connected(t),
            armed=self.armed,
            mode=self.mode,
            landed=self._landed,
            system_status=self._system_status,
            estimate_valid=self._estimate_valid(t),
            battery_remaining=self._battery(),
        )

    def _estimate_valid(self, t: float) -> bool:
        flags = 0 if self._estimator is None else self._estimator.flags
        return (
            t - self._t_estimator <= self._parameters.estimator_timeout
            and t - self._t_odometry <= self._parameters.odometry_timeout
            and flags & _NEEDED_FLAGS == _NEEDED_FLAGS
            and bool(flags & (_POSITION_RELATIVE | _POSITION_ABSOLUTE))
        )

    def _battery(self) -> float | None:
        """Give the emptiest battery, 0..1."""
        percents = [percent for percent in self._batteries.values() if 0 <= percent <= 100]
        if not percents and self.sys_status is not None and 0 <= self.sys_status.battery_remaining <= 100:
            percents = [self.sys_status.battery_remaining]
        return min(percents) / 100.0 if percents else None
