"""What `companion detect` found, in words and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from companion.geometry.arrays import Image
from companion.messages.perception import PoseHypothesis, TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pad_pose import PadPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture to be searched."""

    source: str  # as the user gave it
    stem: str  # of the annotated copy's name
    image: Image


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What is known of the camera and the tags."""

    camera: CameraModel | None
    pad: Pad | None
    tag_size: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What was found in one picture."""

    picture: Picture
    tags: tuple[TagDetection, ...]
    tag_poses: tuple[PadPose | None, ...]  # one for each tag
    pad_pose: PadPose | None
    seconds: float  # search, refinement and poses


def as_text(seen: Seen, setup: Setup, copy: str | None) -> str:
    """Say in words what was found; `copy` is the path of the annotated copy."""
    count = len(seen.tags)
    size = f"{seen.picture.image.shape[1]}x{seen.picture.image.shape[0]}"
    lines = [f"{seen.picture.source} ({size}): {count} tag{'s' if count != 1 else ''} in {1e3 * seen.seconds:.1f} ms"]
    for tag, pose in zip(seen.tags, seen.tag_poses, strict=True):
        corners = " ".join(f"({x:.2f}, {y:.2f})" for x, y in tag.corners)
        lines.append(f"  tag {tag.id:<3d} corners {corners} +-{tag.corner_sigma:.2f} px")
        if pose is not None:
            lines.extend(_pose_lines(pose))
    if setup.pad is not None and seen.pad_pose is not None:
        lines.append(f"  pad {setup.pad.name!r}, {len(seen.pad_pose.used)} tags used:")
        lines.extend(_pose_lines(seen.pad_pose))
        if seen.pad_pose.rejected:
            ids = ", ".join(str(tag.id) for tag in seen.pad_pose.rejected)
            lines.append(f"    tags that disagree: {ids}")
    if copy is not None:
        lines.append(f"  annotated copy: {copy}")
    return "\n".join(lines)


def _pose_lines(pose: PadPose) -> list[str]:
    if not pose.hypotheses:
        return [f"    no pose: {pose.reason}"]
    lines: list[str] = []
    for hypothesis in pose.hypotheses:
        x, y, z = hypothesis.translation
        sigma = np.sqrt(np.diag(hypothesis.covariance))
        turn = np.degrees(cv2.Rodrigues(hypothesis.rotation)[0].ravel())
        lines.append(
            f"    {'pose' if not lines else 'or  '} x {x:.4f} y {y:.4f} z {z:.4f} m"
            f" (+-{sigma[0]:.4f} {sigma[1]:.4f} {sigma[2]:.4f}),"
            f" turned by ({turn[0]:.2f}, {turn[1]:.2f}, {turn[2]:.2f}) deg"
            f" (+-{math.degrees(sigma[3]):.2f} {math.degrees(sigma[4]):.2f} {math.degrees(sigma[5]):.2f}),"
            f" reprojection {hypothesis.reprojection_rms:.2f} px"
        )
    return lines


def as_json(seen: Seen, copy: str | None) -> dict[str, Any]:
    """Give what was found as plain data for JSON."""
    height, width = seen.picture.image.shape
    described: dict[str, Any] = {
        "file": seen.picture.source,
        "width": width,
        "height": height,
        "seconds": round(seen.seconds, 6),
        "annotated": copy,
        "tags": [_tag_json(tag, pose) for tag, pose in zip(seen.tags, seen.tag_poses, strict=True)],
    }
    if seen.pad_pose is not None:
        described["pad"] = {
            "poses": [_hypothesis_json(hypothesis) for hypothesis in seen.pad_pose.hypotheses],
            "used": [tag.id for tag in seen.pad_pose.used],
            "rejected": [tag.id for tag in seen.pad_pose.rejected],
            "reason": seen.pad_pose.reason,
        }
    return described


def _tag_json(tag: TagDetection, pose: PadPose | None) -> dict[str, Any]:
    described: dict[str, Any] = {
        "id": tag.id,
        "corners": [[round(float(x), 4), round(float(y), 4)] for x, y in tag.corners],
        "corner_sigma": round(tag.corner_sigma, 4),
        "method": tag.method,
    }
    if pose is not None:
        described["poses"] = [_hypothesis_json(hypothesis) for hypothesis in pose.hypotheses]
    return described


def _hypothesis_json(hypothesis: PoseHypothesis) -> dict[str, Any]:
    return {
        "rotation": hypothesis.rotation.tolist(),
        "translation": hypothesis.translation.tolist(),
        "covariance": hypothesis.covariance.tolist(),
        "reprojection_rms": hypothesis.reprojection_rms,
    }
