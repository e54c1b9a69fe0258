"""The way to a landing place that takes the least energy of a multirotor.

Morbidi, Cano, Lara, "Minimum-energy path generation for a quadrotor UAV" (ICRA 2016) is what Parikh et al. follow; they
minimise over the motors' currents. Here the power is that of momentum theory, which needs numbers that are known of any
airframe, and the path is a family with three parameters, optimised directly.

    P = (kappa T v_i + P_0 + D(v) v + m g v_z) / eta        hover (induced, profile), drag, climb
    v_i = T / (2 rho A sqrt(v^2 + (v_z + v_i)^2))           Glauert
    T = m sqrt((g + a_z)^2 + (a + D / m)^2),    D = (c_1 + c_2 v) v
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from scipy.optimize import minimize

from companion.geometry.arrays import Array

Positive = Annotated[float, Gt(0.0)]
GRAVITY = 9.81  # [m/s^2]
_AIR = 1.225  # [kg/m^3]
_GRID = (np.arange(48) + 0.5) / 48  # of the way
_ROUNDS = 12  # of Newton's method for the induced velocity: to rounding from hover's
_SLOWEST = 0.2  # [m/s] below which nothing is tried


@dataclass(frozen=True, slots=True, kw_only=True)
class AirframeEnergy:
    """What the power depends on; the defaults are an X500 with four 10-inch propellers."""

    mass: Positive = 2.0  # [kg]
    disc_area: Positive = 0.203  # [m^2] of all rotors: four of 0.127 m radius
    drag_linear: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.35  # [N s/m] mostly of the rotors
    drag_quadratic: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.03  # [N s^2/m^2]
    induced_factor: Annotated[float, Interval(ge=1.0, le=2.0)] = 1.15  # uneven inflow and tip losses (Leishman)
    profile_power: Annotated[float, Interval(ge=0.0, le=1000.0)] = 25.0  # [W] drag of the blades; a sixth of hovering
    efficiency: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.7  # of motors and their controllers


@dataclass(frozen=True, slots=True, kw_only=True)
class PathLimits:
    """What the path must keep to."""

    speed: float  # [m/s] horizontal, at most
    acceleration: float  # [m/s^2] along the way
    sink_rate: float  # [m/s] on the way, at most
    final_sink_rate: float  # [m/s] of the vertical part at its end
    height_end: float  # [m] above the pad, at least, at the end of the way: from there on straight down


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyPath:
    """Horizontal way and height above the pad as a function of the way that is left."""

    height_start: float  # [m]
    height_end: float  # [m] where the way ends and the vertical part begins
    descent: float  # [m] of the way, at its end, on which the height falls
    speed: float  # [m/s] along the way
    energy: float = field(compare=False)  # [J] with the vertical part
    duration: float = field(compare=False)  # [s] with the vertical part

    def height(self, left: float) -> tuple[float, float]:
        """Give the height [m] with `left` [m] to go, and its slope, per metre to go."""
        share = min(1.0, max(0.0, left / self.descent))
        rise = self.height_start - self.height_end
        return self.height_end + rise * share * share * (3.0 - 2.0 * share), 6.0 * rise * share * (
            1.0 - share
        ) / self.descent


def electric_power(speed: Array, climb: Array, acceleration: Array, airframe: AirframeEnergy) -> Array:
    """Give the electric power (N,) [W].

    Args:
        speed: (N,) [m/s] horizontal, not negative.
        climb: (N,) [m/s] upwards.
        acceleration: (N,) [m/s^2] along the way.
        airframe: of the vehicle.
    """
    a = airframe
    drag = (a.drag_linear + a.drag_quadratic * speed) * speed
    thrust = np.hypot(a.mass * GRAVITY, a.mass * acceleration + drag)
    loading = thrust / (2.0 * _AIR * a.disc_area)
    induced = np.sqrt(loading)
    for _ in range(_ROUNDS):
        through = climb + induced
        flow = np.sqrt(speed * speed + through * through)
        excess = induced - loading / flow
        induced = induced - excess / (1.0 + loading * through / flow**3)
    mechanical = a.induced_factor * thrust * induced + a.profile_power + drag * speed + a.mass * GRAVITY * climb
    result: Array = mechanical / a.efficiency
    return result


def path_energy(
    length: float, path: tuple[float, float, float], height_start: float, limits: PathLimits, airframe: AirframeEnergy
) -> tuple[float, float]:
    """Give energy [J] and duration [s] of a path and the vertical part after it.

    Args:
        length: of the way [m].
        path: speed [m/s], way on which the height falls [m], height at the end [m].
        height_start: above the pad [m].
        limits: acceleration and the speed of the vertical part.
        airframe: of the vehicle.
    """
    top, descent, height_end = path
    left = length * (1.0 - _GRID)
    behind = length - left
    speed = np.minimum(top, np.sqrt(2.0 * limits.acceleration * np.minimum(left, behind)))
    times = length / len(_GRID) / speed
    rate = np.where(speed < top, np.where(behind < left, limits.acceleration, -limits.acceleration), 0.0)
    share = np.clip(left / descent, 0.0, 1.0)
    climb = -6.0 * (height_start - height_end) / descent * share * (1.0 - share) * speed
    way = float(electric_power(speed, climb, rate, airframe) @ times)
    sink = np.array([limits.final_sink_rate])
    still = np.zeros(1)
    down = height_end / limits.final_sink_rate
    return way + float(electric_power(still, -sink, still, airframe)[0]) * down, float(times.sum()) + down


def minimum_energy_path(length: float, height_start: float, limits: PathLimits, airframe: AirframeEnergy) -> EnergyPath:
    """Find the speed, the part of the way on which to descend, and the height at its end that take the least energy.

    Args:
        length: horizontal distance [m] to the pad.
        height_start: of the vehicle above the pad [m].
        limits: what the path keeps to.
        airframe: of the vehicle.
    """
    length = max(length, 1e-3)
    lowest = min(limits.height_end, height_start)
    slowest = min(_SLOWEST, limits.speed)

    def bounded(free: Array) -> tuple[float, float, float]:
        """Map any numbers into the limits; a descent too steep for its speed is stretched, then ends higher."""
        a, b, c = (0.5 - 0.5 * math.cos(float(number)) for number in free)
        top = slowest + a * (limits.speed - slowest)
        descent = length * max(b, 1e-3)
        steepest = limits.sink_rate * descent / (1.5 * top)  # that the height may fall on it
        return top, descent, max(lowest + c * (height_start - lowest), height_start - steepest)

    def cost(free: Array) -> float:
        return path_energy(length, bounded(free), height_start, limits, airframe)[0]

    start = np.array([2.2, 2.0, 0.5])
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.5, "maxfev": 200})
    top, descent, height_end = bounded(found.x)
    energy, duration = path_energy(length, (top, descent, height_end), height_start, limits, airframe)
    return EnergyPath(
        height_start=height_start,
        height_end=height_end,
        descent=descent,
        speed=top,
        energy=energy,
        duration=duration,
    )
