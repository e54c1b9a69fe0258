"""Planar free-flyers: what they may be asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Gt

from companion.control.free_flyer.parameters import FreeFlyerControlParameters
from companion.messages.motion import MotionLimits
from companion.vehicles.multicopter import SetpointForm

# MAV_TYPE_SPACECRAFT_ORBITER: what PX4's spacecraft airframes report.
FREE_FLYER_MAV_TYPES = frozenset({45})
_NO_CLIMB = 0.01  # [m/s]: the floor carries it; plans are level, and a limit must be above zero


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyerParameters:
    """The vehicle as configured; the defaults are soft limits for a 10 kg testbed of 0.4 m/s^2 on a floor of metres.

    It brakes no harder than it accelerates, so its speed is what it can take out in the length of its own footprint:
    0.2 m/s in 0.13 m. Half of its thrust is left to feedback and to turning.
    """

    speed: Annotated[float, Gt(0.0)] = 0.2  # [m/s] over the floor
    acceleration: Annotated[float, Gt(0.0)] = 0.15  # [m/s^2]
    jerk: Annotated[float, Gt(0.0)] = 0.6  # [m/s^3] per axis: full acceleration within a few pulses
    yaw_rate: Annotated[float, Gt(0.0)] = 1.2  # [rad/s]
    yaw_acceleration: Annotated[float, Gt(0.0)] = 2.0  # [rad/s^2]
    closing_speed: Annotated[float, Gt(0.0)] = 0.15  # [m/s] towards the target, relative to it
    body_height: Annotated[float, Gt(0.0)] = 0.25  # [m] of the body origin above the floor
    footprint_radius: Annotated[float, Gt(0.0)] = 0.22  # [m] nothing stands out beyond it
    # from the reference to heading and thrust
    control: FreeFlyerControlParameters = field(default_factory=FreeFlyerControlParameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyer:
    """A free-flyer: position in the plane and heading independent of each other, thrust along the body's axes."""

    parameters: FreeFlyerParameters = field(default_factory=FreeFlyerParameters)
    setpoint_form: SetpointForm = SetpointForm.ATTITUDE_BODY_THRUST

    @property
    def limits(self) -> MotionLimits:
        """What the planner and the guardian keep. Plans for it are level, see `planning.planar`."""
        p = self.parameters
        return MotionLimits(
            speed_horizontal=p.speed,
            speed_up=_NO_CLIMB,
            speed_down=_NO_CLIMB,
            acceleration_horizontal=p.acceleration,
            acceleration_vertical=p.acceleration,  # never used, and no reason to steer more softly
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
        """Height [m] of the body origin above the floor."""
        return self.parameters.body_height

    @property
    def footprint_radius(self) -> float:
        """Radius [m] of the disc that the vehicle fills."""
        return self.parameters.footprint_radius

    def accepts(self, mav_type: int) -> bool:
        """Say whether an autopilot that reports this MAV_TYPE flies such a vehicle."""
        return mav_type in FREE_FLYER_MAV_TYPES
