"""Outlines of flat things in the camera's view: clipped to the field of view, divided to follow the distortion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from sitl_stub.world.exposure import BoardPose, Scene

Array = npt.NDArray[np.float64]

_NEAREST = 0.02  # [m] in front of the lens
_PIECES = 8  # of each edge
_SHARES: Array = (np.arange(_PIECES) / _PIECES)[:, None]
_LIGHT_DIRECTION = (0.6, 0.8)  # north, east: sides that face it are brighter
_SIDE_GREY = 70.0


def clip_to_view(polygon_cam: Array, widest: Array) -> Array | None:
    """Clip a flat convex polygon (n, 3) [m] in cam to the field of view and divide its edges.

    `widest` (2,) are the tangents of half the field of view. Gives (m, 3) or None where nothing is left
    (Sutherland and Hodgman's method, plane by plane).
    """
    points = [(float(x), float(y), float(z)) for x, y, z in polygon_cam]
    wide, high = float(widest[0]), float(widest[1])
    planes = (
        (0.0, 0.0, 1.0, -_NEAREST),
        (1.0, 0.0, wide, 0.0),
        (-1.0, 0.0, wide, 0.0),
        (0.0, 1.0, high, 0.0),
        (0.0, -1.0, high, 0.0),
    )
    for a, b, c, d in planes:
        points = _clip(points, [a * x + b * y + c * z + d for x, y, z in points])
        if len(points) < 3:
            return None
    corners = np.array(points)
    following = np.roll(corners, -1, axis=0)
    divided: Array = (corners[:, None, :] + _SHARES[None] * (following - corners)[:, None, :]).reshape(-1, 3)
    return divided


def _clip(points: list[tuple[float, float, float]], sides: list[float]) -> list[tuple[float, float, float]]:
    if min(sides, default=0.0) >= 0.0:
        return points
    kept = []
    for index, (point, side) in enumerate(zip(points, sides, strict=True)):
        before, side_before = points[index - 1], sides[index - 1]
        if (side >= 0.0) != (side_before >= 0.0):
            share = side_before / (side_before - side)
            kept.append(
                (
                    before[0] + share * (point[0] - before[0]),
                    before[1] + share * (point[1] - before[1]),
                    before[2] + share * (point[2] - before[2]),
                )
            )
        if side >= 0.0:
            kept.append(point)
    return kept


def visible_sides(scene: Scene, board: BoardPose, size: tuple[float, float]) -> Iterator[tuple[Array, float]]:
    """Give the upright sides of a platform that face the camera: corners (4, 3) [m] in ned, and their grey value."""
    half_x, half_y = 0.5 * size[0], 0.5 * size[1]
    local = np.array([[half_x, -half_y, 0], [half_x, half_y, 0], [-half_x, half_y, 0], [-half_x, -half_y, 0.0]])
    top = board.center_ned + local @ board.ned_from_board.T
    for index in range(4):
        a, b = top[index], top[(index + 1) % 4]
        outward = (b[1] - a[1], -(b[0] - a[0]))  # seen from above the corners run clockwise
        if outward[0] * (scene.camera_ned[0] - a[0]) + outward[1] * (scene.camera_ned[1] - a[1]) <= 0.0:
            continue
        length = float(np.hypot(*outward))
        facing = (outward[0] * _LIGHT_DIRECTION[0] + outward[1] * _LIGHT_DIRECTION[1]) / length
        down = np.array([0.0, 0.0, -board.center_ned[2]])
        yield np.array([a, b, b + down, a + down]), _SIDE_GREY * (1.0 + 0.5 * float(facing))
