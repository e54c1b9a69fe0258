"""Tracks for the predictors' tests."""

from __future__ import annotations

import numpy as np

from companion.geometry.angles import wrap_angle
from companion.messages.target import TargetTrack


def track(
    t: float,
    pose: np.ndarray,
    rate: np.ndarray,
    *,
    counter: int = 3,
    began: float = 0.0,
    age: float = 0.05,
    frame_yaw: float = 0.0,
    east_variance: float = 1e-3,
) -> TargetTrack:
    """Give a state of a track with a pose and rate (4,) in the odometry's frame, seen `age` [s] ago."""
    state = np.zeros(8)
    state[3] = wrap_angle(pose[3] - frame_yaw)
    state[4:] = rate
    return TargetTrack(
        t=t,
        t_measured=t - age,
        state=state,
        covariance=np.diag([1e-3, east_variance, 1e-3, 1e-4, 1e-2, 1e-2, 1e-2, 1e-2]),
        position_ned=pose[:3],
        velocity_ned=rate[:3],
        yaw_ned=wrap_angle(float(pose[3])),
        reset_counter=counter,
        nis=4.0,
        nis_mean=1.0,
        fused=100,
        t_began=began,
    )
