"""When the two cubes touch, how, and whether that counts as docked.

Coming in over the docking face, the contact is where the chaser's centre reaches the docked distance from the target's
plane; a cube that is turned or beside the face touches with a corner or an edge, and that is a collision wherever it
happens: two boxes overlap unless one of 15 axes separates them (Gottschalk, Lin, Manocha 1996).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sitl_stub.cubesat.as_built import PlacedTarget
from sitl_stub.cubesat.rotation import Matrix, angle_of, dot, matrix_of, minus, plus
from sitl_stub.cubesat.world import DockedFile
from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.attitude_control import conjugate, multiply

DOCKING_FACE, COLLISION = "docking_face", "collision"
CORRIDOR_TILT = math.radians(15.0)
"""A chaser turned farther than this [rad] from the docking face meets the target with an edge."""
_PARALLEL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """How the chaser touched the target."""

    t: float
    """[s], interpolated between the steps"""
    kind: str
    """"docking_face" or "collision"."""
    position_error: Vector
    """Centre of the cube minus its docked place [m], in c."""
    attitude_error: float
    """Angle from the docking attitude [rad]."""
    closing_speed: float
    """Of the docking face's centre towards the target's face [m/s]."""
    lateral_speed: float
    """Of the docking face's centre along the target's face [m/s]."""
    docked: bool
    """Whether it counts: on the docking face, and all four within the world's limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """True motion of the chaser at one instant."""

    t: float
    position: Vector
    """Centre of the cube [m], in c."""
    velocity: Vector
    """[m/s], in c."""
    quaternion: Quaternion
    """c_from_d"""
    rate: Vector
    """[rad/s], in d."""


class ContactWatch:
    """Looks at each step of the chaser near the target."""

    def __init__(self, target: PlacedTarget, target_side: float, chaser_side: float, limits: DockedFile) -> None:
        self._target, self._limits = target, limits
        self._target_half, self._chaser_half = 0.5 * target_side, 0.5 * chaser_side
        self._rows = matrix_of(target.quaternion)
        self._normal = (self._rows[0][2], self._rows[1][2], self._rows[2][2])
        self._docked_distance = self._target_half + self._chaser_half
        self.docked_place = plus(target.position, self._normal, self._docked_distance)
        """Where the centre of the chaser's cube is when it has docked [m], in c."""
        self._reach = math.sqrt(3.0) * self._docked_distance

    def near(self, position: Vector) -> bool:
        """Whether the spheres around the cubes overlap, so that a step must be looked at."""
        return math.dist(position, self._target.position) < self._reach

    def look(self, before: Pose, after: Pose) -> tuple[Contact, Pose] | None:
        """Give the contact between two poses, and the pose at it; None: they do not touch."""
        if self._over_the_face(before):
            ahead, beyond = self._ahead(before.position), self._ahead(after.position)
            if beyond > self._docked_distance:
                return None
            passed = ahead - beyond
            share = (ahead - self._docked_distance) / passed if passed > 0.0 else 0.0
            pose = _between(before, after, min(1.0, max(0.0, share)))
            return self._contact(pose, DOCKING_FACE), pose
        if self._overlap(after):
            return self._contact(after, COLLISION), after
        return None

    def _ahead(self, position: Vector) -> float:
        return dot(self._normal, minus(position, self._target.position))

    def _over_the_face(self, pose: Pose) -> bool:
        """Whether the chaser comes in over the docking face, that face towards it."""
        offset = minus(pose.position, self._target.position)
        ahead = dot(self._normal, offset)
        if ahead < self._docked_distance or math.hypot(*plus(offset, self._normal, -ahead)) > self._target_half:
            return False
        (_, _, x), (_, _, y), (_, _, z) = matrix_of(pose.quaternion)
        return dot(self._normal, (x, y, z)) > math.cos(CORRIDOR_TILT)

    def _contact(self, pose: Pose, kind: str) -> Contact:
        error = minus(pose.position, self.docked_place)
        attitude_error = angle_of(multiply(conjugate(self._target.quaternion), pose.quaternion))
        face = _face_velocity(pose, self._chaser_half)
        closing = -dot(self._normal, face)
        lateral = math.hypot(*plus(face, self._normal, closing))
        limits = self._limits
        docked = (
            kind == DOCKING_FACE
            and math.hypot(*error) <= limits.position_error_max
            and attitude_error <= limits.attitude_error_max
            and closing <= limits.closing_speed_max
            and lateral <= limits.lateral_speed_max
        )
        return Contact(
            t=pose.t,
            kind=kind,
            position_error=error,
            attitude_error=attitude_error,
            closing_speed=closing,
            lateral_speed=lateral,
            docked=docked,
        )

    def _overlap(self, pose: Pose) -> bool:
        mine, other = _columns(matrix_of(pose.quaternion)), _columns(self._rows)
        offset = minus(pose.position, self._target.position)
        axes = [*mine, *other, *(_cross_unit(a, b) for a in mine for b in other)]
        return not any(
            abs(dot(axis, offset)) > self._chaser_half * _extent(axis, mine) + self._target_half * _extent(axis, other)
            for axis in axes
            if axis is not None
        )


def _columns(rows: Matrix) -> tuple[Vector, Vector, Vector]:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return ((a, d, g), (b, e, h), (c, f, i))


def _cross_unit(a: Vector, b: Vector) -> Vector | None:
    """Give the unit vector across both; None where they are parallel."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = math.hypot(x, y, z)
    return None if size < _PARALLEL else (x / size, y / size, z / size)


def _extent(axis: Vector, edges: tuple[Vector, Vector, Vector]) -> float:
    """How far a cube of half side 1 reaches along `axis`."""
    return abs(dot(axis, edges[0])) + abs(dot(axis, edges[1])) + abs(dot(axis, edges[2]))


def _face_velocity(pose: Pose, half_side: float) -> Vector:
    """Velocity [m/s] in c of the centre of the chaser's docking face, its side -z."""
    rx, ry, _ = pose.rate
    (a, b, _), (d, e, _), (g, h, _) = matrix_of(pose.quaternion)
    x, y = -ry * half_side, rx * half_side  # rate cross (0, 0, -half side)
    vx, vy, vz = pose.velocity
    return (vx + a * x + b * y, vy + d * x + e * y, vz + g * x + h * y)


def _between(before: Pose, after: Pose, share: float) -> Pose:
    def mixed(a: float, b: float) -> float:
        return a + share * (b - a)

    w, x, y, z = (mixed(a, b) for a, b in zip(before.quaternion, after.quaternion, strict=True))
    size = math.sqrt(w * w + x * x + y * y + z * z)
    return Pose(
        t=mixed(before.t, after.t),
        position=plus(before.position, minus(after.position, before.position), share),
        velocity=plus(before.velocity, minus(after.velocity, before.velocity), share),
        quaternion=(w / size, x / size, y / size, z / size),
        rate=plus(before.rate, minus(after.rate, before.rate), share),
    )
