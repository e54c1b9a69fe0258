"""A near target that is not seen where it should be: a vehicle on the ground backs out from it, not on.

A forecast says where to look, but not where it is safe to drive: a leader that is followed may have stopped where it
was seen last, whatever the forecast says. One that has left the picture to the side is turned to instead, for a while:
that it is not seen says nothing against the forecast.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.guidance.conditions import without_frames
from companion.guidance.memory import pose_moved_by_reset
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.view import View
from companion.messages.target import POSITION, Prediction, TargetPose, TargetTrack

FRESH_S = 0.3  # [s] an older sighting does not say where the target stands
_FOLLOWING = (
    0.5  # cosine between the target's course and the vehicle's, above which it is behind it, not across its way
)
_STEADY_S = 1.0  # [s] seen for longer, it will not leave the picture again at once


class NearSight:
    """Holds where the target was seen last, and since when it should have been seen.

    Args:
        parameters: of the guidance.
        standoff: of the vehicle's place behind the target [m].
    """

    def __init__(self, parameters: GuidanceParameters, *, standoff: float) -> None:
        self._acquisition, self._p, self._standoff = parameters.acquisition, parameters.ground, standoff
        self._may_stand_at: TargetPose | None = None  # the target as seen last; None: it has gone on, or never was seen
        self._t_seen = -math.inf  # [s] capture time of the newest sighting
        self._t_unseen = -math.inf  # [s] when the target was last out of sight
        self._t_excused = -math.inf  # [s] when the target was last where it need not be seen
        self._retreat: tuple[Array, float] | None = None  # position [m] and heading [rad]; None: it does not back out

    def forget(self) -> None:
        """Begin anew, as the operator engages again."""
        self._may_stand_at, self._retreat = None, None

    def end_retreat(self) -> None:
        """Back out no longer: another mode begins."""
        self._retreat = None

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator; arguments as in `Policy.rebase`."""
        if self._retreat is not None:
            self._retreat = pose_moved_by_reset(self._retreat, translation_ned, yaw, pivot_ned)
        seen = self._may_stand_at
        if seen is not None:
            place, heading = pose_moved_by_reset((seen.position_ned, seen.yaw), translation_ned, yaw, pivot_ned)
            velocity = rotation_about_z(yaw) @ seen.velocity_ned
            self._may_stand_at = replace(seen, position_ned=place, velocity_ned=velocity, yaw=heading)

    def may_stand_at(self, view: View) -> TargetPose | None:
        """Give the target as it was in sight last, where it may stand since; None while it is, or if it has gone on."""
        in_sight = view.track is not None and view.track.age < FRESH_S
        return None if in_sight else self._may_stand_at

    def watch(self, view: View) -> None:
        """Note where the target is seen, and when it was last where it need not be seen.

        That is where it is far away, by the forecast and by where it may stand; and where it is aside of the picture,
        unless the vehicle stands, which turns it to nothing, or a target that may stand is out of sight for
        `blind_most_s`.
        """
        p, track, expected = self._p, view.track, False
        if track is not None and view.prediction is not None:
            if track.age >= p.blind_s:
                self._t_unseen = view.t
            if track.age < FRESH_S and track.t_measured > self._t_seen:
                self._note(view.prediction.at(view.t), view.ownship.yaw)
                self._t_seen = track.t_measured
            x, y = track.state[POSITION][:2].tolist()
            # not by odometry, which may drift by as much as that
            stands = view.planned_speed < p.blind_still_mps
            near = self._is_near(math.hypot(x, y)) or self._is_near(self._range_where_it_may_stand(view))
            long_unseen = self._may_stand_at is not None and track.age >= p.blind_most_s
            expected = near and (stands or long_unseen or abs(math.atan2(y, x)) < p.blind_ahead_rad)
        if not expected or without_frames(self._acquisition, view) is not None:
            self._t_excused = view.t

    def _note(self, seen: TargetPose, yaw: float) -> None:
        """Note a sighting, by a vehicle at the heading `yaw` [rad], and whether the target may stand there from now on.

        One that is followed may stop; one that is slow may stand, whichever way it seems to drive, since odometry
        drifts as much. One that crosses the vehicle's way goes on: waited for, it would be lost.
        """
        north, east = seen.velocity_ned[:2].tolist()
        speed = math.hypot(north, east)
        followed = math.cos(yaw) * north + math.sin(yaw) * east >= _FOLLOWING * speed
        self._may_stand_at = seen if followed or speed < self._p.slow_unseen_mps else None

    def is_backing_out(self, view: View) -> bool:
        """Say whether the vehicle backs out from a target that it does not see, by the last answer of `retreat`."""
        return self._retreat is not None and view.track is not None and view.track.age >= self._p.blind_s

    def retreat(self, view: View, prediction: Prediction) -> tuple[Array, float] | None:
        """Give the place (3,) [m] and the heading [rad] to back out to, until the target is seen; None: it need not.

        It is behind the target as it should have been when that began, or where it may stand, if that is nearer; and on
        the vehicle's side of one that it is not behind. Asked once in each step: it holds the answer.
        """
        p, track = self._p, view.track
        if track is None or (track.age < p.blind_s and self._is_in_view(view, track)):
            self._retreat = None
        elif track.age < p.blind_s:
            pass  # a moment at the picture's edge: what has just come into it may leave it as soon
        elif self._retreat is None and view.t_frame - max(self._t_excused, track.t_measured) >= p.blind_s:
            # by the newest picture, not by the clock: where none comes, nothing says that it is not there
            place = view.ownship.position_ned
            pose = self._nearest(place, prediction.at(view.t))
            north, east = (pose.position_ned - place)[:2].tolist()
            bearing = math.atan2(east, north)
            heading = pose.yaw if math.cos(bearing - pose.yaw) >= _FOLLOWING else bearing
            back = (self._standoff + p.retreat_m) * np.array([math.cos(heading), math.sin(heading), 0.0])
            self._retreat = (pose.position_ned - back, heading)
        return self._retreat

    def farther_back(self, place: Array, forecast: TargetPose) -> Array:
        """Give the place (3,) [m] to look about from, or one farther back where the target may be beside it."""
        away = (self._nearest(place, forecast).position_ned - place) * (1.0, 1.0, 0.0)
        distance = math.hypot(*away[:2].tolist())
        moved = self._p.retreat_m / distance if distance > 0.0 and self._is_near(distance) else 0.0
        result: Array = place - moved * away
        return result

    def _is_in_view(self, view: View, track: TargetTrack) -> bool:
        """Say whether the target is seen well: in the middle of the picture, far away, driving on, or for some time."""
        x, y = track.state[POSITION][:2].tolist()
        well = abs(math.atan2(y, x)) < self._p.blind_ahead_rad or not self._is_near(math.hypot(x, y))
        drives = math.hypot(*track.velocity_ned[:2].tolist()) >= self._p.slow_unseen_mps
        return well or drives or view.t - self._t_unseen > _STEADY_S

    def _is_near(self, distance: float) -> bool:
        return distance < self._standoff + self._p.blind_near_m

    def _range_where_it_may_stand(self, view: View) -> float:
        if self._may_stand_at is None:
            return math.inf
        return _distance(self._may_stand_at, view.ownship.position_ned)

    def _nearest(self, place: Array, forecast: TargetPose) -> TargetPose:
        """Give what is nearer to a place: the target by the forecast, or where it may stand."""
        poses = [forecast] if self._may_stand_at is None else [forecast, self._may_stand_at]
        return min(poses, key=lambda pose: _distance(pose, place))


def _distance(pose: TargetPose, place: Array) -> float:
    return math.hypot(*(pose.position_ned - place)[:2].tolist())
