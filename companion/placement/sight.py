"""Whether the chaser's camera sees the port from a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_from_quaternion
from companion.geometry.transform import RigidTransform
from companion.perception.docking_port import DockingPort


@dataclass(frozen=True, slots=True, kw_only=True)
class SightParameters:
    """What a camera of the OpenMV H7's kind sees of small light-emitting diodes."""

    # The H7's lens shows 70 by 55 degrees; the cone that fits inside, with a margin for its mount
    half_angle: Annotated[float, Interval(gt=0.0, lt=1.57)] = math.radians(30.0)  # [rad] about the optical axis
    nearest: Annotated[float, Ge(0.0)] = 0.02  # [m] between lens and docking face: nearer, markers leave the picture
    farthest: Annotated[float, Gt(0.0)] = 1.0  # [m] farther, a marker is less than a pixel
    # A light-emitting diode shines to the side as well, but its neighbours hide it
    face_turned: Annotated[float, Interval(gt=0.0, lt=1.57)] = math.radians(75.0)  # [rad] of the face from the camera


def sees_port(
    parameters: SightParameters, d_from_cam: RigidTransform, port: DockingPort, position: Array, quaternion: Array
) -> bool:
    """Say whether the middle of the docking face is in sight: in the cone, not too near or far, turned to the camera.

    Args:
        parameters: of the camera.
        d_from_cam: its mount.
        port: what it is to see.
        position: (3,) [m] of the chaser's centre of mass, in c.
        quaternion: (4,) c_from_d.
    """
    c_from_d = rotation_from_quaternion(quaternion)
    outward = port.outward
    sight = port.position + 0.5 * port.side * outward - position - c_from_d @ d_from_cam.translation
    distance = float(np.linalg.norm(sight))
    if not parameters.nearest < distance <= parameters.farthest:
        return False
    axis = c_from_d @ d_from_cam.rotation[:, 2]
    if float(axis @ sight) < math.cos(parameters.half_angle) * distance:
        return False
    return -float(outward @ sight) >= math.cos(parameters.face_turned) * distance
