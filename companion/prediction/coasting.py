"""The track of a target that is out of sight: where the forecast puts it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.messages.ownship import OwnshipState
from companion.messages.target import HEADING, POSITION, TURN_RATE, VELOCITY, Prediction, TargetTrack


def coasted(track: TargetTrack, prediction: Prediction, ownship: OwnshipState) -> TargetTrack:
    """Put the forecast in the place of a filter that has not seen the target for a while.

    The filter goes on at its last velocity; the forecast knows the motion better. Pose, velocity and the covariance of
    the pose are the forecast's, that of the velocity the filter's.

    Args:
        track: the filter's.
        prediction: for the same instant.
        ownship: our own motion then.
    """
    target = prediction.at(track.t)
    level_from_ned = rotation_about_z(-ownship.yaw)
    state = track.state.copy()
    state[POSITION] = level_from_ned @ (target.position_ned - ownship.position_ned)
    state[HEADING] = wrap_angle(target.yaw - ownship.yaw)
    state[VELOCITY] = level_from_ned @ target.velocity_ned
    state[TURN_RATE] = target.yaw_rate
    turn = np.eye(4)
    turn[:3, :3] = level_from_ned
    covariance: Array = np.zeros((8, 8))
    covariance[:4, :4] = turn @ target.covariance @ turn.T
    covariance[4:, 4:] = track.covariance[4:, 4:]
    return replace(
        track,
        state=state,
        covariance=covariance,
        position_ned=target.position_ned,
        velocity_ned=target.velocity_ned,
        yaw_ned=wrap_angle(target.yaw),
    )
