"""What the autopilot says of our own motion and state."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.geometry.arrays import Array, frozen
from companion.geometry.rotations import yaw_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OwnshipState:
    """The vehicle's estimated motion at one instant, in the autopilot's local frame."""

    t: float  # [s] instant it is valid at, companion clock
    position_ned: Array  # (3,) [m]
    velocity_ned: Array  # (3,) [m/s]
    acceleration_ned: Array  # (3,) [m/s^2] kinematic (gravity removed); zeros where unknown
    ned_from_frd: Array  # (3, 3) attitude
    angular_velocity_frd: Array  # (3,) [rad/s]
    reset_counter: int  # the autopilot's estimator reset counter, 0..255, wraps

    def __post_init__(self) -> None:
        for name, shape in (
            ("position_ned", (3,)),
            ("velocity_ned", (3,)),
            ("acceleration_ned", (3,)),
            ("ned_from_frd", (3, 3)),
            ("angular_velocity_frd", (3,)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), shape))

    @property
    def yaw(self) -> float:
        """Heading [rad] from north, clockwise."""
        return yaw_of(self.ned_from_frd)


class FlightMode(Enum):
    """PX4's navigation mode, as far as the companion must tell them apart."""

    UNKNOWN = "unknown"
    OFFBOARD = "OFFBOARD"
    MANUAL = "MANUAL"
    ALTCTL = "ALTCTL"
    POSCTL = "POSCTL"
    ACRO = "ACRO"
    STABILIZED = "STABILIZED"
    AUTO_TAKEOFF = "AUTO.TAKEOFF"
    AUTO_LOITER = "AUTO.LOITER"
    AUTO_MISSION = "AUTO.MISSION"
    AUTO_RTL = "AUTO.RTL"
    AUTO_LAND = "AUTO.LAND"
    AUTO_PRECLAND = "AUTO.PRECLAND"
    AUTO_FOLLOW = "AUTO.FOLLOW"
    TERMINATION = "TERMINATION"
    OTHER = "other"


class LandedState(Enum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class SystemStatus(Enum):
    """MAV_STATE, as far as it matters here."""

    UNINIT = 0
    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6
    POWEROFF = 7
    FLIGHT_TERMINATION = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStatus:
    """The autopilot's mode and health."""

    t: float  # [s] when the newest part of it arrived
    connected: bool  # a heartbeat arrived within the link's timeout
    armed: bool
    mode: FlightMode
    landed: LandedState
    system_status: SystemStatus
    estimate_valid: bool  # the horizontal position and velocity estimates are usable
    battery_remaining: float | None  # 0..1, None where unknown
    # The pilot's sticks, -1..1: channels 1 to 4 of the transmitter, then pitch, roll, throttle and yaw of the
    # autopilot's manual control; None where nothing has been heard.
    sticks: tuple[float | None, ...] = ()
    mode_changes: int = 0  # reported so far: a mode that came and went between two looks has changed it by two
    takeover_events: int = 0  # heard so far: pilot's override, kill, or failsafe, as the autopilot's EVENT says at once
