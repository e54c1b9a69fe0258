"""Poses of the pad that explain the corners of its tags: where to begin, and the refinement over all corners.

A flat square seen from afar has two poses that fit almost equally well (Collins and Bartoli, "Infinitesimal Plane-Based
Pose Estimation", 2014). OpenCV's IPPE gives both; tags on the upright faces of a body are not in one plane, and each
gives where to begin by itself. Each beginning is then refined over all corners by Levenberg-Marquardt,

    minimise sum_i r_i' r_i,   r_i = W_i (pi(R X_i + t) - u_i),   W_i = D_i / sigma_i

with X_i the corner in `pad`, u_i the ray of its pixel, pi(x, y, z) = (x/z, y/z), and D_i the derivative of the pixel by
the ray: to first order r_i is the reprojection error in pixels over its standard deviation, lens included. The pose is
perturbed as t + dt, exp(dr) R.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.messages.perception import TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pose_parameters import PoseParameters

Flags = NDArray[np.bool_]
Pose = tuple[Array, Array]  # rotation (3, 3) and translation (3,) of cam_from_pad

_TURNS = (np.eye(3), rotation_about_z(0.7), rotation_about_z(1.9))


@dataclass(slots=True, eq=False)
class Points:
    """The corners of T tags, prepared for the solver."""

    tags: list[TagDetection]
    model: Array  # (T, 4, 3) [m] in `pad`
    rays: Array  # (T, 4, 2) x/z and y/z in `cam`
    whitening: Array  # (T, 4, 2, 2): D / sigma
    sigma: Array  # (T,) [px]
    focal_length: float  # [px]

    @classmethod
    def of(cls, pad: Pad, tags: list[TagDetection], camera: CameraModel, parameters: PoseParameters) -> Points:
        """Prepare tags of the pad; those with a corner outside the calibrated field are left out."""
        corners = np.stack([tag.corners for tag in tags])
        flat = camera.undistort(corners.reshape(-1, 2))
        rays = flat.reshape(-1, 4, 2)
        sigma = np.array([max(tag.corner_sigma, parameters.smallest_sigma) for tag in tags])
        seen: Flags = np.asarray(np.isfinite(rays).all(axis=(1, 2)))
        with np.errstate(invalid="ignore"):
            jacobian = camera.jacobian(flat).reshape(-1, 4, 2, 2)
        whole = cls(
            tags=tags,
            model=np.stack([pad.corners[tag.id] for tag in tags]),
            rays=rays,
            whitening=jacobian / sigma[:, None, None, None],
            sigma=sigma,
            focal_length=camera.focal_length,
        )
        return whole if bool(seen.all()) else whole.only(seen)

    def only(self, chosen: Flags) -> Points:
        """Keep the tags where `chosen` (T,) is true."""
        return Points(
            tags=[tag for tag, keep in zip(self.tags, chosen, strict=True) if keep],
            model=self.model[chosen],
            rays=self.rays[chosen],
            whitening=self.whitening[chosen],
            sigma=self.sigma[chosen],
            focal_length=self.focal_length,
        )


@dataclass(slots=True, eq=False)
class PoseSolution:
    """One refined pose."""

    rotation: Array  # (3, 3)
    translation: Array  # (3,)
    information: Array  # (6, 6)
    squares: float  # sum of squared normalised errors
    errors: Array  # (T, 4, 2) normalised errors

    @property
    def pose(self) -> Pose:
        """Rotation and translation of cam_from_pad."""
        return self.rotation, self.translation


def seeds_of(points: Points, parameters: PoseParameters) -> list[Pose]:
    """Give where to begin; none where the corners are degenerate.

    Tags that lie in the pad's plane: the two poses of IPPE over all corners. Tags on upright faces: those of the two
    that look largest, each by itself.
    """
    if not points.model[..., 2].any():
        return _seeds_on_plane(points, parameters)
    across = points.rays[:, 2] - points.rays[:, 0]
    down = points.rays[:, 3] - points.rays[:, 1]
    area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0])
    seeds: list[Pose] = []
    for index in np.argsort(-area, kind="stable")[:2].tolist():
        corners = points.model[index]
        right, back = corners[1] - corners[0], corners[0] - corners[3]
        y, x = right / np.linalg.norm(right), back / np.linalg.norm(back)
        pad_from_tag = np.column_stack((x, y, np.cross(x, y)))
        center = corners.mean(axis=0)
        alone = points.only(np.arange(len(points.tags)) == index)
        alone.model = (alone.model - center) @ pad_from_tag
        alone.model[..., 2] = 0.0
        for rotation, translation in _seeds_on_plane(alone, parameters):
            turned = rotation @ pad_from_tag.T
            if _before_camera(turned, translation - turned @ center, points.model, parameters):
                seeds.append((turned, translation - turned @ center))
    return seeds


def _seeds_on_plane(points: Points, parameters: PoseParameters) -> list[Pose]:
    """Give the two poses of IPPE over corners with z = 0; none where they are degenerate.

    OpenCV's IPPE gives NaN for some sound corners, where a square root's argument is rounded below zero; asked in board
    coordinates turned about the normal it does not round the same way.
    """
    model = points.model.reshape(-1, 3)
    rays = np.ascontiguousarray(points.rays.reshape(-1, 1, 2))
    best: list[Pose] = []
    for turn in _TURNS:
        seeds = [
            (rotation @ turn, translation)
            for rotation, translation in _ippe(model @ turn.T, rays)
            if _before_camera(rotation @ turn, translation, points.model, parameters)
        ]
        if len(seeds) == 2:
            return seeds
        if len(seeds) > len(best):
            best = seeds
    return best


def _ippe(model: Array, rays: Array) -> list[Pose]:
    """Give the finite poses among the two of OpenCV's IPPE."""
    try:
        found, rotations, translations, _ = cv2.solvePnPGeneric(
            np.ascontiguousarray(model), rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return []
    if not found:
        return []
    poses = []
    for vector, translation in zip(rotations, translations, strict=True):
        if np.isfinite(vector).all() and np.isfinite(translation).all():
            rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
            poses.append((rotation, np.asarray(translation, dtype=np.float64).ravel()))
    return poses


def _before_camera(rotation: Array, translation: Array, model: Array, parameters: PoseParameters) -> bool:
    depth = model @ rotation[2] + translation[2]
    return bool((depth > parameters.nearest).all())


def refined_poses(points: Points, seeds: list[Pose], parameters: PoseParameters) -> list[PoseSolution]:
    """Refine each seed over all corners; best first."""
    solutions = []
    for rotation, translation in seeds:
        solution = _levenberg_marquardt(points, rotation, translation, parameters)
        if solution is not None:
            solutions.append(solution)
    solutions.sort(key=lambda solution: solution.squares)
    return solutions


def _levenberg_marquardt(
    points: Points, rotation: Array, translation: Array, parameters: PoseParameters
) -> PoseSolution | None:
    model = points.model.reshape(-1, 3)
    rays = points.rays.reshape(-1, 2)
    whitening = points.whitening.reshape(-1, 2, 2)
    errors, jacobian = _errors(model, rays, whitening, rotation, translation)
    squares = float(errors @ errors)
    damping = 1e-6
    for _ in range(parameters.iterations):
        information = jacobian.T @ jacobian
        gradient = jacobian.T @ errors
        scaled = information.copy()
        scaled.flat[::7] *= 1.0 + damping
        try:
            step = np.linalg.solve(scaled, -gradient)
        except np.linalg.LinAlgError:
            return None
        trial_rotation = cv2.Rodrigues(step[3:])[0] @ rotation
        trial_translation = translation + step[:3]
        if _before_camera(trial_rotation, trial_translation, model, parameters):
            trial_errors, trial_jacobian = _errors(model, rays, whitening, trial_rotation, trial_translation)
            trial_squares = float(trial_errors @ trial_errors)
        else:
            trial_squares = math.inf
        if trial_squares <= squares:
            gained = squares - trial_squares
            rotation, translation, errors, jacobian = trial_rotation, trial_translation, trial_errors, trial_jacobian
            squares, damping = trial_squares, 0.1 * damping
            if gained <= 1e-9 + 1e-7 * squares:
                break
        else:
            damping = max(10.0 * damping, 1e-4)
            if damping > 1e8:
                break
    if not (math.isfinite(squares) and _before_camera(rotation, translation, model, parameters)):
        return None
    return PoseSolution(
        rotation=rotation,
        translation=translation,
        information=jacobian.T @ jacobian,
        squares=squares,
        errors=errors.reshape(-1, 4, 2),
    )


def _errors(model: Array, rays: Array, whitening: Array, rotation: Array, translation: Array) -> tuple[Array, Array]:
    """Give the normalised errors (2M,) and their derivatives (2M, 6) by [dt, dr]."""
    turned = model @ rotation.T
    seen = turned + translation
    inverse_depth = 1.0 / seen[:, 2]
    plane = seen[:, :2] * inverse_depth[:, None]
    errors = np.matmul(whitening, (plane - rays)[:, :, None])[:, :, 0]
    # derivative of the whitened projection by the point in cam: W / z [I, -plane]
    by_point = np.empty((len(model), 2, 3))
    by_point[:, :, :2] = whitening * inverse_depth[:, None, None]
    by_point[:, :, 2] = -np.matmul(by_point[:, :, :2], plane[:, :, None])[:, :, 0]
    jacobian = np.empty((len(model), 2, 6))
    jacobian[:, :, :3] = by_point
    # d(exp(dr) R X) = dr x (R X): row a of the derivative becomes (R X) x a
    x, y, z = turned[:, 0:1], turned[:, 1:2], turned[:, 2:3]
    jacobian[:, :, 3] = y * by_point[:, :, 2] - z * by_point[:, :, 1]
    jacobian[:, :, 4] = z * by_point[:, :, 0] - x * by_point[:, :, 2]
    jacobian[:, :, 5] = x * by_point[:, :, 1] - y * by_point[:, :, 0]
    return errors.ravel(), jacobian.reshape(-1, 6)
