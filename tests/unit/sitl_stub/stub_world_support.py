"""Scenes for the tests of the simulated world: a vehicle and one pad, at rest or in motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from sitl_stub.truth import Quaternion, TargetTruth, Truth, VehicleTruth
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.world.camera import CameraConfig
from sitl_stub.world.documents import Interval, Section
from sitl_stub.world.exposure import Exposure, Scene
from sitl_stub.world.lens import Intrinsics
from sitl_stub.world.motion import MotionConfig
from sitl_stub.world.pads import Pad, find_pad, load_pad
from sitl_stub.world.targets import StartCondition, TargetConfig

CAMERA = CameraConfig.from_mapping(VehicleConfig.load("x500").camera)
PAD = load_pad(find_pad("landing_pad_0p8"))
HEIGHT = 0.15
HALF = 0.5 * CAMERA.exposure


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    (cr, cp, cy), (sr, sp, sy) = (tuple(f(0.5 * a) for a in (roll, pitch, yaw)) for f in (math.cos, math.sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def target_config(pad: Pad = PAD, *, sides: bool = True) -> TargetConfig:
    here = Interval(0.0, 0.0)
    return TargetConfig(
        name="pad",
        pad=pad,
        height=HEIGHT,
        sides=sides,
        north=here,
        east=here,
        heading=here,
        starts=StartCondition(vehicle_above=-math.inf, after=0.0),
        motion=MotionConfig.read(Section({"kind": "static"}, where="test")),
    )


def truth(
    t: float,
    position: Sequence[float],
    attitude: Sequence[float] = (0.0, 0.0, 0.0),
    pad_position: Sequence[float] = (0.0, 0.0),
    pad_yaw: float = 0.0,
) -> Truth:
    vehicle = VehicleTruth(
        t=t,
        position_ned=(position[0], position[1], position[2]),
        velocity_ned=(0.0, 0.0, 0.0),
        quaternion=quaternion(*attitude),
        angular_velocity_frd=(0.0, 0.0, 0.0),
        acceleration_ned=(0.0, 0.0, 0.0),
        feet_in_contact=0,
        surface="",
        armed=True,
    )
    target = TargetTruth(
        t=t,
        name="pad",
        position_ned=(pad_position[0], pad_position[1], -HEIGHT),
        yaw=pad_yaw,
        velocity_ned=(0.0, 0.0, 0.0),
        yaw_rate=0.0,
        half_size=(0.4, 0.4),
        moving=False,
        started=False,
    )
    return Truth(t=t, vehicle=vehicle, targets=(target,))


def exposure(
    position: Sequence[float],
    attitude: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    rates: Sequence[float] = (0.0, 0.0, 0.0),
    pad_velocity: Sequence[float] = (0.0, 0.0),
    pad_yaw: float = 0.0,
    pad: Pad = PAD,
    camera: CameraConfig = CAMERA,
) -> Exposure:
    """Make an exposure around t = 0: `position` [m] of the body, `attitude` roll, pitch, yaw [rad] and their rates."""
    states = [
        truth(
            t,
            [p + t * v for p, v in zip(position, velocity, strict=True)],
            [a + t * r for a, r in zip(attitude, rates, strict=True)],
            [t * v for v in pad_velocity],
            pad_yaw,
        )
        for t in (-HALF, HALF)
    ]
    return Exposure(states, -HALF, HALF, mount=camera.mount, pads=(pad,))


def above_pad(height: float, north: float = 0.0, east: float = 0.0) -> tuple[float, float, float]:
    """Give the body position with the lens `height` [m] above the pad's surface (level attitude, heading north)."""
    mount = CAMERA.mount.position_frd
    return north - float(mount[0]), east - float(mount[1]), -HEIGHT - height - float(mount[2])


def on_board(scene: Scene, points: np.ndarray, intrinsics: Intrinsics = CAMERA.intrinsics) -> np.ndarray:
    """Project board points (n, 2) [m] exactly to pixels (n, 2)."""
    return intrinsics.project(np.column_stack([points, np.ones(len(points))]) @ scene.plane_in_cam(scene.boards[0]).T)


def edge_offsets(image: np.ndarray, scene: Scene, corners: np.ndarray, reach: float = 2.5) -> np.ndarray:
    """Give by how much [px] each of a tag's four edges lies outside its exact projection, (4,).

    The centroid of the grey gradient across the edge, at 60 places along it, each at the exact (bent) projection.
    """
    centre = on_board(scene, corners.mean(axis=0)[None])[0]
    along = np.linspace(0.15, 0.85, 60)[:, None]
    across = np.arange(-reach, reach + 1e-9, 0.25)
    offsets = []
    for index in range(4):
        a, b = corners[index], corners[(index + 1) % 4]
        at = on_board(scene, a + along * (b - a))
        direction = on_board(scene, a + (along + 1e-4) * (b - a)) - at
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        normal = np.stack([direction[:, 1], -direction[:, 0]], axis=1)
        if normal[30] @ (at[30] - centre) < 0:
            normal = -normal
        points = (at[:, None] + across[None, :, None] * normal[:, None]).astype(np.float32)
        values = cv2.remap(image, points[..., 0], points[..., 1], cv2.INTER_LINEAR)
        gradient = np.diff(values.astype(float), axis=1)
        offsets.append(float((gradient * 0.5 * (across[1:] + across[:-1])).sum() / gradient.sum()))
    return np.array(offsets)
