"""The sides of tags in a picture, and the pixels beside them from which their edges are fitted.

The pixels are taken as they are, never interpolated, so their noise is white. With a calibrated camera the bending of
a side by the lens is taken from the model; without, sides are taken as straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array, Image
from companion.perception.camera_model import CameraModel
from companion.perception.edge_parameters import EdgeParameters

Singles = NDArray[np.float32]

_MODULES = 8.0  # a 36h11 tag is 8 cells wide, of which the outer ring is black


@dataclass(slots=True, eq=False)
class Sides:
    """The S = 4N sides of N quads: side k of a quad runs from corner k to corner k + 1."""

    begin: Array  # (S, 2)
    along: Array  # (S, 2) unit
    outward: Array  # (S, 2) unit, towards the paper
    length: Array  # (S,)
    frame: Array  # (S,) [px] width of the black frame across this side

    @classmethod
    def of(cls, quads: Array) -> Sides:
        """Give the sides of quads (N, 4, 2) [px], whose corners go clockwise in the picture."""
        following = np.roll(quads, -1, axis=1)
        step = (following - quads).reshape(-1, 2)
        length = np.sqrt(np.einsum("ij,ij->i", step, step))
        along = step / length[:, None]
        outward = np.stack((along[:, 1], -along[:, 0]), axis=1)
        # how deep the tag is behind this side, at its shallower end
        opposite = np.roll(quads, -2, axis=1)
        before = np.roll(quads, 1, axis=1)
        depth_begin = -np.einsum("ij,ij->i", (before - quads).reshape(-1, 2), outward)
        depth_end = -np.einsum("ij,ij->i", (opposite - following).reshape(-1, 2), outward)
        return cls(
            begin=quads.reshape(-1, 2),
            along=along,
            outward=outward,
            length=length,
            frame=np.minimum(depth_begin, depth_end) / _MODULES,
        )


@dataclass(slots=True, eq=False)
class SidePixels:
    """The pixels beside S sides: R rows across each side, C pixels in each row."""

    grey: Singles  # (S, M) with M = R C
    distance: Singles  # (S, M) [px] outside the present edge
    place: Singles  # (S, M) along the side, -1 at its beginning, 1 at its end
    weight: Singles  # (S, M) 0 or 1
    reach: Array  # (S,) [px]


def bending_of(quads: Array, camera: CameraModel | None) -> Array | None:
    """Give how far [px] the lens bends each side outward from its chord at 1/4, 1/2 and 3/4: (S, 3)."""
    if camera is None or camera.distortion.size == 0 or not bool(camera.distortion.any()):
        return None
    rays = camera.undistort(quads.reshape(-1, 2)).reshape(-1, 4, 2)
    following = np.roll(rays, -1, axis=1)
    fraction = np.array([0.25, 0.5, 0.75])[:, None]
    inner = rays[:, :, None, :] + fraction * (following - rays)[:, :, None, :]
    seen = camera.distort(inner.reshape(-1, 2)).reshape(-1, 3, 2)
    sides = Sides.of(quads)
    offset = np.einsum("sij,sj->si", seen - sides.begin[:, None, :], sides.outward)
    result: Array = np.nan_to_num(offset)
    return result


def choose_pixels(image: Image, sides: Sides, bending: Array | None, parameters: EdgeParameters) -> SidePixels:
    """Take whole rows or columns of pixels across each side, whichever cross it more squarely."""
    height, width = image.shape
    reach = np.clip(parameters.frame_share * sides.frame, 1.5, parameters.reach)
    flat = np.abs(sides.along[:, 0]) >= np.abs(sides.along[:, 1])  # the side runs along x: take columns
    main = np.where(flat, 0, 1)
    every = np.arange(len(main))
    speed = sides.along[every, main]  # change of the running coordinate per px along the side
    margin = np.maximum(parameters.corner_margin * sides.length, parameters.corner_margin_px)
    margin = np.minimum(margin, 0.25 * sides.length)
    crowded = round(parameters.rows * 4.0 / math.sqrt(len(main)))  # four sides a tag
    fraction = np.linspace(0.0, 1.0, min(parameters.rows, max(parameters.fewest_rows, crowded)))
    wanted = margin[:, None] + fraction * (sides.length - 2.0 * margin)[:, None]  # (S, R) [px] along the side
    running = np.rint(sides.begin[every, main][:, None] + wanted * speed[:, None])
    repeated = np.zeros(running.shape, dtype=bool)
    repeated[:, 1:] = running[:, 1:] == running[:, :-1]
    slope = sides.along[every, 1 - main] / speed
    crossing = sides.begin[every, 1 - main][:, None] + (running - sides.begin[every, main][:, None]) * slope[:, None]
    half = math.ceil(float((reach / np.abs(speed)).max()))
    across = np.rint(crossing)[:, :, None] + np.arange(-half, half + 1)
    running = np.broadcast_to(running[:, :, None], across.shape)
    columns = np.where(flat[:, None, None], running, across).astype(np.intp)
    rows = np.where(flat[:, None, None], across, running).astype(np.intp)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height) & ~repeated[:, :, None]
    grey = image[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    relative_x = columns - sides.begin[:, 0][:, None, None]
    relative_y = rows - sides.begin[:, 1][:, None, None]
    normal, direction = sides.outward[:, None, None, :], sides.along[:, None, None, :]
    distance = relative_x * normal[..., 0] + relative_y * normal[..., 1]
    place = (relative_x * direction[..., 0] + relative_y * direction[..., 1]) * (2.0 / sides.length)[
        :, None, None
    ] - 1.0
    if bending is not None:
        distance = distance - _bent(bending, place)
    weight = inside & (np.abs(distance) <= reach[:, None, None])
    shape = (len(main), -1)
    return SidePixels(
        grey=grey.reshape(shape).astype(np.float32),
        distance=distance.reshape(shape).astype(np.float32),
        place=place.reshape(shape).astype(np.float32),
        weight=weight.reshape(shape).astype(np.float32),
        reach=reach,
    )


def _bent(bending: Array, place: Array) -> Array:
    """Interpolate the bending by the quartic that is zero at both ends."""
    f = 0.5 * (place + 1.0)
    hump = f * (1.0 - f)
    first, middle, last = (bending[:, k][:, None, None] for k in range(3))
    # Lagrange through 1/4, 1/2, 3/4 of bending / hump
    u, v, w = first * (16.0 / 3.0), middle * 4.0, last * (16.0 / 3.0)
    result: Array = hump * (
        u * (f - 0.5) * (f - 0.75) * 8.0 - v * (f - 0.25) * (f - 0.75) * 16.0 + w * (f - 0.25) * (f - 0.5) * 8.0
    )
    return result
