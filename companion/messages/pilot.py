"""What the people around a flight are told, and what the autopilot is told of the target."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from companion.geometry.arrays import Array, frozen


class Severity(IntEnum):
    """MAV_SEVERITY, as far as it is used."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class PilotText:
    """One plain sentence for the pilot and the ground station."""

    severity: Severity
    text: str


class Stand(Enum):
    """Who flies and how the mission stands, in one word; the value is its number in the heartbeat."""

    WAITING = 1  # for the vehicle, or for permission
    ENGAGED = 2  # the companion's setpoints are streamed
    MUTED = 3  # somebody else flies; silent until the operator engages
    GUIDING = 4  # the autopilot lands by itself, and is told where the target is
    ENDED = 5  # as the mission asked
    FAILED = 6  # without success


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LandingTarget:
    """Where the pad was when a picture was taken, for the autopilot's own precision landing."""

    t: float  # [s] capture time, companion clock
    position_ned: Array  # (3,) [m] of the landing point, autopilot's local frame
    yaw: float  # [rad] heading of the pad from north
    position_std: float  # [m] largest horizontal standard deviation
    distance: float  # [m] from the camera
    angle_right: float  # [rad] from the picture's centre
    angle_down: float  # [rad] towards the picture's lower edge
    size_right: float  # [rad] width of the board in the picture, about
    size_down: float  # [rad]

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_ned", frozen(self.position_ned, (3,)))
