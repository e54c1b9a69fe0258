"""What a camera is made to see wrongly: nothing at all, no target, or the target where it is not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sitl_stub.world.documents import NOT_NEGATIVE, POSITIVE, Section
from sitl_stub.world.exposure import BoardPose, Scene
from sitl_stub.world.pads import Pad

KINDS = ("no_frames", "no_tag")
_NEAREST, _FARTHEST = 0.5, 6.0  # [m] range of a target seen where it is not
_WIDEST = math.radians(24.0)  # from the middle of the picture: inside that of a camera 640 by 480 at fx = 500
_AWAY = 1.0e4  # [m] north and east: out of every picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Blindness:
    """Sight lost again and again: first `sight` seconds of it, then `length` seconds without, and so on."""

    kind: str = "no_frames"  # one of KINDS: the camera is dead, or something covers the target
    length: float = 0.0  # [s]; 0: never
    sight: float = 5.0  # [s]
    begin: float = 0.0  # [s] before it nothing is lost,
    end: float = math.inf  # [s] nor from then on

    @classmethod
    def read(cls, section: Section) -> Blindness:
        """Read the `blind:` mapping of a world's camera."""
        if not section.has("for_s"):
            section.finish()
            return cls()
        blindness = cls(
            kind=section.choice("kind", KINDS, "no_frames"),
            length=section.number("for_s", bounds=POSITIVE),
            sight=section.number("sight_s", 5.0, NOT_NEGATIVE),
            begin=section.number("from_s", 0.0, NOT_NEGATIVE),
            end=section.number("to_s", bounds=POSITIVE) if section.has("to_s") else math.inf,
        )
        section.finish()
        return blindness

    def at(self, t: float) -> str | None:
        """Give the kind of blindness at `t` [s], None with sight."""
        if self.length == 0.0 or not self.begin <= t < self.end:
            return None
        return self.kind if (t - self.begin) % (self.sight + self.length) >= self.sight else None


def cover(scene: Scene) -> Scene:
    """Give a scene in which no target is to be seen; the ground is."""
    away = np.array([_AWAY, _AWAY, 0.0])
    return replace(scene, boards=tuple(replace(board, center_ned=away) for board in scene.boards))


class Misplacement:
    """Puts every target at a random range, bearing and heading from the camera, for one exposure.

    A platform anywhere before the camera; a body, which stands, on its floor before the camera.
    """

    def __init__(self, pads: Sequence[Pad], rng: np.random.Generator) -> None:
        self._pads = pads
        self._places = tuple(_place(rng) for _ in pads)

    def __call__(self, scene: Scene) -> Scene:
        """Give the scene so spoilt."""
        boards, begin = [], 0
        for pad, (place, turn) in zip(self._pads, self._places, strict=True):
            own = scene.boards[begin : begin + len(pad.boards)]
            begin += len(pad.boards)
            boards.extend(_body_moved(scene, own, place, turn) if pad.faces else [_moved(scene, own[0], place, turn)])
        return replace(scene, boards=tuple(boards))


def _place(rng: np.random.Generator) -> tuple[npt.NDArray[np.float64], float]:
    distance, bearing, angle, turn = rng.random(4)
    distance = _NEAREST + (_FARTHEST - _NEAREST) * distance
    bearing, angle = 2.0 * math.pi * bearing, _WIDEST * angle
    aside = math.sin(angle)
    place = distance * np.array([aside * math.cos(bearing), aside * math.sin(bearing), math.cos(angle)])
    return place, 2.0 * math.pi * float(turn)


def _body_moved(
    scene: Scene, boards: Sequence[BoardPose], place: npt.NDArray[np.float64], turn: float
) -> list[BoardPose]:
    """Turn a body about the vertical; put the middle of its boards at the range and the sideways bearing of a place."""
    ahead = scene.ned_from_cam[:2, 2] / np.linalg.norm(scene.ned_from_cam[:2, 2])
    distance, aside = float(np.linalg.norm(place)), math.atan2(place[0], place[2])
    c, s = math.cos(aside), math.sin(aside)
    middle = np.mean([board.center_ned for board in boards], axis=0)
    there = middle.copy()
    there[:2] = scene.camera_ned[:2] + distance * np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
    c, s = math.cos(turn), math.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return [
        BoardPose(
            center_ned=there + turned @ (board.center_ned - middle),
            yaw=board.yaw + turn,
            ned_from_board=turned @ board.ned_from_board,
        )
        for board in boards
    ]


def _moved(scene: Scene, board: BoardPose, place: npt.NDArray[np.float64], turn: float) -> BoardPose:
    c, s = math.cos(turn), math.sin(turn)
    return BoardPose(
        center_ned=scene.camera_ned + scene.ned_from_cam @ place,
        yaw=board.yaw + turn,
        ned_from_board=board.ned_from_board @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
    )
