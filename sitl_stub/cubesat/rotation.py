"""Turns in space as scalars: quaternions (w, x, y, z) with Hamilton's product, matrices as rows of triples.

Scalar Python on purpose: numpy on vectors of three is several times slower in the simulator's step.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.attitude_control import multiply

Matrix: TypeAlias = tuple[Vector, Vector, Vector]
"""Rows of a rotation matrix."""


def normalised(q: Quaternion) -> Quaternion:
    """Give `q` with unit norm."""
    size = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * size, q[1] * size, q[2] * size, q[3] * size)


def from_rotation_vector(vector: Vector) -> Quaternion:
    """Give the turn about `vector` by its length [rad]."""
    angle = math.hypot(*vector)
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), vector[0] * scale, vector[1] * scale, vector[2] * scale)


def angle_of(q: Quaternion) -> float:
    """Give the angle [rad] of a turn, 0 to pi."""
    return 2.0 * math.atan2(math.hypot(q[1], q[2], q[3]), abs(q[0]))


def matrix_of(q: Quaternion) -> Matrix:
    """Give the rotation matrix of a unit quaternion."""
    w, x, y, z = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, xy, xz, yy, yz, zz = x * x2, x * y2, x * z2, y * y2, y * z2, z * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return (1.0 - yy - zz, xy - wz, xz + wy), (xy + wz, 1.0 - xx - zz, yz - wx), (xz - wy, yz + wx, 1.0 - xx - yy)


def turned(rows: Matrix, vector: Vector) -> Vector:
    """Give the matrix times `vector`."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    x, y, z = vector
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def turned_back(rows: Matrix, vector: Vector) -> Vector:
    """Give the transposed matrix times `vector`."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    x, y, z = vector
    return (a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z)


def printed_attitude(angles_deg: Vector) -> Quaternion:
    """Read an orientation (a, b, c) [deg] as Parikh et al. print it: as the direction cosine matrix of a body.

    `c_from_body = (Rz(c) Ry(b) Rx(a))^T = Rx(-a) Ry(-b) Rz(-c)`, with R proper rotations of vectors.
    """
    a, b, c = (-math.radians(angle) for angle in angles_deg)
    about_yz = multiply(from_rotation_vector((0.0, b, 0.0)), from_rotation_vector((0.0, 0.0, c)))
    return multiply(from_rotation_vector((a, 0.0, 0.0)), about_yz)


def cross(a: Vector, b: Vector) -> Vector:
    """Give the cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> float:
    """Give the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Give a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def plus(a: Vector, b: Vector, scale: float = 1.0) -> Vector:
    """Give a + scale b."""
    return (a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2])
