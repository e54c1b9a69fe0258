"""What the controller knows of the vehicle, and what it is tuned by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyerControlParameters:
    """Model and weights; the gains follow from them (`gains.py`). The defaults are the simulated free-flyer's."""

    thrust_acceleration: Annotated[float, Gt(0.0)] = 0.40  # [m/s^2] of normalised thrust 1: two thrusters, by the mass
    pulse_period: Annotated[float, Gt(0.0)] = 0.100  # [s] each thruster opens once in it
    dead_band: Annotated[float, Interval(ge=0.0, lt=0.5)] = 0.05  # normalised thrust below which no valve opens
    pulse: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.08  # normalised thrust that stands for all smaller ones
    turning_share: Annotated[float, Interval(ge=0.0, lt=1.0)] = 0.2  # of each thruster's time, kept for turning
    delay: Annotated[float, Ge(0.0), Le(1.0)] = 0.06  # [s] from a setpoint's tick to the middle of its thrust
    heading_gain: Annotated[float, Gt(0.0)] = 3.0  # [1/s] the autopilot's SC_YAW_P
    yaw_rate_max: Annotated[float, Gt(0.0)] = 1.2  # [rad/s] what a heading error may make it turn
    # Bryson's rule: the feedback weighs these alike.
    position_scale: Annotated[float, Gt(0.0)] = 0.025  # [m]
    velocity_scale: Annotated[float, Gt(0.0)] = 0.10  # [m/s]
    acceleration_scale: Annotated[float, Gt(0.0)] = 0.16  # [m/s^2]
    observer_bandwidth: Annotated[float, Interval(gt=0.0, le=20.0)] = 4.0  # [rad/s]
    disturbance_max: Annotated[float, Gt(0.0)] = 0.06  # [m/s^2] a larger one is not believed
    blind_after: Annotated[float, Gt(0.0)] = 0.5  # [s] older odometry: no thrust
