"""The camera's perspective and distortion (the plumb-bob model), exact in both directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_NEWTON_STEPS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Perspective and distortion; the centre of the first pixel is (0, 0)."""

    width: int = 640  # [px]
    height: int = 480  # [px]
    fx: float = 460.0  # [px]
    fy: float = 460.0  # [px]
    cx: float = 319.5  # [px]
    cy: float = 239.5  # [px]
    distortion: tuple[float, float, float, float, float] = (-0.12, 0.03, 0.0005, -0.0004, 0.0)  # k1, k2, p1, p2, k3

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Move ideal normalised picture coordinates to where the lens puts them.

        `x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)`, y likewise (Brown; OpenCV's order).
        """
        k1, k2, p1, p2, k3 = self.distortion
        squared = x * x + y * y
        radial = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
        cross = 2.0 * x * y
        return (
            x * radial + p1 * cross + p2 * (squared + 2.0 * x * x),
            y * radial + p2 * cross + p1 * (squared + 2.0 * y * y),
        )

    def project(self, points_cam: Array) -> Array:
        """Project points (..., 3) [m] in cam, all in front of the lens, to pixels (..., 2)."""
        x, y = self.distort(points_cam[..., 0] / points_cam[..., 2], points_cam[..., 1] / points_cam[..., 2])
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=-1)

    def rays(self, pixels: Array) -> Array:
        """Give the rays (..., 3) with z = 1 in cam through `pixels` (..., 2).

        Solves the distortion by Newton's method with the Jacobian taken by central differences.
        """
        goal_x = (pixels[..., 0] - self.cx) / self.fx
        goal_y = (pixels[..., 1] - self.cy) / self.fy
        x, y, h = goal_x.copy(), goal_y.copy(), 1e-6
        for _ in range(_NEWTON_STEPS):
            at_x, at_y = self.distort(x, y)
            right, left = self.distort(x + h, y), self.distort(x - h, y)
            below, above = self.distort(x, y + h), self.distort(x, y - h)
            a, c = (right[0] - left[0]) / (2 * h), (right[1] - left[1]) / (2 * h)
            b, d = (below[0] - above[0]) / (2 * h), (below[1] - above[1]) / (2 * h)
            determinant = a * d - b * c
            miss_x, miss_y = goal_x - at_x, goal_y - at_y
            x += (d * miss_x - b * miss_y) / determinant
            y += (a * miss_y - c * miss_x) / determinant
        return np.stack([x, y, np.ones_like(x)], axis=-1)
