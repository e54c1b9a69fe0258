"""What surfaces look like: pad prints with exact area coverage, and a ground with contrast, each in steps of scale.

A texture lies in plane coordinates (x towards the top of the picture, y to its right); texel (row, column) covers a
square of side `texel` whose centre is at `x = x_top - (row + 0.5) texel`, `y = y_left + (column + 0.5) texel`.
Grey values are albedo times 255.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from sitl_stub.world.pads import Face, Pad, Tag

Image = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]

PAPER = 225.0  # grey value of white print
INK = 18.0  # grey value of black print
_OFFICIAL_TAG_0 = 0xD5D628584  # data modules of tag 0, row by row, 1 is white (AprilTag's tag36h11.c)
MODULES = 8  # of a 36h11 tag across its black border
_PAD_TEXELS = 4096  # along the longer side of a board
_SMALLEST = 16  # [texels] a pyramid ends before it becomes smaller
_TURN_SAMPLES = 4  # subsamples per texel and axis of tags that are not printed upright

GROUND_PERIOD = 8.192  # [m] the ground repeats
DETAIL_PERIOD = 0.512  # [m]
DETAIL_TEXEL = 0.0005  # [m] finest grain of the ground
_GROUND_TEXELS = 2048  # per period
_GROUND_SEED = 20240501


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Texture:
    """A plane's picture in steps of factor two."""

    levels: tuple[Image, ...]
    texel: float  # [m] of level 0
    x_top: float  # [m]
    y_left: float  # [m]

    def texel_from_plane(self) -> Array:
        """Give the (3, 3) matrix from plane coordinates (x, y, 1) to (column, row, 1) of level 0."""
        return np.array(
            [
                [0.0, 1.0 / self.texel, -self.y_left / self.texel - 0.5],
                [-1.0 / self.texel, 0.0, self.x_top / self.texel - 0.5],
                [0.0, 0.0, 1.0],
            ]
        )


def _pyramid(finest: Image) -> tuple[Image, ...]:
    levels = [np.ascontiguousarray(finest)]
    while min(levels[-1].shape) >= 2 * _SMALLEST and all(side % 2 == 0 for side in levels[-1].shape):
        rows, columns = levels[-1].shape
        half = cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.uint8))
    return tuple(levels)


def tag_modules(tag_id: int) -> Image:
    """Give the 36h11 tag's (8, 8) modules as printed upright, black border included: 1 black, 0 white.

    Upright is AprilTag's own print. OpenCV's dictionary holds the same tags, before version 5 half a turn round: what
    turns its tag 0 into the official one turns them all.
    """
    official = np.array([int(bit) for bit in f"{_OFFICIAL_TAG_0:036b}"], dtype=np.uint8).reshape(6, 6)
    turns = next(k for k in range(4) if np.array_equal(np.rot90(1 - _opencv_modules(0), k)[1:7, 1:7], official))
    return np.ascontiguousarray(np.rot90(_opencv_modules(tag_id), turns))


def _opencv_modules(tag_id: int) -> Image:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    picture = cv2.aruco.generateImageMarker(dictionary, tag_id, MODULES, borderBits=1)
    return np.asarray(np.asarray(picture) < 128, dtype=np.uint8)


@lru_cache(maxsize=16)
def pad_texture(pad: Pad | Face, texels: int = _PAD_TEXELS) -> Texture:
    """Print a board: every texel holds the share of black it covers, exactly (tags at odd angles: 4 x 4 samples)."""
    texel = max(pad.size) / texels
    rows, columns = (math.ceil(side / texel / _SMALLEST - 1e-9) * _SMALLEST for side in pad.size)
    board = np.full((rows, columns), round(PAPER), dtype=np.uint8)
    texture = Texture(levels=(), texel=texel, x_top=0.5 * pad.size[0], y_left=-0.5 * pad.size[1])
    for tag in pad.tags:
        _print_tag(board, texture, tag)
    dirt = np.random.default_rng(_GROUND_SEED).integers(247, 256, (24, 24), dtype=np.uint8)
    cv2.multiply(board, cv2.resize(dirt, (columns, rows), interpolation=cv2.INTER_CUBIC), dst=board, scale=1.0 / 255.0)
    return Texture(levels=_pyramid(board), texel=texel, x_top=texture.x_top, y_left=texture.y_left)


def _print_tag(board: Image, texture: Texture, tag: Tag) -> None:
    to_texel = texture.texel_from_plane()
    corners = np.column_stack([tag.corners_board(), np.ones(4)]) @ to_texel.T
    first = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(int) - 1, 0)
    last = np.minimum(np.ceil(corners[:, :2].max(axis=0)).astype(int) + 2, (board.shape[1], board.shape[0]))
    quarters = tag.heading / (0.5 * math.pi)
    if abs(quarters - round(quarters)) < 1e-9:
        upright = np.rot90(tag_modules(tag.id), -round(quarters)).astype(np.float64)
        left, top = corners[:, 0].min() + 0.5, corners[:, 1].min() + 0.5  # edges, in texel units
        module = tag.size / MODULES / texture.texel
        black = _coverage(first[1], last[1], top, module) @ upright @ _coverage(first[0], last[0], left, module).T
    else:
        black = _turned(tag, corners[:, :2], first, last)
    part = board[first[1] : last[1], first[0] : last[0]]
    part[...] = np.rint(part * (1.0 - black) + INK * black).astype(np.uint8)


def _coverage(first: int, last: int, origin: float, module: float) -> Array:
    """Give the share of each texel first..last-1 that each of the modules covers, along one axis."""
    low = np.arange(first, last, dtype=float)[:, None]
    begin = origin + module * np.arange(MODULES)[None, :]
    covered: Array = np.clip(np.minimum(low + 1.0, begin + module) - np.maximum(low, begin), 0.0, 1.0)
    return covered


def _turned(tag: Tag, corners: Array, first: npt.NDArray[np.int_], last: npt.NDArray[np.int_]) -> Array:
    """Give the share of black of the texels first..last-1 of a tag that is printed at an angle."""
    modules = np.pad(tag_modules(tag.id), 1)
    right, down = (corners[1] - corners[0]) / MODULES, (corners[3] - corners[0]) / MODULES
    inverse = np.linalg.inv(np.column_stack([right, down]))  # texels to modules
    columns, rows = (int(side) for side in last - first)
    total = np.zeros((rows, columns))
    for i in range(_TURN_SAMPLES):
        for j in range(_TURN_SAMPLES):
            shift = (np.array([i, j]) + 0.5) / _TURN_SAMPLES - 0.5
            offset = inverse @ (first + shift - corners[0]) + 0.5  # +1 for the padding, -0.5 to module centres
            matrix = np.column_stack([inverse, offset])
            total += cv2.warpAffine(modules, matrix, (columns, rows), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
    return total / _TURN_SAMPLES**2


def _noise(rng: np.random.Generator, cells: int, size: int) -> npt.NDArray[np.float32]:
    """Give smooth noise of `cells` lumps across `size` texels that wraps around, unit deviation."""
    lumps = rng.standard_normal((cells, cells)).astype(np.float32)
    margin = 2
    wrapped = np.pad(lumps, margin, mode="wrap")
    step = size // cells
    large = cv2.resize(wrapped, None, fx=step, fy=step, interpolation=cv2.INTER_CUBIC)
    cut = large[margin * step : margin * step + size, margin * step : margin * step + size]
    return np.asarray(cut / max(float(cut.std()), 1e-6), dtype=np.float32)


@lru_cache(maxsize=2)
def ground_texture(contrast: float) -> Texture:
    """Make the ground: patchy, grainy, with slabs, joints and dark and bright debris; `contrast` 0 is plain grey.

    It repeats every `GROUND_PERIOD`; the texture holds two periods each way.
    """
    rng = np.random.default_rng(_GROUND_SEED)
    size = _GROUND_TEXELS
    picture = np.zeros((size, size), dtype=np.float32)
    for cells, weight in ((8, 10.0), (32, 9.0), (128, 8.0), (512, 7.0)):
        picture += weight * _noise(rng, cells, size)
    slab = size // 8
    picture += np.repeat(np.repeat(rng.normal(0.0, 9.0, (8, 8)), slab, axis=0), slab, axis=1).astype(np.float32)
    for start in range(0, size, slab):
        picture[start : start + 3, :] -= 28.0
        picture[:, start : start + 3] -= 28.0
    _scatter(picture, rng, 260)
    finest = np.rint(np.clip(92.0 + contrast * picture, 4.0, 250.0)).astype(np.uint8)
    texel = GROUND_PERIOD / size
    return Texture(levels=_pyramid(np.tile(finest, (2, 2))), texel=texel, x_top=GROUND_PERIOD, y_left=-GROUND_PERIOD)


def _scatter(picture: npt.NDArray[np.float32], rng: np.random.Generator, count: int) -> None:
    """Throw debris on the ground: small turned rectangles, some darker, some brighter."""
    size = picture.shape[0]
    for x, y, length, breadth, angle, tone in rng.random((count, 6)):
        box = ((x * size, y * size), (8 + 36 * length**3, 6 + 24 * breadth**3), 180.0 * angle)
        corners = np.rint(cv2.boxPoints(box) * 16.0).astype(np.int32)
        cv2.fillConvexPoly(picture, corners, float(-70.0 + 150.0 * tone), cv2.LINE_8, 4)


@lru_cache(maxsize=2)
def detail_texture(contrast: float) -> Texture:
    """Make the ground's fine grain around 128, to be added where the camera is near; repeats every `DETAIL_PERIOD`."""
    rng = np.random.default_rng(_GROUND_SEED + 1)
    size = round(DETAIL_PERIOD / DETAIL_TEXEL)
    picture = np.zeros((size, size), dtype=np.float32)
    for cells, weight in ((128, 8.0), (256, 8.0), (512, 7.0)):
        picture += weight * _noise(rng, cells, size)
    finest = np.rint(np.clip(128.0 + contrast * picture, 0.0, 255.0)).astype(np.uint8)
    return Texture(
        levels=_pyramid(np.tile(finest, (2, 2))), texel=DETAIL_TEXEL, x_top=DETAIL_PERIOD, y_left=-DETAIL_PERIOD
    )
