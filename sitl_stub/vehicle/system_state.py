"""What the commander answers, shows and looks at: results, MAV_STATE, reasons for arming and disarming."""

from dataclasses import dataclass
from enum import IntEnum

from sitl_stub.truth import Vector
from sitl_stub.vehicle.battery import Battery
from sitl_stub.vehicle.ekf_resets import EstimateHealth


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class SystemStatus(IntEnum):
    """MAV_STATE as PX4 uses it."""

    UNINITIALISED = 0
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    TERMINATION = 8


BY_GESTURE, BY_SWITCH, BY_COMMAND, BY_LANDING, BY_PREFLIGHT_TIMEOUT, BY_KILL, BY_FAILSAFE = 1, 2, 4, 6, 7, 8, 14
FORCE = 21196.0
"""Second parameter of a forced disarm."""


@dataclass(slots=True, kw_only=True)
class Surroundings:
    """What the commander looks at; the autopilot keeps it up to date."""

    estimate: EstimateHealth
    battery: Battery
    landed: bool = True
    position: Vector = (0.0, 0.0, 0.0)
    """Estimated position [m], local ned."""
    home: Vector = (0.0, 0.0, 0.0)
