"""Pose of the pad from all its tags' corners: both poses that explain them, each with its covariance.

The poses are those of `pose_solver`; tags that disagree with the others are found and left out. With J the derivative
of the normalised errors by [dt, dr] a pose has the covariance (J' J)^-1, in that order. Where the corners scatter more
than their sigma promises, the covariance grows with them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import chdtri

from companion.geometry.arrays import Array
from companion.messages.perception import PoseHypothesis, TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pose_parameters import PoseParameters
from companion.perception.pose_solver import Flags, Points, Pose, PoseSolution, refined_poses, seeds_of


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
    points = Points.of(pad, tags, camera, parameters)
    if len(points.tags) == 0:
        return PadPose(hypotheses=(), used=(), rejected=tuple(tags), reason="corners outside the calibrated field")
    unique = len({tag.id for tag in points.tags}) == len(points.tags)
    if unique:
        poses = refined_poses(points, seeds_of(points, parameters), parameters)
        if poses and _agreeing(points, poses[0], parameters).all():
            return _answer(points, poses, parameters, rejected=())
    return _by_consensus(points, parameters)


def _sound(tag: TagDetection) -> bool:
    return bool(np.isfinite(tag.corners).all()) and math.isfinite(tag.corner_sigma) and tag.corner_sigma > 0.0


def _agreeing(points: Points, pose: PoseSolution, parameters: PoseParameters) -> Flags:
    """Tell which tags (T,) agree with a pose."""
    rms = np.sqrt((pose.errors * pose.errors).mean(axis=(1, 2))) * points.sigma  # [px]
    result: Flags = rms <= _tolerance(points, pose.pose, parameters)
    return result


def _tolerance(points: Points, pose: Pose, parameters: PoseParameters) -> Array:
    """Give the root mean square error [px] (T,) up to which a tag agrees."""
    rotation, translation = pose
    depth = np.maximum(points.model.mean(axis=1) @ rotation[2] + translation[2], parameters.nearest)
    printing = parameters.disagreement * points.focal_length / depth
    tolerance: Array = np.maximum(
        parameters.disagreement_sigmas * points.sigma, np.maximum(printing, parameters.disagreement_px)
    )
    return tolerance


def _by_consensus(points: Points, parameters: PoseParameters) -> PadPose:
    """Find the largest set of tags that agree on a pose, starting from each tag alone."""
    candidates: list[tuple[Flags, Pose]] = []
    for index in range(len(points.tags)):
        alone = points.only(np.arange(len(points.tags)) == index)
        for seed in seeds_of(alone, parameters):
            # a lone tag gives the pose roughly: gather what agrees loosely, refine, then judge strictly
            agreeing = _near(points, seed, parameters)
            agreeing[index] = True
            agreeing = _one_of_each_id(points, agreeing, index)
            refined = refined_poses(points.only(agreeing), [seed], parameters)
            if not refined:
                continue
            pose = refined[0].pose
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
    solutions = refined_poses(members, seeds_of(members, parameters), parameters)
    if not solutions:
        return _nothing(points, "the tags' corners fit no pose")
    rejected = tuple(tag for tag, keep in zip(points.tags, chosen, strict=True) if not keep)
    return _answer(members, solutions, parameters, rejected=rejected)


def _nothing(points: Points, reason: str) -> PadPose:
    return PadPose(hypotheses=(), used=(), rejected=tuple(points.tags), reason=reason)


def _votes(points: Points, agreeing: Flags) -> int:
    return len({tag.id for tag, keep in zip(points.tags, agreeing, strict=True) if keep})


def _one_of_each_id(points: Points, agreeing: Flags, first: int) -> Flags:
    """Keep one tag of each id, `first` before all others."""
    kept = agreeing.copy()
    taken = {points.tags[first].id}
    for index, tag in enumerate(points.tags):
        if index != first and kept[index]:
            kept[index] = tag.id not in taken
            taken.add(tag.id)
    return kept


def _near(points: Points, pose: Pose, parameters: PoseParameters, looseness: float = 1.0) -> Flags:
    """Tell which tags (T,) lie where the pose of a lone tag puts them, within a fifth of their size."""
    rms, size = _distances(points, pose)
    loose: Flags = rms <= np.maximum(0.2 * size, looseness * _tolerance(points, pose, parameters))
    return loose


def _strictly_near(points: Points, pose: Pose, parameters: PoseParameters) -> Flags:
    rms, _ = _distances(points, pose)
    strict: Flags = rms <= _tolerance(points, pose, parameters)
    return strict


def _distances(points: Points, pose: Pose) -> tuple[Array, Array]:
    """Give each tag's root mean square error [px] and its side in the picture [px]; infinite behind the camera."""
    rotation, translation = pose
    seen = points.model @ rotation.T + translation
    depth = np.where(seen[..., 2:] > 1e-6, seen[..., 2:], np.nan)
    error = np.matmul(points.whitening, (seen[..., :2] / depth - points.rays)[..., None])[..., 0]
    rms = np.sqrt((error * error).mean(axis=(1, 2))) * points.sigma
    diagonal = np.linalg.norm(points.rays[:, 2] - points.rays[:, 0], axis=1) * points.focal_length
    return np.nan_to_num(rms, nan=math.inf), diagonal / math.sqrt(2.0)


def _answer(
    points: Points, solutions: list[PoseSolution], parameters: PoseParameters, *, rejected: tuple[TagDetection, ...]
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


def _same(one: PoseSolution, other: PoseSolution, parameters: PoseParameters) -> bool:
    turn = cv2.Rodrigues(one.rotation @ other.rotation.T)[0].ravel()
    if float(np.linalg.norm(turn)) <= parameters.same_rotation:
        return True
    apart = np.concatenate((one.translation - other.translation, turn))
    return float(apart @ other.information @ apart) <= 1.0


def _hypothesis(points: Points, solution: PoseSolution, growth: float) -> PoseHypothesis | None:
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
