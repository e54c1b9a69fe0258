"""Rotations.

A rotation is named `a_from_b`: it takes coordinates in frame b to coordinates in frame a, so neighbours cancel.
Quaternions are (w, x, y, z), Hamilton, unit. Euler angles are the aerospace sequence: yaw about z, then pitch about
y, then roll about x.
"""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.quaternions import rotation_of


def skew(v: Array) -> Array:
    """Give the matrix with `skew(v) @ u == cross(v, u)`. `v`: (3,)."""
    x, y, z = float(v[0]), float(v[1]), float(v[2])
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_about_z(angle: float) -> Array:
    """Give the rotation by `angle` [rad] about z, (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_euler(roll: float, pitch: float, yaw: float) -> Array:
    """Give `ned_from_frd` (3, 3) for roll, pitch, yaw [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def euler_from_rotation(rotation: Array) -> tuple[float, float, float]:
    """Give roll, pitch, yaw [rad] of `ned_from_frd` (3, 3)."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    roll = math.atan2(float(rotation[2, 1]), float(rotation[2, 2]))
    return roll, pitch, yaw_of(rotation)


def yaw_of(rotation: Array) -> float:
    """Give the heading [rad] of the x axis of the rotated frame, seen in the horizontal plane. `rotation`: (3, 3)."""
    return math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))


def rotation_from_quaternion(quaternion: Array) -> Array:
    """Give the rotation (3, 3) of a unit quaternion (w, x, y, z)."""
    return rotation_of(quaternion.tolist())


def quaternion_from_rotation(rotation: Array) -> Array:
    """Give the unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3)."""
    m = rotation
    candidates = np.array(
        [
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    k = int(np.argmax(candidates))
    r = math.sqrt(max(float(candidates[k]), 1e-30))
    s = 0.5 / r
    if k == 0:
        q = np.array([0.5 * r, (m[2, 1] - m[1, 2]) * s, (m[0, 2] - m[2, 0]) * s, (m[1, 0] - m[0, 1]) * s])
    elif k == 1:
        q = np.array([(m[2, 1] - m[1, 2]) * s, 0.5 * r, (m[0, 1] + m[1, 0]) * s, (m[0, 2] + m[2, 0]) * s])
    elif k == 2:
        q = np.array([(m[0, 2] - m[2, 0]) * s, (m[0, 1] + m[1, 0]) * s, 0.5 * r, (m[1, 2] + m[2, 1]) * s])
    else:
        q = np.array([(m[1, 0] - m[0, 1]) * s, (m[0, 2] + m[2, 0]) * s, (m[1, 2] + m[2, 1]) * s, 0.5 * r])
    unit: Array = q / np.linalg.norm(q)
    return unit if unit[0] >= 0.0 else -unit


def rotation_from_vector(vector: Array) -> Array:
    """Give the rotation (3, 3) by the angle |vector| [rad] about `vector` (3,): the exponential map."""
    angle = float(np.linalg.norm(vector))
    k = skew(vector)
    if angle < 1e-8:
        return np.eye(3) + k + 0.5 * (k @ k)
    a = math.sin(angle) / angle
    b = (1.0 - math.cos(angle)) / (angle * angle)
    result: Array = np.eye(3) + a * k + b * (k @ k)
    return result


def vector_from_rotation(rotation: Array) -> Array:
    """Give the rotation vector (3,) [rad] of a rotation (3, 3): the logarithm, valid up to half a turn."""
    q = quaternion_from_rotation(rotation)
    sine = float(np.linalg.norm(q[1:]))
    if sine < 1e-12:
        return 2.0 * q[1:]
    result: Array = q[1:] * (2.0 * math.atan2(sine, float(q[0])) / sine)
    return result


def slerp(a: Array, b: Array, fraction: float) -> Array:
    """Interpolate between two rotations (3, 3); `fraction` 0 gives `a`, 1 gives `b`, outside extrapolates."""
    return a @ rotation_from_vector(fraction * vector_from_rotation(a.T @ b))
