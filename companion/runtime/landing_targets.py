"""From fused sightings of the pad to landing targets for the autopilot's own precision landing.

PX4 takes the place as it is, without a filter of its own (mavlink_receiver.cpp, precland.cpp), so it gets the track and
not the single measurement: the estimate at the instant of the picture, with that picture fused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from companion.geometry.transform import RigidTransform
from companion.link.pilot_desk import PilotParameters
from companion.messages.pilot import LandingTarget
from companion.messages.target import MeasurementVerdict, TargetTrack
from companion.runtime.tracking import Fusion, Tracking

_FUSED = (MeasurementVerdict.FUSED, MeasurementVerdict.INITIALISED)


class LandingTargets:
    """Makes at most one landing target of a step's fusions: the newest picture's.

    Args:
        parameters: how well the place must be known.
        measurements: fused before a track is used.
        board: size of the pad along its x and y (2,) [m].
    """

    def __init__(self, parameters: PilotParameters, *, measurements: int, board: tuple[float, float]) -> None:
        self._p = parameters
        self._measurements = measurements
        self._board = board

    def newest(self, fusions: Sequence[Fusion], tracking: Tracking) -> LandingTarget | None:
        """Give the landing target of the newest picture that was fused; None where there is none good enough."""
        captures = [fusion.observation.t for fusion in fusions if fusion.verdict in _FUSED]
        if not captures:
            return None
        t = max(captures)
        track, cam_from_pad = tracking.track_at(t), tracking.expected_pad(t)
        if track is None or cam_from_pad is None or not self._good(track):
            return None
        return self._target(track, cam_from_pad)

    def _good(self, track: TargetTrack) -> bool:
        return track.fused >= self._measurements and position_std(track) <= self._p.target_std_m

    def _target(self, track: TargetTrack, cam_from_pad: RigidTransform) -> LandingTarget:
        x, y, z = (float(value) for value in cam_from_pad.translation)
        distance = math.sqrt(x * x + y * y + z * z)
        ahead, aside = self._board
        return LandingTarget(
            t=track.t,
            position_ned=track.position_ned,
            yaw=track.yaw_ned,
            position_std=position_std(track),
            distance=distance,
            angle_right=math.atan2(x, z),
            angle_down=math.atan2(y, z),
            size_right=2.0 * math.atan2(0.5 * aside, distance),
            size_down=2.0 * math.atan2(0.5 * ahead, distance),
        )


def position_std(track: TargetTrack) -> float:
    """Give the larger standard deviation [m] of the horizontal position."""
    return math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1]), 0.0))
