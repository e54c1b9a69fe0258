"""Pose of the pad from all its tags' corners: both poses that explain them, each with its covariance.

A flat square seen from afar has two poses that fit almost equally well (Collins and Bartoli, "Infinitesimal Plane-Based
Pose Estimation", 2014). OpenCV's IPPE gives both; tags on the upright faces of a body are not in one plane, and each
gives where to begin by itself. Each beginning is then refined over all corners by Levenberg-Marquardt,

    minimise sum_i r_i' r_i,   r_i = W_i (pi(R X_i + t) - u_i),   W_i = D_i / sigma_i

with X_i the corner in `pad`, u_i the ray of its pixel, pi(x, y, z) = (x/z, y/z), and D_i the derivative of the pixel by
the ray: to first order r_i is the reprojection error in pixels over its standard deviation, lens included. The pose is
perturbed as t + dt, exp(dr) R, and its covariance is (J' J)^-1 in the order [dt, dr]. Where the corners scatter more
than their sigma promises, the covariance grows with them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray
from scipy.special import chdtri

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.messages.perception import PoseHypothesis, TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad

Flags = NDArray[np.bool_]
Pose = tuple[Array, Array]  # rotation (3, 3) and translation (3,) of cam_from_pad

_TURNS = (np.eye(3), rotation_about_z(0.7), rotation_about_z(1.9))


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseParameters:
    """Tuning of the pose from corners."""

    iterations: Annotated[int, Interval(ge=1, le=50)] = 12  # at most; stops when the step is negligible
    # a second pose this much worse (difference of squared normalised errors) is impossible: exp(-30/2) = 3e-7
    impossible: Annotated[float, Gt(0.0)] = 30.0
    same_rotation: Annotated[float, Gt(0.0)] = 1e-3  # [rad] poses nearer than this are one
    # a tag disagrees with the others when its corners are off by more than this many sigmas ...
    disagreement_sigmas: Annotated[float, Gt(1.0)] = 6.0
    # ... and by more than the pad may have been printed wrong
    disagreement: Annotated[float, Ge(0.0)] = 0.004  # [m]
    disagreement_px: Annotated[float, Ge(0.0)] = 0.5  # [px] and never less than this
    nearest: Annotated[float, Gt(0.0)] = 0.01  # [m] a pad nearer than this cannot be seen
    smallest_sigma: Annotated[float, Gt(0.0)] = 0.01  # [px] smaller corner sigmas are not believed
    quantile: Annotated[float, Interval(gt=0.5, lt=1.0)] = 0.99  # of the scatter from which the covariance grows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PadPose:
    """What the corners of one frame say of the pad."""

    hypotheses: tuple[PoseHypothesis, ...]  # best first; empty where no pose could be found
    used: tuple[TagDetection, ...]  # the tags that agree
    rejected: tuple[TagDetection, ...]  # tags of the pad that disagree with the others
    reason: str  # why there is no pose, "" where there is one


def solve_pad_pose(
    pad: Pad, detections: Sequence[TagDetection], camera: CameraModel, parameters: PoseParameters
) -> PadPose:
    """Find the poses of the pad.

    Args:
        pad: the pad.
        detections: tags seen in one frame; tags of other pads are ignored. An id may occur twice (one of them is then
            false, or there are two pads): those that agree with the others are used, and where nothing decides
            between them there is no pose.
        camera: the calibrated camera.
        parameters: tuning.
    """
    tags = [tag for tag in detections if tag.id in pad.corners and _sound(tag)]
    if not tags:
        return PadPose(hypotheses=(), used=(), rejected=(), reason="no tag of the pad")
    points = _Points.of(pad, tags, camera, parameters)
    if len(points.tags) == 0:
        return PadPose(hypotheses=(), used=(), rejected=tuple(tags), reason="corners outside the calibrated field")
    unique = len({tag.id for tag in points.tags}) == len(points.tags)
    if unique:
        poses = _refine(points, _seeds(points, parameters), parameters)
        if poses and _agreeing(points, poses[0], parameters).all():
            return _answer(points, poses, parameters, rejected=())
    return _by_consensus(points, parameters)


@dataclass(slots=True, eq=False)
class _Points:
    """The corners of T tags, prepared for the solver."""

    tags: list[TagDetection]
    model: Array  # (T, 4, 3) [m] in `pad`
    rays: Array  # (T, 4, 2) x/z and y/z in `cam`
    whitening: Array  # (T, 4, 2, 2): D / sigma
    sigma: Array  # (T,) [px]
    focal_length: float  # [px]

    @classmethod
    def of(cls, pad: Pad, tags: list[TagDetection], camera: CameraModel, parameters: PoseParameters) -> _Points:
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

    def only(self, chosen: Flags) -> _Points:
        """Keep the tags where `chosen` (T,) is true."""
        return _Points(
            tags=[tag for tag, keep in zip(self.tags, chosen, strict=True) if keep],
            model=self.model[chosen],
            rays=self.rays[chosen],
            whitening=self.whitening[chosen],
            sigma=self.sigma[chosen],
            focal_length=self.focal_length,
        )


@dataclass(slots=True, eq=False)
class _Solution:
    """One refined pose."""

    rotation: Array  # (3, 3)
    translation: Array  # (3,)
    information: Array  # (6, 6)
    squares: float  # sum of squared normalised errors
    errors: Array  # (T, 4, 2) normalised errors


def _sound(tag: TagDetection) -> bool:
    return bool(np.isfinite(tag.corners).all()) and math.isfinite(tag.corner_sigma) and tag.corner_sigma > 0.0


def _seeds(points: _Points, parameters: PoseParameters) -> list[Pose]:
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


def _seeds_on_plane(points: _Points, parameters: PoseParameters) -> list[Pose]:
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


def _refine(points: _Points, seeds: list[Pose], parameters: PoseParameters) -> list[_Solution]:
    """Refine each seed over all corners; best first."""
    solutions = []
    for rotation, translation in seeds:
        solution = _levenberg_marquardt(points, rotation, translation, parameters)
        if solution is not None:
            solutions.append(solution)
    solutions.sort(key=lambda solution: solution.squares)
    return solutions


def _levenberg_marquardt(
    points: _Points, rotation: Array, translation: Array, parameters: PoseParameters
) -> _Solution | None:
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
        if trial_translation[2] > parameters.nearest:
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
    return _Solution(
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


def _agreeing(points: _Points, pose: _Solution, parameters: PoseParameters) -> Flags:
    """Tell which tags (T,) agree with a pose."""
    rms = np.sqrt((pose.errors * pose.errors).mean(axis=(1, 2))) * points.sigma  # [px]
    result: Flags = rms <= _tolerance(points, pose.translation, parameters)
    return result


def _tolerance(points: _Points, translation: Array, parameters: PoseParameters) -> Array:
    """Give the root mean square error [px] (T,) up to which a tag agrees."""
    printing = parameters.disagreement * points.focal_length / max(float(translation[2]), parameters.nearest)
    tolerance: Array = np.maximum(
        parameters.disagreement_sigmas * points.sigma, max(printing, parameters.disagreement_px)
    )
    return tolerance


def _by_consensus(points: _Points, parameters: PoseParameters) -> PadPose:
    """Find the largest set of tags that agree on a pose, starting from each tag alone."""
    candidates: list[tuple[Flags, Pose]] = []
    for index in range(len(points.tags)):
        alone = points.only(np.arange(len(points.tags)) == index)
        for seed in _seeds(alone, parameters):
            # a lone tag gives the pose roughly: gather what agrees loosely, refine, then judge strictly
            agreeing = _near(points, seed, parameters)
            agreeing[index] = True
            agreeing = _one_of_each_id(points, agreeing, index)
            refined = _refine(points.only(agreeing), [seed], parameters)
            if not refined:
                continue
            pose = (refined[0].rotation, refined[0].translation)
            candidates.append((_strictly_near(points, pose, parameters), pose))
    best = max((_votes(points, agreeing) for agreeing, _ in candidates), default=0)
    if best == 0:
        return _nothing(points, "the tags' corners fit no pose")
    leaders = [agreeing for agreeing, _ in candidates if _votes(points, agreeing) == best]
    chosen = leaders[0]
    if any(not np.array_equal(chosen, other) for other in leaders[1:]):
        return _nothing(points, "the tags contradict one another")
    if len({tag.id for tag, keep in zip(points.tags, chosen, strict=True) if keep}) != int(chosen.sum()):
        return _nothing(points, "the tags contradict one another")
    members = points.only(chosen)
    solutions = _refine(members, _seeds(members, parameters), parameters)
    if not solutions:
        return _nothing(points, "the tags' corners fit no pose")
    rejected = tuple(tag for tag, keep in zip(points.tags, chosen, strict=True) if not keep)
    return _answer(members, solutions, parameters, rejected=rejected)


def _nothing(points: _Points, reason: str) -> PadPose:
    return PadPose(hypotheses=(), used=(), rejected=tuple(points.tags), reason=reason)


def _votes(points: _Points, agreeing: Flags) -> int:
    return len({tag.id for tag, keep in zip(points.tags, agreeing, strict=True) if keep})


def _one_of_each_id(points: _Points, agreeing: Flags, first: int) -> Flags:
    """Keep one tag of each id, `first` before all others."""
    kept = agreeing.copy()
    taken = {points.tags[first].id}
    for index, tag in enumerate(points.tags):
        if index != first and kept[index]:
            kept[index] = tag.id not in taken
            taken.add(tag.id)
    return kept


def _near(points: _Points, pose: Pose, parameters: PoseParameters, looseness: float = 1.0) -> Flags:
    """Tell which tags (T,) lie where the pose of a lone tag puts them, within a fifth of their size."""
    rms, size = _distances(points, pose)
    loose: Flags = rms <= np.maximum(0.2 * size, looseness * _tolerance(points, pose[1], parameters))
    return loose


def _strictly_near(points: _Points, pose: Pose, parameters: PoseParameters) -> Flags:
    rms, _ = _distances(points, pose)
    strict: Flags = rms <= _tolerance(points, pose[1], parameters)
    return strict


def _distances(points: _Points, pose: Pose) -> tuple[Array, Array]:
    """Give each tag's root mean square error [px] and its side in the picture [px]; infinite behind the camera."""
    rotation, translation = pose
    seen = points.model @ rotation.T + translation
    depth = np.where(seen[..., 2:] > 1e-6, seen[..., 2:], np.nan)
    error = np.matmul(points.whitening, (seen[..., :2] / depth - points.rays)[..., None])[..., 0]
    rms = np.sqrt((error * error).mean(axis=(1, 2))) * points.sigma
    diagonal = np.linalg.norm(points.rays[:, 2] - points.rays[:, 0], axis=1) * points.focal_length
    return np.nan_to_num(rms, nan=math.inf), diagonal / math.sqrt(2.0)


def _answer(
    points: _Points, solutions: list[_Solution], parameters: PoseParameters, *, rejected: tuple[TagDetection, ...]
) -> PadPose:
    """Turn refined poses into hypotheses; drop a second that is the first again, or impossible."""
    best = solutions[0]
    freedom = points.model.shape[0] * 8 - 6
    growth = max(1.0, best.squares / float(chdtri(freedom, 1.0 - parameters.quantile)))
    kept = [best]
    for other in solutions[1:]:
        same = any(_same(other, known, parameters) for known in kept)
        if not same and len(kept) < 2 and (other.squares - best.squares) / growth <= parameters.impossible:
            kept.append(other)
    hypotheses = tuple(_hypothesis(points, solution, growth) for solution in kept)
    sound = tuple(hypothesis for hypothesis in hypotheses if hypothesis is not None)
    if not sound:
        return _nothing(points, "the corners do not determine the pose")
    return PadPose(hypotheses=sound, used=tuple(points.tags), rejected=rejected, reason="")


def _same(one: _Solution, other: _Solution, parameters: PoseParameters) -> bool:
    turn = cv2.Rodrigues(one.rotation @ other.rotation.T)[0]
    return float(np.linalg.norm(turn)) <= parameters.same_rotation


def _hypothesis(points: _Points, solution: _Solution, growth: float) -> PoseHypothesis | None:
    try:
        covariance = np.linalg.inv(solution.information) * growth
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(covariance).all() and (np.diag(covariance) > 0.0).all()):
        return None
    pixels = solution.errors * points.sigma[:, None, None]
    return PoseHypothesis(
        rotation=solution.rotation,
        translation=solution.translation,
        covariance=0.5 * (covariance + covariance.T),
        reprojection_rms=math.sqrt(float((pixels * pixels).sum(axis=2).mean())),
    )
