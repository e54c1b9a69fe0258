"""The true motion of the vehicle from HIL_STATE_QUATERNION, in the world's frame and without the message's steps."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sitl_stub.truth import Quaternion, Vector

EARTH_RADIUS = 6_371_000.0
"""[m] as PX4's lib/geo."""
DEGREE = math.pi / 180.0
LATITUDE_STEP = 1e-7 * DEGREE * EARTH_RADIUS
"""[m] of one count of the message's latitude."""
ALTITUDE_STEP = 1e-3
PULL = 0.05
"""Speed [m/s] at which the position returns to the cell of the reading once it has left it."""
JUMP = 0.3
"""Beyond this distance [m] from the reading the vehicle was moved, not flown: the reading is taken as it is."""
ACCELERATION_TIME = 0.1
"""Time constant [s] of the acceleration, which is made from velocities in steps of 1 cm/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """True motion at one instant; fields as in `VehicleTruth`."""

    position_ned: Vector
    velocity_ned: Vector
    quaternion: Quaternion
    angular_velocity_frd: Vector
    acceleration_ned: Vector


class PoseTracker:
    """Makes a smooth pose from readings.

    The message's position has steps of 1e-7 deg (11 mm north, less east), which would shake the picture; its velocity
    has steps of 1 cm/s. So the velocity is integrated, and the position pulled back only where it leaves the reading's
    cell. The attitude is a full float; its sign is kept from message to message, as q and -q are the same attitude.

    The first reading is the world's origin: the vehicle stands there, its body `height` [m] above the ground.
    """

    def __init__(self, height: float) -> None:
        self._height = height
        self._origin: tuple[float, float, float] | None = None
        self._t = 0.0
        self._position = [0.0, 0.0, 0.0]
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self._acceleration = [0.0, 0.0, 0.0]

    def follow(self, t: float, message: Any) -> Pose:
        """Take the reading of `t` [s], which must not go back; gives the pose at `t`."""
        velocity = (message.vx * 0.01, message.vy * 0.01, message.vz * 0.01)
        place = (message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
        if self._origin is None:
            self._origin, self._t, self._velocity = place, t, velocity
        steps = (LATITUDE_STEP, LATITUDE_STEP * math.cos(self._origin[0] * DEGREE), ALTITUDE_STEP)
        self._move(t - self._t, velocity, from_origin(self._origin, place), steps)
        self._t, self._velocity = t, velocity
        self._quaternion = _near(self._quaternion, message.attitude_quaternion)
        north, east, down = self._position
        x, y, z = self._acceleration
        return Pose(
            position_ned=(north, east, down - self._height),
            velocity_ned=velocity,
            quaternion=self._quaternion,
            angular_velocity_frd=(message.rollspeed, message.pitchspeed, message.yawspeed),
            acceleration_ned=(x, y, z),
        )

    def _move(self, dt: float, velocity: Vector, reading: Vector, steps: Vector) -> None:
        share = -math.expm1(-dt / ACCELERATION_TIME)
        for axis, step in enumerate(steps):
            if dt > 0.0:
                rate = (velocity[axis] - self._velocity[axis]) / dt
                self._acceleration[axis] += share * (rate - self._acceleration[axis])
            moved = self._position[axis] + 0.5 * (self._velocity[axis] + velocity[axis]) * dt
            off = reading[axis] - moved
            beyond = max(0.0, abs(off) - 0.5 * step)
            if beyond > JUMP:
                self._position[axis] = reading[axis]
            else:
                self._position[axis] = moved + math.copysign(min(beyond, PULL * dt), off)


def from_origin(origin: Vector, place: Vector) -> Vector:
    """Give a place (latitude, longitude [deg], altitude [m]) as north, east, down [m] from another.

    Azimuthal equidistant on a sphere, as PX4's MapProjection (lib/geo/geo.cpp).
    """
    phi0, phi = origin[0] * DEGREE, place[0] * DEGREE
    turn = (place[1] - origin[1]) * DEGREE
    half = math.sin(0.5 * (phi - phi0)) ** 2 + math.cos(phi0) * math.cos(phi) * math.sin(0.5 * turn) ** 2
    angle = 2.0 * math.asin(min(1.0, math.sqrt(half)))
    scale = EARTH_RADIUS * (angle / math.sin(angle) if angle > 0.0 else 1.0)
    # cos(phi0) sin(phi) - sin(phi0) cos(phi) cos(turn), written so that nothing cancels
    north = math.sin(phi - phi0) + 2.0 * math.sin(phi0) * math.cos(phi) * math.sin(0.5 * turn) ** 2
    return scale * north, scale * math.cos(phi) * math.sin(turn), origin[2] - place[2]


def is_attitude(values: Sequence[float]) -> bool:
    """Whether four numbers are a quaternion of about unit norm: PX4 sends zeros before its simulator has started."""
    return 0.9 < math.sqrt(sum(value * value for value in values)) < 1.1


def _near(before: Quaternion, values: Sequence[float]) -> Quaternion:
    """Give the unit quaternion of the same attitude that is next to `before`."""
    w, x, y, z = (float(value) for value in values)
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if w * before[0] + x * before[1] + y * before[2] + z * before[3] < 0.0:
        norm = -norm
    return w / norm, x / norm, y / norm, z / norm
