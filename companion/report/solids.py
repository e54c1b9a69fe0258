"""Cubes and cones of sight, in space and in a projection."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from companion.geometry.arrays import Array

_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_SIDES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))  # indices of corners
_RIM = 20  # points of a cone's rim


def cube_corners(position: Array, rotation: Array, side: float) -> Array:
    """Give the corners (8, 3) [m] of a cube.

    Args:
        position: (3,) [m] of its centre.
        rotation: (3, 3) turns its own axes.
        side: [m].
    """
    corners: Array = position + side * _CORNERS @ rotation.T
    return corners


def cone_points(apex: Array, rotation: Array, half_angle: float, length: float) -> Array:
    """Give apex and rim (21, 3) [m] of a cone about the axis z.

    Args:
        apex: (3,) [m].
        rotation: (3, 3) turns the cone's own axes.
        half_angle: [rad].
        length: [m] of its axis.
    """
    around = np.linspace(0.0, 2.0 * np.pi, _RIM, endpoint=False)
    reach = length * np.tan(half_angle)
    rim = np.column_stack((reach * np.cos(around), reach * np.sin(around), np.full(_RIM, length)))
    return np.vstack((apex, apex + rim @ rotation.T))


def add_cube(axes: Any, corners: Array, colour: str, alpha: float) -> None:
    """Draw a cube's sides in axes of three dimensions."""
    sides = [corners[list(side)] for side in _SIDES]
    axes.add_collection3d(Poly3DCollection(sides, facecolor=colour, edgecolor=colour, linewidth=0.6, alpha=alpha))


def add_cone(axes: Any, points: Array, colour: str, alpha: float) -> None:
    """Draw a cone, as `cone_points` gives it, in axes of three dimensions."""
    apex, rim = points[0], points[1:]
    sides = [np.array([apex, rim[index - 1], rim[index]]) for index in range(len(rim))]
    axes.add_collection3d(Poly3DCollection(sides, facecolor=colour, edgecolor="none", alpha=alpha))


def add_shadow(axes: Any, points: Array, colour: str, alpha: float) -> None:
    """Draw the outline of a convex body in a projection.

    Args:
        axes: of two dimensions.
        points: (n, 2) [m] its corners, projected.
        colour: of the body.
        alpha: of its inside.
    """
    outline = points[ConvexHull(points).vertices]
    axes.add_patch(Polygon(outline, closed=True, facecolor=colour, edgecolor="none", alpha=alpha, zorder=2))
    axes.add_patch(Polygon(outline, closed=True, fill=False, edgecolor=colour, linewidth=0.8, zorder=3))
