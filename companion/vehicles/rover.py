"""Rovers with Ackermann steering: what they may be asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.control.drive import DriveParameters
from companion.planning.coupled.model import RoverMotion
from companion.planning.shortest.car import Car

ROVER_MAV_TYPES = frozenset({10})  # MAV_TYPE_GROUND_ROVER


@dataclass(frozen=True, slots=True, kw_only=True)
class RoverParameters:
    """The vehicle as configured; the defaults are those of the simulated rover."""

    speed_forward: Annotated[float, Gt(0.0), Le(10.0)] = 1.5  # [m/s]
    speed_reverse: Annotated[float, Ge(0.0), Le(10.0)] = 0.6  # [m/s]; 0: it never drives backwards
    acceleration: Annotated[float, Gt(0.0), Le(10.0)] = 1.0  # [m/s^2] also of braking
    yaw_rate: Annotated[float, Gt(0.0), Le(10.0)] = 1.2  # [rad/s]
    yaw_acceleration: Annotated[float, Gt(0.0), Le(50.0)] = 3.0  # [rad/s^2]
    turning_radius: Annotated[float, Gt(0.0), Le(100.0)] = 0.85  # [m] the smallest; some more than the steering gives
    closing_speed: Annotated[float, Gt(0.0), Le(10.0)] = 1.0  # [m/s] towards the target, relative to it,
    # [m] no farther from it than this; farther away, as much more as half its braking takes off on the way
    closing_within: Annotated[float, Ge(0.0), Le(100.0)] = 1.5
    length: Annotated[float, Gt(0.0), Le(20.0)] = 0.60  # [m] footprint, the body origin in its middle
    width: Annotated[float, Gt(0.0), Le(10.0)] = 0.40  # [m]
    rear_axle: Annotated[float, Ge(0.0), Le(10.0)] = 0.18  # [m] behind the body origin
    body_height: Annotated[float, Gt(0.0), Le(5.0)] = 0.12  # [m] of the body origin above the ground
    drive: DriveParameters = field(default_factory=DriveParameters)  # from speed and turn to the sticks


@dataclass(frozen=True, slots=True, kw_only=True)
class Rover:
    """A rover: it goes where it points."""

    parameters: RoverParameters = field(default_factory=RoverParameters)

    @property
    def motion(self) -> RoverMotion:
        """What the planner keeps."""
        p = self.parameters
        return RoverMotion(
            speed_forward=p.speed_forward,
            speed_reverse=p.speed_reverse,
            turning_radius=p.turning_radius,
            yaw_rate=p.yaw_rate,
            acceleration=p.acceleration,
            yaw_acceleration=p.yaw_acceleration,
        )

    def car(self, *, gear_time: float) -> Car:
        """What its shortest paths keep; `gear_time` [s] is spent standing between driving forward and back."""
        p = self.parameters
        return Car(
            turning_radius=p.turning_radius,
            speed_forward=p.speed_forward,
            speed_reverse=p.speed_reverse,
            yaw_rate=p.yaw_rate,
            acceleration=p.acceleration,
            gear_time=gear_time,
        )

    def accepts(self, mav_type: int) -> bool:
        """Say whether an autopilot that reports this MAV_TYPE drives such a vehicle."""
        return mav_type in ROVER_MAV_TYPES
