"""Pinhole camera with OpenCV's distortion models.

A point (x, y, z) in `cam` is seen at the normalised coordinates (x/z, y/z); distortion bends them; the focal lengths
and the principal point turn them into pixels. Pixel (0, 0) is the centre of the first pixel.

Source of the equations: OpenCV, "Camera Calibration and 3D Reconstruction" (radial, tangential and rational terms)
and "Fisheye camera model" (equidistant).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import cv2
import numpy as np

from companion.errors import InputError, Problem
from companion.geometry.arrays import Array, frozen

_UNDISTORT_CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 60, 1e-12)
_SEARCH_RADIUS = 6.0  # normalised radius up to which the radial distortion is checked for folding: 80 degrees
_NEAREST_DEPTH = 1e-6  # [m] points nearer than this, or behind the camera, have no picture


class Distortion(Enum):
    """How the lens bends straight lines; the values are ROS's names."""

    PLUMB_BOB = "plumb_bob"  # none, k1 k2 p1 p2, or k1 k2 p1 p2 k3
    RATIONAL = "rational_polynomial"  # k1 k2 p1 p2 k3 k4 k5 k6
    EQUIDISTANT = "equidistant"  # fisheye: k1 k2 k3 k4 of the angle off the axis


COEFFICIENT_COUNTS = {
    Distortion.PLUMB_BOB: (0, 4, 5),
    Distortion.RATIONAL: (8,),
    Distortion.EQUIDISTANT: (4,),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraModel:
    """A calibrated camera.

    Raises:
        InputError: a number is not finite, a focal length or size is not positive, the principal point is outside the
            picture, or the number of coefficients does not fit the model. Names every problem.
    """

    width: int  # [px]
    height: int  # [px]
    fx: float  # [px]
    fy: float  # [px]
    cx: float  # [px]
    cy: float  # [px]
    distortion: Array = field(default_factory=lambda: np.zeros(0))  # coefficients in OpenCV's order
    model: Distortion = Distortion.PLUMB_BOB
    # normalised radius (tangent of the angle off the axis) up to which the model is one to one
    largest_radius: float = field(init=False, default=math.inf)
    _matrix: Array = field(init=False, repr=False, default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        coefficients = frozen(np.asarray(self.distortion, dtype=np.float64).ravel())
        object.__setattr__(self, "distortion", coefficients)
        problems = camera_problems(self)
        if problems:
            raise InputError(problems)
        matrix = frozen([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]], (3, 3))
        object.__setattr__(self, "_matrix", matrix)
        object.__setattr__(self, "largest_radius", _largest_radius(self))

    @property
    def matrix(self) -> Array:
        """Camera matrix (3, 3)."""
        return self._matrix

    @property
    def focal_length(self) -> float:
        """Geometric mean [px] of the two focal lengths."""
        return math.sqrt(self.fx * self.fy)

    def distort(self, normalised: Array) -> Array:
        """Give the pixels (N, 2) at which rays (N, 2), as x/z and y/z, are seen. No check of `largest_radius`."""
        bent = _bend(self, normalised[..., 0], normalised[..., 1])
        return np.stack((bent[0] * self.fx + self.cx, bent[1] * self.fy + self.cy), axis=-1)

    def project(self, points: Array) -> Array:
        """Give the pixels (N, 2) of points (N, 3) [m] in `cam`; NaN behind the camera or beyond `largest_radius`."""
        depth = np.where(points[:, 2] > _NEAREST_DEPTH, points[:, 2], np.nan)
        normalised = points[:, :2] / depth[:, None]
        radius = np.hypot(normalised[:, 0], normalised[:, 1])
        normalised[~(radius <= self.largest_radius)] = np.nan
        return self.distort(normalised)

    def undistort(self, pixels: Array) -> Array:
        """Give the rays (N, 2), as x/z and y/z, seen at pixels (N, 2); NaN where no ray is seen there."""
        points = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if self.model is Distortion.EQUIDISTANT:
            rays = cv2.fisheye.undistortPoints(
                points, self._matrix, self.distortion.reshape(4, 1), criteria=_UNDISTORT_CRITERIA
            )
        elif self.distortion.size == 0:
            return (points[:, 0] - (self.cx, self.cy)) / (self.fx, self.fy)
        else:
            rays = cv2.undistortPointsIter(
                points, self._matrix, self.distortion, np.eye(3), np.eye(3), _UNDISTORT_CRITERIA
            )
        result: Array = np.asarray(rays, dtype=np.float64).reshape(-1, 2)
        if math.isfinite(self.largest_radius):
            result[~(np.hypot(result[:, 0], result[:, 1]) <= self.largest_radius)] = np.nan
        return result

    def jacobian(self, normalised: Array) -> Array:
        """Give the derivative (N, 2, 2) [px] of the pixel by the ray (N, 2)."""
        step = 1e-6
        shift = np.array([[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]])
        seen = self.distort(normalised[None, :, :] + shift[:, None, :])
        return np.stack((seen[0] - seen[1], seen[2] - seen[3]), axis=-1) / (2.0 * step)

    def check_image(self, shape: tuple[int, ...], source: str) -> None:
        """Check that a picture of `shape` (height, width) has the calibrated size.

        Raises:
            InputError: it has not.
        """
        if tuple(shape[:2]) != (self.height, self.width):
            raise InputError.single(
                source=source,
                wrong=f"the picture is {shape[1]}x{shape[0]} pixels, the calibration is for {self.width}x{self.height}",
                right="use the calibration of this camera at this resolution",
            )


def camera_problems(camera: CameraModel, source: str = "camera model") -> list[Problem]:
    """Give everything that is wrong with the camera's numbers."""
    problems: list[Problem] = []

    def wrong(key: str, found: str, right: str) -> None:
        problems.append(Problem(source=source, line=None, column=None, key=key, wrong=found, right=right))

    for key, size in (("width", camera.width), ("height", camera.height)):
        if size <= 0:
            wrong(key, f"is {size}", "a picture has at least one pixel: give the calibrated size, for example 640")
    for key, value in (("fx", camera.fx), ("fy", camera.fy)):
        if not (math.isfinite(value) and value > 0.0):
            wrong(key, f"the focal length is {value}", "a focal length in pixels is finite and positive, such as 460.0")
    for key, value, size in (("cx", camera.cx, camera.width), ("cy", camera.cy, camera.height)):
        if not math.isfinite(value) or (size > 0 and not -0.5 <= value <= size - 0.5):
            wrong(key, f"the principal point is {value}", f"it lies inside the picture, near {(size - 1) / 2}")
    counts = COEFFICIENT_COUNTS[camera.model]
    if camera.distortion.size not in counts:
        expected = " or ".join(str(count) for count in counts)
        wrong(
            "distortion", f"has {camera.distortion.size} coefficients", f"the model {camera.model.value} has {expected}"
        )
    if not np.all(np.isfinite(camera.distortion)):
        wrong("distortion", "has a coefficient that is not finite", "every coefficient is a finite number")
    return problems


def _bend(camera: CameraModel, x: Array, y: Array) -> tuple[Array, Array]:
    """Apply the distortion to normalised coordinates."""
    if camera.model is Distortion.EQUIDISTANT:
        return _bend_fisheye(camera.distortion, x, y)
    if camera.distortion.size == 0:
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6 = (*camera.distortion.tolist(), 0.0, 0.0, 0.0, 0.0)[:8]
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    if k4 or k5 or k6:
        radial = radial / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx),
        y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy,
    )


def _bend_fisheye(coefficients: Array, x: Array, y: Array) -> tuple[Array, Array]:
    k1, k2, k3, k4 = coefficients.tolist()
    radius = np.hypot(x, y)
    angle = np.arctan(radius)
    a2 = angle * angle
    bent = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    scale = np.where(radius > 1e-12, bent / np.maximum(radius, 1e-12), 1.0)
    return x * scale, y * scale


def _largest_radius(camera: CameraModel) -> float:
    """Give the normalised radius at which the radial distortion stops growing, infinite where it never does."""
    if camera.distortion.size == 0:
        return math.inf
    radius = np.linspace(0.0, _SEARCH_RADIUS, 6001)
    plain = camera.distortion.copy()
    if camera.model is Distortion.EQUIDISTANT:
        bent = _bend_fisheye(plain, radius, np.zeros_like(radius))[0]
    else:
        plain[2:4] = 0.0
        k1, k2, _, _, k3, k4, k5, k6 = (*plain.tolist(), 0.0, 0.0, 0.0, 0.0)[:8]
        r2 = radius * radius
        below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        with np.errstate(divide="ignore", invalid="ignore"):
            bent = radius * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / np.where(below > 0.0, below, np.nan)
    growing = np.diff(bent) > 0.0
    if bool(np.all(growing)):
        return math.inf
    return float(radius[int(np.argmin(growing))])
