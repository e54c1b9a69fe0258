"""Pictures of tags made from first principles, for the tests of perception only.

Every pixel is the mean of many rays, so the truth is known to a small part of a pixel. The cells of a tag are those of
the official AprilTag images; OpenCV 4 draws them turned by half a turn.
"""

from __future__ import annotations

import cv2
import numpy as np

_DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
# first row of the official picture of tag 36h11 number 0, frame left out: white cells are 1
OFFICIAL_TAG_0_FIRST_ROW = (1, 1, 0, 1, 0, 1)


def tag_cells(tag_id: int) -> np.ndarray:
    """Cells (8, 8) of a tag as printed, 0 black and 1 white, its black frame included."""
    cells = cv2.aruco.generateImageMarker(_DICTIONARY, tag_id, 8) // 255
    if int(cv2.__version__.split(".")[0]) < 5:
        cells = cells[::-1, ::-1]
    return np.ascontiguousarray(cells)


def official_code_of_tag_0() -> int:
    """Bits of tag 0 as drawn by `tag_cells`, row by row: AprilTag 2 publishes them as 0xd5d628584."""
    return int("".join(str(cell) for cell in tag_cells(0)[1:7, 1:7].ravel()), 2)


def render(
    tags: list[tuple[int, float, float, float, float]],
    cam_from_pad: tuple[np.ndarray, np.ndarray],
    matrix: np.ndarray,
    distortion: np.ndarray | None = None,
    *,
    size: tuple[int, int] = (640, 480),
    board: float = 0.4,
    levels: tuple[float, float, float] = (40.0, 200.0, 110.0),
    samples: int = 6,
    blur: float = 0.0,
    slope: float = 0.0,
    noise: float = 0.0,
    drift: np.ndarray | None = None,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """Draw a pad.

    Args:
        tags: id, side, x, y and heading [m, rad] of each, in `pad`.
        cam_from_pad: rotation and translation.
        matrix, distortion: the camera.
        size: width and height [px].
        board: half the side [m] of the white board.
        levels: grey of black, white and the ground.
        samples: rays per pixel and axis.
        blur: standard deviation [px] of the lens's blur.
        slope: relative brightening from the left to the right end of the picture.
        noise: standard deviation [grey].
        drift: (3,) [m] motion of the pad in `cam` during the exposure.
        rng: draws the noise.
    """
    rotation, translation = cam_from_pad
    exposures = [translation] if drift is None else [translation + f * drift for f in (np.arange(6) + 0.5) / 6 - 0.5]
    picture = np.mean(
        [_expose(tags, rotation, t, matrix, distortion, size, board, levels, samples) for t in exposures], 0
    )
    if blur > 0.0:
        picture = cv2.GaussianBlur(picture, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
    picture = picture * (1.0 + slope * (np.linspace(-0.5, 0.5, size[0]))[None, :])
    if noise > 0.0:
        assert rng is not None
        picture = picture + rng.normal(0.0, noise, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _expose(tags, rotation, translation, matrix, distortion, size, board, levels, samples):
    black, white, ground = levels
    width, height = size
    picture = np.full((height, width), float(ground))
    edge = np.linspace(-board, board, 9)
    rim = [(a, b) for a in edge for b in (-board, board)] + [(b, a) for a in edge for b in (-board, board)]
    points = np.array([[x, y, 0.0] for x, y in rim]) @ rotation.T + translation
    if (points[:, 2] > 0.02).all():
        seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, distortion)[0][:, 0]
        left, top = np.clip(np.floor(seen.min(0)).astype(int) - 3, 0, (width, height))
        right, bottom = np.clip(np.ceil(seen.max(0)).astype(int) + 4, 0, (width, height))
    else:
        left, top, right, bottom = 0, 0, width, height
    step = (np.arange(samples) + 0.5) / samples - 0.5
    xs = (np.arange(left, right)[:, None] + step).ravel()
    for first in range(top, bottom, 32):
        ys = (np.arange(first, min(first + 32, bottom))[:, None] + step).ravel()
        grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(grid, matrix, distortion)[:, 0]
        rays = np.column_stack((rays, np.ones(len(rays)))) @ rotation
        origin = -rotation.T @ translation
        depth = -origin[2] / rays[:, 2]
        x, y = origin[0] + depth * rays[:, 0], origin[1] + depth * rays[:, 1]
        value = np.where((np.abs(x) <= board) & (np.abs(y) <= board), white, ground)
        for tag_id, side, centre_x, centre_y, heading in tags:
            c, s = np.cos(heading), np.sin(heading)
            ahead = c * (x - centre_x) + s * (y - centre_y)
            right_of = -s * (x - centre_x) + c * (y - centre_y)
            row = np.floor((0.5 - ahead / side) * 8).astype(int)
            column = np.floor((0.5 + right_of / side) * 8).astype(int)
            on = (row >= 0) & (row < 8) & (column >= 0) & (column < 8)
            cells = tag_cells(tag_id)
            value[on] = np.where(cells[row[on], column[on]] == 1, white, black)
        blocks = value.reshape(len(ys) // samples, samples, len(xs) // samples, samples)
        picture[first : first + len(ys) // samples, left:right] = blocks.mean(axis=(1, 3))
    return picture


def corners_of(tag: tuple[int, float, float, float, float]) -> np.ndarray:
    """Corners (4, 3) [m] of a tag in `pad`, top left first, clockwise as printed."""
    _, side, x, y, heading = tag
    local = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]) * side / 2
    c, s = np.cos(heading), np.sin(heading)
    turned = local @ np.array([[c, s], [-s, c]])
    return np.column_stack((turned + np.array([x, y]), np.zeros(4)))


def look_down(
    height: float, *, tilt: float = 0.0, axis: float = 0.0, turn: float = 0.0, x: float = 0.0, y: float = 0.0
):
    """Pose of the pad before a camera that looks at it from `height` [m], tilted and turned [rad], shifted [m]."""
    # the picture's top is towards +x of the pad: x_cam = y_pad, y_cam = -x_pad
    facing = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    spin = cv2.Rodrigues(np.array([0.0, 0.0, turn]))[0]
    lean = cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))[0]
    return lean @ spin @ facing, np.array([x, y, height])
