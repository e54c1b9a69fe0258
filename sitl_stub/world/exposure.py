"""What moves while the shutter is open: poses of camera and platforms at any instant of an exposure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sitl_stub.truth import Quaternion, Truth
from sitl_stub.world.pads import Pad

Array = npt.NDArray[np.float64]

# x_cam -> +y_frd, y_cam -> -x_frd, z_cam -> +z_frd: looking straight down, the picture's top towards the nose.
DOWN_FRD_FROM_CAM: Array = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mount:
    """Where the camera sits on the vehicle."""

    position_frd: Array  # (3,) [m] optical centre
    frd_from_cam: Array  # (3, 3)

    @classmethod
    def looking_down(cls, position_frd: Sequence[float], turned_rad: Sequence[float] = (0.0, 0.0, 0.0)) -> Mount:
        """Make a mount that looks down with the picture's top towards the nose, then turned by (roll, pitch, yaw)."""
        roll, pitch, yaw = (float(angle) for angle in turned_rad)
        half = (0.5 * roll, 0.5 * pitch, 0.5 * yaw)
        (cr, cp, cy), (sr, sp, sy) = (tuple(map(f, half)) for f in (math.cos, math.sin))
        turned = (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
        return cls(
            position_frd=np.asarray(position_frd, dtype=float),
            frd_from_cam=rotation_of(turned) @ DOWN_FRD_FROM_CAM,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardPose:
    """A printed board at one instant: origin at its centre, on the printed surface."""

    center_ned: Array  # (3,) [m]
    yaw: float  # [rad] from north, of the x of a platform's top, or of the body that a face stands on
    ned_from_board: Array  # (3, 3) z into the board; a platform's top has x forward, y right, a face x up, y right

    def is_before(self, camera_ned: Array) -> bool:
        """Whether a camera (3,) [m] is on the printed side."""
        return float((camera_ned - self.center_ned) @ self.ned_from_board[:, 2]) < 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Camera and platforms at one instant."""

    t: float  # [s]
    camera_ned: Array  # (3,) [m] optical centre
    ned_from_cam: Array  # (3, 3)
    boards: tuple[BoardPose, ...]  # of all targets, in their order

    def plane_in_cam(self, board: BoardPose) -> Array:
        """Give the (3, 3) matrix that takes board plane coordinates (x, y, 1) to points in cam [m]."""
        cam_from_board = self.ned_from_cam.T @ board.ned_from_board
        return np.column_stack(
            [cam_from_board[:, 0], cam_from_board[:, 1], self.ned_from_cam.T @ (board.center_ned - self.camera_ned)]
        )

    def ground_in_cam(self) -> Array:
        """Give the (3, 3) matrix that takes ground coordinates (north, east, 1) to points in cam [m]."""
        cam_from_ned = self.ned_from_cam.T
        return np.column_stack([cam_from_ned[:, 0], cam_from_ned[:, 1], -cam_from_ned @ self.camera_ned])


def rotation_of(quaternion: Quaternion) -> Array:
    """Give the rotation matrix of a quaternion (w, x, y, z), normalised here."""
    w, x, y, z = quaternion
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    xx, yy, zz = scale * x * x, scale * y * y, scale * z * z
    xy, xz, yz = scale * x * y, scale * x * z, scale * y * z
    wx, wy, wz = scale * w * x, scale * w * y, scale * w * z
    return np.array([[1 - yy - zz, xy - wz, xz + wy], [xy + wz, 1 - xx - zz, yz - wx], [xz - wy, yz + wx, 1 - xx - yy]])


class Exposure:
    """The time the shutter is open, with the true states around it; poses in between are interpolated.

    Positions and headings linearly, attitude by the normalised mean of quaternions: between states 4 ms apart the error
    is below a hundredth of a pixel in any flight.
    """

    def __init__(
        self,
        states: Sequence[Truth],
        t_open: float,
        t_close: float,
        *,
        mount: Mount,
        pads: Sequence[Pad],
        shown: Callable[[Scene], Scene] | None = None,
    ) -> None:
        self.t_open = t_open
        self.t_close = t_close
        self._states = states
        self._mount = mount
        self._pads = pads
        self._shown = shown  # what is seen in the place of the truth

    @property
    def t_middle(self) -> float:
        """Middle of the exposure [s]."""
        return 0.5 * (self.t_open + self.t_close)

    def at(self, t: float) -> Scene:
        """Give the poses at `t` [s]."""
        states = self._states
        index = 1
        while index < len(states) - 1 and states[index].t < t:
            index += 1
        before, after = (states[index - 1], states[index]) if len(states) > 1 else (states[0], states[0])
        span = after.t - before.t
        scene = self._between(before, after, (t - before.t) / span if span > 0.0 else 0.0, t)
        return scene if self._shown is None else self._shown(scene)

    def _between(self, before: Truth, after: Truth, share: float, t: float) -> Scene:
        a, b = before.vehicle, after.vehicle
        qa, qb = a.quaternion, b.quaternion
        sign = 1.0 if qa[0] * qb[0] + qa[1] * qb[1] + qa[2] * qb[2] + qa[3] * qb[3] >= 0.0 else -1.0
        left, right = 1.0 - share, share * sign
        ned_from_frd = rotation_of(
            (
                left * qa[0] + right * qb[0],
                left * qa[1] + right * qb[1],
                left * qa[2] + right * qb[2],
                left * qa[3] + right * qb[3],
            )
        )
        position = np.array([p + share * (q - p) for p, q in zip(a.position_ned, b.position_ned, strict=True)])
        boards = []
        for pad, first, second in zip(self._pads, before.targets, after.targets, strict=True):
            landing = [p + share * (q - p) for p, q in zip(first.position_ned, second.position_ned, strict=True)]
            boards.extend(board_poses(pad, landing, first.yaw + share * (second.yaw - first.yaw)))
        return Scene(
            t=t,
            camera_ned=position + ned_from_frd @ self._mount.position_frd,
            ned_from_cam=ned_from_frd @ self._mount.frd_from_cam,
            boards=tuple(boards),
        )


def board_poses(pad: Pad, landing_point_ned: Sequence[float], landing_yaw: float) -> list[BoardPose]:
    """Give the poses of a target's boards, in the order of `pad.boards`, from its landing point [m] and heading [rad].

    A body's landing point is its reference point on the ground.
    """
    if not pad.faces:
        return [board_pose(pad, landing_point_ned, landing_yaw)]
    yaw = landing_yaw - pad.landing_heading
    c, s = math.cos(yaw), math.sin(yaw)
    ned_from_body = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return [
        BoardPose(
            center_ned=np.asarray(landing_point_ned, dtype=float) + ned_from_body @ np.array(face.center),
            yaw=yaw,
            ned_from_board=ned_from_body @ face.body_from_board(),
        )
        for face in pad.faces
    ]


def board_pose(pad: Pad, landing_point_ned: Sequence[float], landing_yaw: float) -> BoardPose:
    """Give the pose of a platform's top from its landing point [m] and landing heading [rad]."""
    yaw = landing_yaw - pad.landing_heading
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = pad.landing_point
    return BoardPose(
        center_ned=np.array(
            [landing_point_ned[0] - c * x + s * y, landing_point_ned[1] - s * x - c * y, landing_point_ned[2]]
        ),
        yaw=yaw,
        ned_from_board=np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
    )
