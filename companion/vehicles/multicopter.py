"""Multicopters: what they may be asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated

from annotated_types import Gt

from companion.messages.motion import MotionLimits

# MAV_TYPE: quadrotor, coaxial, hexarotor, octorotor, tricopter, dodecarotor, decarotor, generic multirotor.
MULTICOPTER_MAV_TYPES = frozenset({2, 3, 13, 14, 15, 29, 35, 43})


class SetpointForm(Enum):
    """What a setpoint for the vehicle consists of."""

    POSITION_VELOCITY_ACCELERATION_YAW = "position, velocity, acceleration and yaw in LOCAL_NED"
    ATTITUDE_BODY_THRUST = "attitude and normalised body thrust"


@dataclass(frozen=True, slots=True, kw_only=True)
class MulticopterParameters:
    """The vehicle as configured; the defaults are soft limits for a quadrotor of the x500's size near a pad."""

    speed_horizontal: Annotated[float, Gt(0.0)] = 3.0  # [m/s]
    speed_up: Annotated[float, Gt(0.0)] = 1.5  # [m/s]
    speed_down: Annotated[float, Gt(0.275)] = 1.0  # [m/s] at least what the autopilot's land detection asks for
    acceleration_horizontal: Annotated[float, Gt(0.0)] = 2.5  # [m/s^2]
    acceleration_vertical: Annotated[float, Gt(0.0)] = 2.0  # [m/s^2]
    jerk: Annotated[float, Gt(0.0)] = 20.0  # [m/s^3] per axis
    yaw_rate: Annotated[float, Gt(0.0)] = 1.0  # [rad/s]
    yaw_acceleration: Annotated[float, Gt(0.0)] = 2.0  # [rad/s^2]
    closing_speed: Annotated[float, Gt(0.0)] = 1.5  # [m/s] towards the target, relative to it
    gear_height: Annotated[float, Gt(0.0)] = 0.2  # [m] of the body origin above the feet


@dataclass(frozen=True, slots=True, kw_only=True)
class Multicopter:
    """A multicopter: position and heading independent of each other."""

    parameters: MulticopterParameters = field(default_factory=MulticopterParameters)
    setpoint_form: SetpointForm = SetpointForm.POSITION_VELOCITY_ACCELERATION_YAW

    @property
    def limits(self) -> MotionLimits:
        """What the planner and the guardian keep."""
        p = self.parameters
        return MotionLimits(
            speed_horizontal=p.speed_horizontal,
            speed_up=p.speed_up,
            speed_down=p.speed_down,
            acceleration_horizontal=p.acceleration_horizontal,
            acceleration_vertical=p.acceleration_vertical,
            jerk=p.jerk,
            yaw_rate=p.yaw_rate,
            yaw_acceleration=p.yaw_acceleration,
        )

    @property
    def closing_speed(self) -> float:
        """Largest speed [m/s] towards the target, relative to it."""
        return self.parameters.closing_speed

    @property
    def gear_height(self) -> float:
        """Height [m] of the body origin above the feet."""
        return self.parameters.gear_height

    def accepts(self, mav_type: int) -> bool:
        """Say whether an autopilot that reports this MAV_TYPE flies such a vehicle."""
        return mav_type in MULTICOPTER_MAV_TYPES
