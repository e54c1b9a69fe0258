"""A docking in space, and in two projections: path, port, anchors and what the camera looks at."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_from_quaternion
from companion.report.docking_series import DockingRun
from companion.report.solids import add_cone, add_cube, add_shadow, cone_points, cube_corners
from companion.report.style import FAINT, GOOD, INK, PAD, mode_colour

_CONE_LENGTH = 0.3  # [m]
_MARGIN = 0.15  # [m] round all that is drawn
_NEAR = 0.28  # [m] round the docked place: what is round the port
_BLIND = "#b9c3cc"
_AXES = "xyz"


def draw_space(axes: Any, run: DockingRun) -> None:
    """Draw everything in three dimensions; the path has the colours of the modes."""
    scene = run.scene
    pieces, colours = _pieces(run)
    axes.add_collection3d(Line3DCollection(pieces, colors=colours, linewidths=2.4))
    for position, rotation, seeing in _stations(run):
        add_cube(axes, cube_corners(position, rotation, scene.target_side), INK, 0.25)
        add_cone(axes, _cone(run, position, rotation), GOOD if seeing else _BLIND, 0.16)
    target = cube_corners(scene.target_position, rotation_from_quaternion(scene.target_quaternion), scene.target_side)
    add_cube(axes, target, PAD, 0.55)
    axes.plot(*scene.anchors.T, "^", color=FAINT, markersize=6, linestyle="none")
    axes.plot(*run.truth.position[:1].T, "o", color=INK, markersize=4)
    low, high = _bounds(run)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.set_box_aspect(high - low, zoom=1.15)
    axes.tick_params(labelsize=7)
    axes.view_init(elev=20.0, azim=-55.0)
    axes.text2D(-0.06, 1.03, "In the frame of the anchors", transform=axes.transAxes, fontsize=10, fontweight="bold")
    words = "chaser and its camera's cone where each mode begins: green where the port is in sight; triangles: anchors"
    axes.text2D(-0.06, 0.99, words, transform=axes.transAxes, fontsize=7.5, color=FAINT)


def draw_projection(axes: Any, run: DockingRun, across: int, upward: int, *, near: bool = False) -> None:
    """Draw everything as seen along the remaining axis.

    Args:
        axes: of two dimensions.
        run: the docking.
        across: which axis of c lies across, 0 to 2.
        upward: which one lies upward.
        near: only what is round the port.
    """
    scene, picked = run.scene, [across, upward]
    pieces, colours = _pieces(run)
    for position, rotation, seeing in _stations(run):
        add_shadow(axes, _cone(run, position, rotation)[:, picked], GOOD if seeing else _BLIND, 0.14)
        add_shadow(axes, cube_corners(position, rotation, scene.target_side)[:, picked], INK, 0.15)
    target = cube_corners(scene.target_position, rotation_from_quaternion(scene.target_quaternion), scene.target_side)
    add_shadow(axes, target[:, picked], PAD, 0.5)
    flat = [piece[:, picked] for piece in pieces]
    axes.add_collection(LineCollection(flat, colors=colours, linewidths=2.2, zorder=4, capstyle="round"))
    axes.plot(scene.anchors[:, across], scene.anchors[:, upward], "^", color=FAINT, markersize=6, zorder=3)
    axes.plot(*run.truth.position[0, picked], "o", color=INK, markersize=4, zorder=5)
    middle = scene.docked_position
    low, high = (middle - _NEAR, middle + _NEAR) if near else _bounds(run)
    axes.set(xlim=(low[across], high[across]), ylim=(low[upward], high[upward]))
    axes.set_aspect("equal")
    axes.set(xlabel=f"{_AXES[across]} [m]", ylabel=f"{_AXES[upward]} [m]")
    axes.set_title(f"{'At the port, along' if near else 'Along'} {_AXES[3 - across - upward]}", loc="left")


def _pieces(run: DockingRun) -> tuple[list[Array], list[str]]:
    """Cut the path at the changes of mode; neighbours share a point."""
    pieces, colours = [], []
    for span in run.modes:
        first, last = np.searchsorted(run.t, (span.start - 1e-6, span.end + 1e-6))
        if last - first > 1:
            pieces.append(run.truth.position[first:last])
            colours.append(mode_colour(span.mode))
    return pieces, colours


def _stations(run: DockingRun) -> list[tuple[Array, Array, bool]]:
    """Give place, attitude and sight of the chaser at the start of each mode that turns or moves it."""
    found = []
    for span in run.modes:
        if span.mode in ("approach", "reorient", "align", "dock"):
            at = min(int(np.searchsorted(run.t, span.start)), len(run.t) - 1)
            rotation = rotation_from_quaternion(run.truth.quaternion[at])
            found.append((run.truth.position[at], rotation, bool(run.seen[1][at])))
    return found


def _cone(run: DockingRun, position: Array, rotation: Array) -> Array:
    scene = run.scene
    turned = rotation @ rotation_from_quaternion(scene.camera_quaternion)
    return cone_points(position + rotation @ scene.camera_position, turned, scene.camera_half_angle, _CONE_LENGTH)


def _bounds(run: DockingRun) -> tuple[Array, Array]:
    everything = np.vstack((run.truth.position, run.scene.anchors, run.scene.target_position[None, :]))
    return everything.min(axis=0) - _MARGIN, everything.max(axis=0) + _MARGIN
