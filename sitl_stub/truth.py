"""The true state of the simulated world: what a perfect observer would see.

Vectors are plain tuples of floats (the simulator's hot loop is scalar Python); `numpy.array(v)` makes an array of one.
"""

from dataclasses import dataclass
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

GROUND = "ground"
"""Name of the surface that is no target."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleTruth:
    """True state of the vehicle at one instant."""

    t: float
    """Simulation time [s]."""
    position_ned: Vector
    """Body origin, from the world's origin (ground level at the start point) [m], frame ned."""
    velocity_ned: Vector
    """Velocity of the body origin over ground [m/s], frame ned."""
    quaternion: Quaternion
    """Attitude ned_from_frd, (w, x, y, z), unit norm."""
    angular_velocity_frd: Vector
    """Turn rate of the body against ned [rad/s], frame frd."""
    acceleration_ned: Vector
    """Acceleration of the body origin, gravity included (zero at rest) [m/s^2], frame ned."""
    feet_in_contact: int
    """How many of the landing gear's feet press on a surface, 0 to 4."""
    surface: str
    """What the touching feet stand on: a target's name, "ground", or "" in the air. When they stand on different
    surfaces, "ground"."""
    armed: bool
    """True while the motors may turn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTruth:
    """True state of one platform at one instant."""

    t: float
    """Simulation time [s]."""
    name: str
    position_ned: Vector
    """The landing point on the top surface, from the world's origin [m], frame ned."""
    yaw: float
    """Landing heading from north, clockwise [rad], not wrapped."""
    velocity_ned: Vector
    """Velocity of the landing point [m/s], frame ned."""
    yaw_rate: float
    """[rad/s]"""
    half_size: tuple[float, float]
    """Half the platform's sides, along the board's x and y [m]."""
    moving: bool
    """Whether it moves or turns now."""
    started: bool
    """Whether its motion has begun (and perhaps ended)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """True state of vehicle and targets at one instant."""

    t: float
    """Simulation time [s]."""
    vehicle: VehicleTruth
    targets: tuple[TargetTruth, ...]
    """One per target, in the order of the world file."""
