"""From poses to light on the sensor: planes seen through the real lens, added up over the exposure.

Every plane is sampled once, straight into the distorted picture: texture coordinates are computed exactly on a coarse
grid of pixels (rays of the calibrated lens through the plane's homography) and interpolated in between; the pyramid
level is chosen so that a texel is about as large as a pixel. Pictures are added up in pairs whose pixels are sampled a
quarter pixel to either side of their centres: without that, edges along rows or columns would be up to 0.2 px off.
A print that is small in the picture, as seen from afar or aslant, is sampled from a finer level at several points in
each pixel: from a coarse one its edges would fade unevenly to both sides, and a tag would seem larger by up to 0.2 px.
The order is ground, sides of a platform, its printed top; of a body, its faces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sitl_stub.world.exposure import Exposure, Scene
from sitl_stub.world.lens import Intrinsics
from sitl_stub.world.outline import clip_to_view, visible_sides
from sitl_stub.world.targets import TargetConfig
from sitl_stub.world.textures import (
    DETAIL_PERIOD,
    DETAIL_TEXEL,
    GROUND_PERIOD,
    Texture,
    detail_texture,
    ground_texture,
    pad_texture,
)

Image = npt.NDArray[np.uint8]
Picture = npt.NDArray[np.float32]
Array = npt.NDArray[np.float64]

_FINEST_SHARE = 0.9  # texels per pixel at which the next finer level is taken
_MOST_SAMPLES = 60_000  # that a small print takes, and a larger one only where one in each pixel is as many:
_MOST_ALONG = 4  # along each axis of a pixel, at most
_SAMPLE_STEP = 1.3  # texels between two of them at most
_FARTHEST = 60.0  # [m] the ground ends in haze
_HAZE = 190
_BLUR_STEP = 1.1  # [px] of motion per picture that is added up
_MOST_PICTURES = 8
_OFFSETS = (-0.25, 0.25)  # [px] of the sampled points of a pair of pictures, in both directions
_COARSE_CELL = 8  # [px] for the ground
_FINE_CELL = 4  # [px] for printed tops
_POLYGON_SHIFT = 4  # fractional bits of polygon corners


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A rectangle of the picture, in cells of a grid."""

    left: int
    top: int
    right: int  # exclusive
    bottom: int  # exclusive


class Grid:
    """Rays of the lens on a coarse grid of pixels, with one cell of margin around the picture.

    The rays go through points `offset` [px] right of and below the pixels' centres.
    """

    def __init__(self, intrinsics: Intrinsics, cell: int, offset: float = 0.0) -> None:
        self.cell = cell
        self.offset = offset
        self.width, self.height = intrinsics.width, intrinsics.height
        self.columns = math.ceil(intrinsics.width / cell)
        self.rows = math.ceil(intrinsics.height / cell)
        u = cell * np.arange(-1, self.columns + 1) + 0.5 * (cell - 1)
        v = cell * np.arange(-1, self.rows + 1) + 0.5 * (cell - 1)
        pixels = np.stack(np.meshgrid(u, v), axis=-1) + offset
        self.rays = np.ascontiguousarray(intrinsics.rays(pixels))
        self.whole = Patch(left=0, top=0, right=self.columns, bottom=self.rows)

    def patch_of(self, points: Array) -> Patch | None:
        """Give the cells that a polygon (n, 2) [px] may touch, None where it is outside the picture."""
        low = np.floor((points.min(axis=0) - 2.0) / self.cell).astype(int)
        high = np.ceil((points.max(axis=0) + 3.0) / self.cell).astype(int)
        left, top = max(0, int(low[0])), max(0, int(low[1]))
        right, bottom = min(self.columns, int(high[0])), min(self.rows, int(high[1]))
        if left >= right or top >= bottom:
            return None
        return Patch(left=left, top=top, right=right, bottom=bottom)

    def patch_where(self, wanted: npt.NDArray[np.bool_]) -> Patch | None:
        """Give the smallest patch with all cells that touch a wanted one of the nodes around the picture."""
        touched = wanted[:-1, :-1] | wanted[:-1, 1:] | wanted[1:, :-1] | wanted[1:, 1:]
        # a cell's pixels lie between the middles of four such squares
        touched = touched[:-1, :-1] | touched[:-1, 1:] | touched[1:, :-1] | touched[1:, 1:]
        rows, columns = np.flatnonzero(touched.any(axis=1)), np.flatnonzero(touched.any(axis=0))
        if rows.size == 0:
            return None
        left, top, right, bottom = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
        return Patch(left=int(left), top=int(top), right=int(right), bottom=int(bottom))

    def pixels(self, patch: Patch) -> tuple[slice, slice]:
        """Give the rows and columns of the picture that a patch covers."""
        cell = self.cell
        return (
            slice(patch.top * cell, min(patch.bottom * cell, self.height)),
            slice(patch.left * cell, min(patch.right * cell, self.width)),
        )

    def on_plane(self, patch: Patch, matrix: Array) -> tuple[Array, Array, Array]:
        """Take the nodes around a patch through a (3, 3) matrix; gives x/w, y/w and w, w kept above 1 / far."""
        rays = self.rays[patch.top : patch.bottom + 2, patch.left : patch.right + 2]
        taken = rays @ matrix.T
        w = taken[..., 2]
        bounded = np.maximum(w, 1.0 / (3.0 * _FARTHEST))
        return taken[..., 0] / bounded, taken[..., 1] / bounded, w

    def spread(self, patch: Patch, nodes: Array, samples: int = 1) -> Picture:
        """Interpolate values at the nodes around a patch to all its pixels, at `samples` points along each axis."""
        cell = self.cell * samples
        size = (nodes.shape[1] * cell, nodes.shape[0] * cell)
        full = cv2.resize(nodes.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
        rows, columns = self.pixels(patch)
        height, width = (samples * (part.stop - part.start) for part in (rows, columns))
        return np.asarray(full[cell : cell + height, cell : cell + width], dtype=np.float32)


def _densities(x: Array, y: Array, cell: int) -> tuple[float, float]:
    """Give the texels per pixel in the patch's middle: along the direction with most of them, and the mean."""
    row, column = x.shape[0] // 2, x.shape[1] // 2
    across = (x[row, column] - x[row, column - 1], y[row, column] - y[row, column - 1])
    down = (x[row, column] - x[row - 1, column], y[row, column] - y[row - 1, column])
    change = np.array([across, down]) / cell
    return float(np.linalg.norm(change, 2)), math.sqrt(abs(float(np.linalg.det(change))))


def _level(texels: float, levels: int) -> int:
    """Give the pyramid's coarsest level of which `texels` of the finest one are at least one texel."""
    return min(levels - 1, max(0, math.floor(math.log2(max(texels, 1.0)))))


def _fold(coordinate: Picture, nodes: Array, texels: int) -> None:
    """Bring a texture's coordinates into its first period, in place, where nodes leave the texture.

    The texture holds two periods. OpenCV wraps by itself, but ten times slower than it samples.
    """
    if float(nodes.min()) < 0.0 or float(nodes.max()) > texels - 1:
        period = np.float32(texels // 2)
        begun = coordinate * (np.float32(1.0) / period)
        np.floor(begun, out=begun)
        begun *= period
        coordinate -= begun


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


class Renderer:
    """Renders the mean light over an exposure, as grey values of albedo times 255."""

    def __init__(
        self, intrinsics: Intrinsics, targets: Sequence[TargetConfig], *, contrast: float, rng: np.random.Generator
    ) -> None:
        cv2.setNumThreads(1)  # threads gain nothing on such small pictures and make the time depend on the machine
        self._intrinsics = intrinsics
        self._boards = tuple((board, target.sides) for target in targets for board in target.pad.boards)
        self._prints = tuple(pad_texture(board) for board, _ in self._boards)
        self._ground = ground_texture(contrast)
        self._detail = detail_texture(contrast)
        self._coarse = Grid(intrinsics, _COARSE_CELL)
        self._exact = Grid(intrinsics, _FINE_CELL)
        self._pair = tuple(
            (Grid(intrinsics, _COARSE_CELL, offset), Grid(intrinsics, _FINE_CELL, offset)) for offset in _OFFSETS
        )
        self._ground_shift = rng.random(2) * GROUND_PERIOD
        turn = 2.0 * math.pi * float(rng.random())
        c, s = math.cos(turn), math.sin(turn)
        self._ground_from_ned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        edge = self._coarse.rays[:: self._coarse.rows + 1, :: self._coarse.columns + 1]
        self._widest = 1.1 * np.abs(edge[..., :2]).reshape(-1, 2).max(axis=0)  # half the field of view, as tangents
        shape = (intrinsics.height, intrinsics.width)
        self._frame: Image = np.zeros(shape, dtype=np.uint8)
        self._near: Image = np.zeros(shape, dtype=np.uint8)
        self._mask: Image = np.zeros(shape, dtype=np.uint8)

    def ground_points(self, scene: Scene) -> tuple[Array, Array]:
        """Give north and east [m] of the ground at the coarse grid's nodes (far ones bounded)."""
        north, east, _ = self._coarse.on_plane(self._coarse.whole, _inverse(scene.ground_in_cam()))
        return north, east

    def spread(self, nodes: Array) -> Picture:
        """Interpolate values at the coarse grid's nodes to all pixels."""
        return self._coarse.spread(self._coarse.whole, nodes)

    def render(self, exposure: Exposure) -> Picture:
        """Give the mean light (height, width) over the exposure."""
        count = self._pictures_needed(exposure)
        length = exposure.t_close - exposure.t_open
        total: Picture = np.zeros(self._frame.shape, dtype=np.float32)
        for index in range(count):
            scene = exposure.at(exposure.t_open + length * (index + 0.5) / count)
            self._draw(scene, *self._pair[index % 2])
            cv2.accumulate(self._frame, total)
        total *= np.float32(1.0 / count)
        return total

    def _pictures_needed(self, exposure: Exposure) -> int:
        """Give an even number of pictures, from the motion in the picture between the two ends of the exposure."""
        first, last = exposure.at(exposure.t_open), exposure.at(exposure.t_close)
        turned = first.ned_from_cam.T @ last.ned_from_cam
        angle = math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(turned)) - 1.0))))
        moved = last.camera_ned - first.camera_ned
        motion = float(np.linalg.norm(moved)) / max(0.05, -float(last.camera_ned[2]))
        for before, after in zip(first.boards, last.boards, strict=True):
            shift = float(np.linalg.norm(after.center_ned - before.center_ned - moved))
            away = after.center_ned - last.camera_ned
            depth = max(0.05, abs(float(away @ after.ned_from_board[:, 2])))  # of the printed plane before the lens
            if float(np.linalg.norm(away - depth * after.ned_from_board[:, 2])) < 3.0 * depth + 1.0:
                motion = max(motion, shift / depth + abs(after.yaw - before.yaw))
        pixels = self._intrinsics.fx * (angle + motion)
        return min(_MOST_PICTURES, 2 * max(1, math.ceil(0.5 * pixels / _BLUR_STEP - 0.25)))

    def _draw(self, scene: Scene, coarse: Grid, fine: Grid) -> None:
        order = sorted(
            range(len(self._boards)),
            key=lambda index: -float(np.linalg.norm(scene.boards[index].center_ned - scene.camera_ned)),
        )
        outlines = {index: self._outline(scene, index) for index in order}
        covered = [outline for outline in outlines.values() if outline is not None and self._covers(outline)]
        if not covered:
            self._draw_ground(scene, coarse)
        for index in order:
            if self._boards[index][1]:
                self._draw_sides(scene, index, coarse.offset)
            outline = outlines[index]
            if outline is not None:
                self._draw_print(scene, index, outline, fine)

    def _outline(self, scene: Scene, index: int) -> Array | None:
        """Give the outline of a board in the picture, (n, 2) [px]; None where its printed side is not in view."""
        board = scene.boards[index]
        if not board.is_before(scene.camera_ned + 0.01 * board.ned_from_board[:, 2]):
            return None
        half_x, half_y = (0.5 * side for side in self._boards[index][0].size)
        square = np.array([[half_x, -half_y, 1], [half_x, half_y, 1], [-half_x, half_y, 1], [-half_x, -half_y, 1]])
        return self._to_picture(square @ scene.plane_in_cam(board).T)

    def _to_picture(self, polygon_cam: Array) -> Array | None:
        points = clip_to_view(polygon_cam, self._widest)
        return None if points is None else self._intrinsics.project(points)

    def _covers(self, outline: Array) -> bool:
        right, bottom = self._intrinsics.width, self._intrinsics.height
        polygon = outline.astype(np.float32)
        edge = ((-1, -1), (right, -1), (right, bottom), (-1, bottom))
        return all(cv2.pointPolygonTest(polygon, (float(x), float(y)), measureDist=False) > 0 for x, y in edge)

    def _draw_ground(self, scene: Scene, grid: Grid) -> None:
        in_cam = scene.ground_in_cam() @ _inverse(self._ground_from_ned)
        under = self._ground_from_ned @ np.array([scene.camera_ned[0], scene.camera_ned[1], 1.0])
        from_cam = _inverse(in_cam)
        _, _, w = grid.on_plane(grid.whole, from_cam)
        near = w >= 1.0 / _FARTHEST
        patch = grid.whole if bool(near.all()) else grid.patch_where(near)
        if patch != grid.whole:
            self._frame[...] = _HAZE
        if patch is None:
            return
        rows, columns = grid.pixels(patch)
        frame = self._frame[rows, columns]
        self._sample_repeating(grid, patch, self._ground, GROUND_PERIOD, from_cam, under, frame)
        if -float(scene.camera_ned[2]) / self._intrinsics.fx < 2.0 * DETAIL_TEXEL:
            grain = self._near[rows, columns]
            self._sample_repeating(grid, patch, self._detail, DETAIL_PERIOD, from_cam, under, grain)
            cv2.addWeighted(frame, 1.0, grain, 1.0, -128.0, dst=frame)
        if not bool(near.all()):
            nodes = w[patch.top : patch.bottom + 2, patch.left : patch.right + 2]
            frame[grid.spread(patch, nodes) < 1.0 / _FARTHEST] = _HAZE

    def _sample_repeating(
        self,
        grid: Grid,
        patch: Patch,
        texture: Texture,
        period: float,
        from_cam: Array,
        under: Array,
        destination: Image,
    ) -> None:
        """Sample a repeating texture so that the point under the camera falls in the texture's middle period."""
        shift = np.eye(3)
        shift[0, 2] = -period * math.floor((under[0] + self._ground_shift[0]) / period + 0.5) + self._ground_shift[0]
        shift[1, 2] = -period * math.floor((under[1] + self._ground_shift[1]) / period + 0.5) + self._ground_shift[1]
        self._sample(grid, patch, texture, shift @ from_cam, destination, repeats=True)

    @staticmethod
    def _sample(
        grid: Grid,
        patch: Patch,
        texture: Texture,
        plane_from_cam: Array,
        destination: Image,
        *,
        samples: int = 1,
        repeats: bool = False,
    ) -> None:
        """Sample a texture at `samples` points along each axis of each pixel."""
        x, y, _ = grid.on_plane(patch, texture.texel_from_plane() @ plane_from_cam)
        densest, density = _densities(x, y, grid.cell)
        texels = density / _FINEST_SHARE if samples == 1 else 2.0 * densest / (_SAMPLE_STEP * samples)
        level = _level(texels, len(texture.levels))
        scale = 0.5**level
        x, y = (x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5
        picture = texture.levels[level]
        column, row = grid.spread(patch, x, samples), grid.spread(patch, y, samples)
        if repeats:
            _fold(column, x, picture.shape[1])
            _fold(row, y, picture.shape[0])
        border = cv2.BORDER_WRAP if repeats else cv2.BORDER_REPLICATE
        if samples == 1:
            cv2.remap(picture, column, row, cv2.INTER_LINEAR, dst=destination, borderMode=border)
            return
        fine = cv2.remap(picture, column, row, cv2.INTER_LINEAR, borderMode=border)
        cv2.resize(fine, destination.shape[::-1], dst=destination, interpolation=cv2.INTER_AREA)

    def _draw_sides(self, scene: Scene, index: int, offset: float) -> None:
        for corners_ned, grey in visible_sides(scene, scene.boards[index], self._boards[index][0].size):
            polygon = self._to_picture((corners_ned - scene.camera_ned) @ scene.ned_from_cam)
            if polygon is not None:
                fixed = np.rint((polygon - offset) * (1 << _POLYGON_SHIFT)).astype(np.int32)
                cv2.fillPoly(self._frame, [fixed], grey, cv2.LINE_AA, _POLYGON_SHIFT)

    def _draw_print(self, scene: Scene, index: int, outline: Array, grid: Grid) -> None:
        patch = grid.patch_of(outline)
        if patch is None:
            return
        rows, columns = grid.pixels(patch)
        top = self._near[rows, columns]
        samples = min(_MOST_ALONG, math.isqrt(_MOST_SAMPLES // top.size))
        if samples > 1:
            grid = self._exact  # the points in each pixel are spread by themselves
        plane_from_cam = _inverse(scene.plane_in_cam(scene.boards[index]))
        self._sample(grid, patch, self._prints[index], plane_from_cam, top, samples=max(samples, 1))
        frame = self._frame[rows, columns]
        if self._covers(outline):
            frame[...] = top
            return
        mask = self._mask[rows, columns]
        mask[...] = 0
        fixed = np.rint((outline - grid.offset - (columns.start, rows.start)) * (1 << _POLYGON_SHIFT)).astype(np.int32)
        cv2.fillPoly(mask, [fixed], 255, cv2.LINE_AA, _POLYGON_SHIFT)
        share = mask.astype(np.float32) * np.float32(1.0 / 255.0)
        cv2.blendLinear(top, frame, share, 1.0 - share, dst=frame)
