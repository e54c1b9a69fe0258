"""What the controller knows of the spacecraft, and what it is tuned by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval, Le

from companion.control.rigid_body.nozzles import Vector, x_layout

_PLACES, _DIRECTIONS = x_layout(face=0.05, corner=0.04, axial=0.3)

Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidBodyParameters:
    """Model and weights; the gains follow from them (`gains.py`). The defaults are a CubeSat of one unit."""

    mass: Positive = 2.0  # [kg]
    inertia: tuple[Positive, Positive, Positive] = (0.0035, 0.0035, 0.0033)  # [kg m^2] about x, y, z of d
    nozzle_places: tuple[Vector, ...] = _PLACES  # [m] against the centre of mass, in d
    nozzle_directions: tuple[Vector, ...] = _DIRECTIONS  # unit vectors of their forces, in d
    thrust: Positive = 0.025  # [N] of each nozzle
    least_on_time: Positive = 0.010  # [s] shorter commands do not open a valve properly
    period: Positive = 0.100  # [s] between two commands
    valve_delay: Annotated[float, Interval(ge=0.0, le=0.05)] = 0.003  # [s] from a command to its thrust
    # Bryson's rule: these weigh alike.
    position_scale: Positive = 0.005  # [m]
    velocity_scale: Positive = 0.010  # [m/s]
    integral_scale: Positive = 0.20  # [m s]
    acceleration_scale: Positive = 5e-4  # [m/s^2]
    natural_frequency: Positive = 1.4  # [rad/s] of the attitude
    damping: Positive = 1.6  # damping ratio of the attitude
    rate_max: Positive = 0.1  # [rad/s] that the body is asked to turn with, at most
    correction_speed_max: Positive = 0.010  # [m/s] beside the goal's own velocity
    disturbance_max: Positive = 2e-4  # [m/s^2] that the integral may make up for
    # Errors within the band are not worth a pulse. It is as wide as the estimate is uncertain, between these limits.
    noise_band: Annotated[float, Ge(0.0)] = 1.5  # standard deviations of the estimate
    rate_noise: Annotated[float, Ge(0.0)] = 6e-4  # [rad/s] standard deviation of the estimated turn rate, per axis
    position_band: Positive = 0.0006  # [m]
    position_band_max: Positive = 0.030  # [m]
    attitude_band: Positive = 0.0045  # [rad]
    attitude_band_max: Positive = 0.020  # [rad]
    pulse_price: Annotated[float, Ge(0.0)] = 0.25  # of a least pulse, in harm (`pulses.py`)
    blind_after: Annotated[float, Gt(0.0), Le(10.0)] = 0.5  # [s] older estimates: no pulses
