"""What PX4's failsafes are made of: actions, causes, what is wrong, and what a failure asks for.

Names and numbers as in commander/failsafe/framework.h of PX4 v1.17.
"""

from dataclasses import dataclass
from enum import IntEnum

from sitl_stub.vehicle.modes import (
    NEEDS_ALTITUDE,
    NEEDS_GLOBAL_POSITION,
    NEEDS_HOME,
    NEEDS_MISSION,
    NEEDS_POSITION,
    NEEDS_SETPOINTS,
    Mode,
)


class Action(IntEnum):
    """What a failsafe does, from harmless to drastic. The numbers appear in PX4's events."""

    NONE = 0
    WARN = 1
    FALLBACK_POSITION = 2
    FALLBACK_ALTITUDE = 3
    FALLBACK_STABILIZED = 4
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8
    DISARM = 9
    TERMINATE = 10


class Cause(IntEnum):
    """Why, as PX4's events name it."""

    GENERIC = 0
    MANUAL_CONTROL_LOSS = 1
    GROUND_STATION_LOSS = 2
    BATTERY_LOW = 3
    BATTERY_CRITICAL = 4
    BATTERY_EMERGENCY = 5


class Takeover(IntEnum):
    """How a user may end an action; `AUTO` becomes one of the others when the action begins."""

    ALWAYS = 0
    MODE_SWITCH_ONLY = 1
    NEVER = 2
    AUTO = 3


class Clear(IntEnum):
    """When an action is dropped after its failure has gone."""

    AT_ONCE = 0
    ON_MODE_CHANGE_OR_DISARM = 1
    NEVER = 3


ACTION_MODES = {
    Action.FALLBACK_POSITION: Mode.POSCTL,
    Action.FALLBACK_ALTITUDE: Mode.ALTCTL,
    Action.FALLBACK_STABILIZED: Mode.STABILIZED,
    Action.HOLD: Mode.AUTO_LOITER,
    Action.RETURN: Mode.AUTO_RTL,
    Action.LAND: Mode.AUTO_LAND,
    Action.DESCEND: Mode.DESCEND,
    Action.TERMINATE: Mode.TERMINATION,
}


@dataclass(slots=True)
class FailsafeFlags:
    """What is wrong now, as PX4's `failsafe_flags` topic."""

    offboard_signal_lost: bool = True
    manual_control_lost: bool = True
    ground_station_lost: bool = True
    position_invalid: bool = True
    velocity_invalid: bool = True
    global_position_invalid: bool = True
    altitude_invalid: bool = True
    attitude_invalid: bool = False
    home_invalid: bool = True
    mission_missing: bool = True
    geofence_breached: bool = False
    battery_warning: int = 0
    """0 none, 1 low, 2 critical, 3 emergency."""

    def can_run(self, mode: Mode) -> bool:
        """Whether the estimate and the signals that `mode` needs are there; stick input is judged elsewhere."""
        return not (
            (self.position_invalid and mode in NEEDS_POSITION)
            or (self.global_position_invalid and mode in NEEDS_GLOBAL_POSITION)
            or (self.altitude_invalid and mode in NEEDS_ALTITUDE)
            or (self.home_invalid and mode in NEEDS_HOME)
            or (self.mission_missing and mode in NEEDS_MISSION)
            or (self.offboard_signal_lost and mode in NEEDS_SETPOINTS)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What a failure asks for."""

    action: Action = Action.NONE
    takeover: Takeover = Takeover.AUTO
    clear: Clear = Clear.AT_ONCE
    cause: Cause = Cause.GENERIC


@dataclass(frozen=True, slots=True, kw_only=True)
class Notification:
    """A failsafe that users are told of."""

    intended: Mode
    action: Action
    delayed: Action
    cause: Cause
    delay: int
    """Seconds of Hold before the delayed action."""
