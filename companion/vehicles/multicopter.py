"""Multicopters: what they may be asked for and how far they reach."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated

from annotated_types import Gt

from companion.messages.motion import MotionLimits

# MAV_TYPE: quadrotor, coaxial, hexarotor, octorotor, tricopter, dodecarotor, decarotor, generic multirotor.
MULTICOPTER_MAV_TYPES = frozenset({2, 3, 13, 14, 15, 29, 35, 43})

# Peaks of the minimum-snap motion from rest to rest over unit distance and time: 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7.
_SNAP_SPEED = 35.0 / 16.0
_SNAP_ACCELERATION = 84.0 * math.sqrt(5.0) / 25.0
_SNAP_JERK = 52.5


class SetpointForm(Enum):
    """What a setpoint for the vehicle consists of."""

    POSITION_VELOCITY_ACCELERATION_YAW = "position, velocity, acceleration and yaw in LOCAL_NED"


class Reachability(Enum):
    """How far the vehicle is taken to come in a given time."""

    CONSTANT_VELOCITY = "constant_velocity"  # r = v t (Patel et al., "De-coupled Position and Orientation")
    ACCELERATION_LIMITED = "acceleration_limited"  # from rest, speeding up to v, arriving at speed
    MINIMUM_SNAP = "minimum_snap"  # from rest to rest, as the planner flies it


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

    def effective_radius(self, duration: float, reachability: Reachability = Reachability.CONSTANT_VELOCITY) -> float:
        """Give r_eff(t) [m], the radius of the sphere that the vehicle reaches within `duration` [s].

        Constant velocity: v t (Patel et al., section "De-coupled Position and Orientation"). Acceleration limited,
        from rest: a t^2 / 2 up to t_a = v / a, then v (t - t_a / 2). Minimum snap, from rest to rest: the least of
        v t / 2.1875, a t^2 / 7.5132 and j t^3 / 52.5, which is what the planner can fly.
        """
        p = self.parameters
        t = max(duration, 0.0)
        if reachability is Reachability.CONSTANT_VELOCITY:
            return p.speed_horizontal * t
        if reachability is Reachability.ACCELERATION_LIMITED:
            ramp = p.speed_horizontal / p.acceleration_horizontal
            if t < ramp:
                return 0.5 * p.acceleration_horizontal * t * t
            return p.speed_horizontal * (t - 0.5 * ramp)
        return min(
            p.speed_horizontal * t / _SNAP_SPEED,
            p.acceleration_horizontal * t * t / _SNAP_ACCELERATION,
            p.jerk * t * t * t / _SNAP_JERK,
        )
