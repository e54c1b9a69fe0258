"""Draws what the detector saw into a copy of the picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array, Image
from companion.messages.perception import PoseHypothesis, TagDetection
from companion.perception.camera_model import CameraModel

ColourImage = NDArray[np.uint8]  # (height, width, 3) blue, green, red

_OUTLINE = (0, 220, 0)
_FIRST_CORNER = (0, 0, 255)
_TEXT = (255, 80, 0)
_AXES = ((0, 0, 255), (0, 220, 0), (255, 60, 0))  # x, y, z
_FRACTION_BITS = 4  # OpenCV draws at sixteenths of a pixel


def draw_tags(image: Image, tags: Sequence[TagDetection]) -> ColourImage:
    """Give a colour copy of a grey picture with every tag outlined, its first corner marked, its id written beside."""
    copy = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    for tag in tags:
        cv2.polylines(copy, [_fixed(tag.corners)], True, _OUTLINE, 1, cv2.LINE_AA, _FRACTION_BITS)
        centre = _fixed(tag.corners[:1])[0]
        cv2.circle(copy, centre.tolist(), 2 << _FRACTION_BITS, _FIRST_CORNER, -1, cv2.LINE_AA, _FRACTION_BITS)
        right, top = tag.corners[:, 0].max(), tag.corners[:, 1].min()
        if np.isfinite([right, top]).all():
            place = (int(right) + 2, int(top) + 8)
            cv2.putText(copy, str(tag.id), place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, _TEXT, 1, cv2.LINE_AA)
    return np.asarray(copy, dtype=np.uint8)


def draw_pose(picture: ColourImage, pose: PoseHypothesis, camera: CameraModel, length: float) -> None:
    """Draw the axes of a pose, `length` [m] long, x red, y green, z blue, into `picture`."""
    tips = np.vstack((np.zeros(3), length * np.eye(3)))
    seen = camera.project(tips @ pose.rotation.T + pose.translation)
    if not bool(np.isfinite(seen[0]).all()):
        return
    origin = _fixed(seen[:1])[0]
    for tip, colour in zip(seen[1:], _AXES, strict=True):
        if bool(np.isfinite(tip).all()) and float(np.abs(tip).max()) < 1e5:
            end = _fixed(tip[None])[0]
            cv2.line(picture, origin.tolist(), end.tolist(), colour, 2, cv2.LINE_AA, _FRACTION_BITS)


def _fixed(points: Array) -> NDArray[np.int32]:
    return np.asarray(np.rint(np.nan_to_num(points) * (1 << _FRACTION_BITS)), dtype=np.int32)
