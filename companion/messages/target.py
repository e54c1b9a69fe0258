"""What is known, and expected, of the target."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from companion.geometry.arrays import Array, frozen

# State of the target relative to the observer, in the `level` frame: origin at the vehicle, x along its heading,
# y right, z down.
POSITION = slice(0, 3)  # [m]
HEADING = 3  # [rad] the pad's heading minus the vehicle's
VELOCITY = slice(
    4, 7
)  # [m/s] the target's own velocity over the ground (as odometry sees the ground), along level axes
TURN_RATE = 7  # [rad/s] the target's own turn rate
STATE_SIZE = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetMeasurement:
    """The pad's pose relative to the vehicle at capture time, in `level`."""

    t: float  # [s] capture
    position_level: Array  # (3,) [m]
    heading: float  # [rad] pad heading minus vehicle heading
    covariance: Array  # (4, 4) of [position, heading]
    # (2,) forward and right components of the pad's downward normal: its slope, and what the attitude is wrong by
    slope_level: Array = field(default_factory=lambda: np.zeros(2))
    slope_std: float = math.inf  # [rad] of each; infinite: not known

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_level", frozen(self.position_level, (3,)))
        object.__setattr__(self, "slope_level", frozen(self.slope_level, (2,)))
        object.__setattr__(self, "covariance", frozen(self.covariance, (4, 4)))


class MeasurementVerdict(Enum):
    """What the estimator did with a measurement."""

    FUSED = "fused"
    INITIALISED = "initialised the track"
    REJECTED_GATE = "rejected: outside the innovation gate"
    REJECTED_AMBIGUOUS = "rejected: both pose hypotheses are plausible"
    REJECTED_TOO_OLD = "rejected: older than the history"
    REJECTED_INVALID = "rejected: not finite or impossible"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetTrack:
    """The estimate of the target at one instant."""

    t: float  # [s] instant of validity
    t_measured: float  # [s] capture time of the newest fused measurement
    state: Array  # (8,) see POSITION, HEADING, VELOCITY, TURN_RATE
    covariance: Array  # (8, 8)
    position_ned: Array  # (3,) [m] target in the autopilot's local frame, by the odometry at `t`
    velocity_ned: Array  # (3,) [m/s]
    yaw_ned: float  # [rad] the pad's heading from north
    reset_counter: int  # of the odometry that anchors the *_ned fields
    nis: float  # normalised innovation squared of the newest fused measurement
    nis_mean: float  # exponentially averaged NIS per degree of freedom: about 1 when consistent
    fused: int  # measurements fused since the track began
    t_began: float  # [s] capture time of the measurement with which it began; another time, another track

    def __post_init__(self) -> None:
        for name, shape in (
            ("state", (STATE_SIZE,)),
            ("covariance", (STATE_SIZE, STATE_SIZE)),
            ("position_ned", (3,)),
            ("velocity_ned", (3,)),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), shape))

    @property
    def age(self) -> float:
        """Time [s] since the newest fused measurement was captured."""
        return self.t - self.t_measured


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetPose:
    """A forecast of the target at one instant, in the autopilot's local frame."""

    t: float  # [s]
    position_ned: Array  # (3,) [m]
    velocity_ned: Array  # (3,) [m/s]
    acceleration_ned: Array  # (3,) [m/s^2]
    yaw: float  # [rad] from north, continuous over the forecast (not wrapped)
    yaw_rate: float  # [rad/s]
    covariance: Array  # (4, 4) of [north, east, down, yaw]


class Prediction(Protocol):
    """A forecast of the target over time."""

    @property
    def t(self) -> float:
        """Instant [s] at which the forecast begins."""

    @property
    def horizon(self) -> float:
        """Time [s] after `t` up to which it may be asked."""

    @property
    def reset_counter(self) -> int:
        """Reset counter of the odometry that anchors it."""

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]; beyond the horizon the velocity is held."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intercept:
    """When and where the target can be met."""

    t: float  # [s] instant of the meeting
    pose: TargetPose  # the target then
    feasible: bool  # the target enters the reachable set before the horizon
    margin: float  # [m] reach minus distance at `t`; negative where infeasible
    probability: float  # that the target is inside the reachable set at `t`, from the forecast's covariance
