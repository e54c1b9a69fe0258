"""Trajectories and setpoints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from companion.geometry.arrays import Array, frozen
from companion.messages.thrust import AttitudeThrust

_NOTHING = frozen([0.0, 0.0, 0.0])


def _nothing() -> Array:
    return _NOTHING


_MOTION_VECTORS = (
    "position_ned",
    "velocity_ned",
    "acceleration_ned",
    "feedback_velocity_ned",
    "feedback_acceleration_ned",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionState:
    """A reference in the autopilot's local frame at one instant."""

    position_ned: Array  # (3,) [m]
    velocity_ned: Array  # (3,) [m/s]
    acceleration_ned: Array  # (3,) [m/s^2]
    yaw: float  # [rad] from north
    yaw_rate: float  # [rad/s]
    # Corrections for the autopilot's loops, sent on top of the motion but no part of it:
    feedback_velocity_ned: Array = field(
        default_factory=_nothing
    )  # (3,) [m/s] bias of the autopilot's velocity estimate
    feedback_acceleration_ned: Array = field(default_factory=_nothing)  # (3,) [m/s^2]
    feedback_yaw: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        for name in _MOTION_VECTORS:
            value = getattr(self, name)
            if value is not _NOTHING:
                object.__setattr__(self, name, frozen(value, (3,)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """What the vehicle may be asked for."""

    speed_horizontal: float  # [m/s]
    speed_up: float  # [m/s]
    speed_down: float  # [m/s]
    acceleration_horizontal: float  # [m/s^2]
    acceleration_vertical: float  # [m/s^2]
    jerk: float  # [m/s^3] per axis
    yaw_rate: float  # [rad/s]
    yaw_acceleration: float  # [rad/s^2]


class Trajectory(Protocol):
    """A motion as a function of time, with an expiry: what a planner hands to the guardian."""

    @property
    def t_start(self) -> float:
        """Instant [s] at which it begins."""

    @property
    def t_end(self) -> float:
        """Instant [s] at which its last piece ends; afterwards the end state moves on at its end velocity."""

    @property
    def t_expiry(self) -> float:
        """Instant [s] after which the guardian no longer follows it."""

    @property
    def reset_counter(self) -> int:
        """Reset counter of the odometry it is anchored in."""

    def at(self, t: float) -> MotionState:
        """Give the reference at `t` [s]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setpoint:
    """One offboard setpoint, LOCAL_NED: position, velocity, acceleration and yaw, all finite or absent as a whole."""

    t: float  # [s] tick of the guardian that made it
    position_ned: Array | None  # (3,) [m]; None: not controlled
    velocity_ned: Array  # (3,) [m/s]
    acceleration_ned: Array  # (3,) [m/s^2]
    yaw: float  # [rad]
    yaw_rate: float  # [rad/s]
    feedback_velocity_ned: Array = field(
        default_factory=_nothing
    )  # (3,) [m/s] sent on top of the velocity: bias of the autopilot's estimate

    def __post_init__(self) -> None:
        if self.position_ned is not None:
            object.__setattr__(self, "position_ned", frozen(self.position_ned, (3,)))
        for name in ("velocity_ned", "acceleration_ned", "feedback_velocity_ned"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SticksSetpoint:
    """One setpoint of a ground vehicle, driven by the sticks of the autopilot's manual control."""

    t: float  # [s] tick of the guardian that made it
    speed: float  # [m/s] along the heading, limited; below zero backwards
    yaw_rate: float  # [rad/s] clockwise, limited
    throttle: float  # -1..1 stick: below zero backwards
    steering: float  # -1..1 stick: above zero to the right


AnySetpoint = Setpoint | SticksSetpoint | AttitudeThrust
