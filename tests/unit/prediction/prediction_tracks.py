"""Tracks for the predictors' tests."""

from __future__ import annotations

import numpy as np
import pytest

from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import rotation_about_z
from companion.messages.target import Prediction, TargetTrack
from companion.prediction.predictor import Predictor

RESET = OwnshipReset(t=3.0, translation_ned=np.array([14.8, -76.7, 2.0]), yaw=0.6, counter=5)


def cubic(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Give pose and rate (4,) of a motion that a polynomial of third order says exactly."""
    c = np.array([[1.0, 2.0, -0.2, 3.0], [0.3, 0.1, 0.0, 0.2], [0.05, -0.1, 0.02, 0.03], [0.02, 0.01, 0.0, -0.01]])
    s = np.array([1.0, t, t * t, t**3])
    return s @ c, np.array([0.0, 1.0, 2.0 * t, 3.0 * t * t]) @ c


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


def with_and_without_reset(plain: Predictor, reset: Predictor) -> tuple[Prediction, Prediction]:
    """Give the forecasts of two predictors that see the cubic for 4 s, one of them through `RESET`."""
    turn = rotation_about_z(RESET.yaw)
    forecasts = None, None
    for k in range(201):
        t = k / 50
        pose, rate = cubic(t)
        plain.add(track(t, pose, rate, east_variance=2e-3))
        if k < 150:
            reset.add(track(t, pose, rate, east_variance=2e-3))
        else:
            if k == 150:
                reset.rebase(RESET)
            moved, moved_rate = pose.copy(), rate.copy()
            moved[:3], moved_rate[:3] = RESET.position(pose[:3]), turn @ rate[:3]
            moved[3] += RESET.yaw
            reset.add(track(t, moved, moved_rate, counter=RESET.counter, frame_yaw=RESET.yaw, east_variance=2e-3))
        forecasts = plain.predict(), reset.predict()
    before, after = forecasts
    assert before is not None
    assert after is not None
    return before, after


def assert_taken_along(
    before: Prediction, after: Prediction, times: tuple[float, ...], *, atol: float, covariance: tuple[float, float]
) -> None:
    """Compare a forecast with one after `RESET`; `covariance`: relative and absolute tolerance."""
    turn = rotation_about_z(RESET.yaw)
    assert after.reset_counter == RESET.counter
    for t in times:
        a, b = before.at(t), after.at(t)
        np.testing.assert_allclose(b.position_ned, RESET.position(a.position_ned), atol=atol)
        rtol, most = covariance
        np.testing.assert_allclose(b.covariance[:3, :3], turn @ a.covariance[:3, :3] @ turn.T, rtol=rtol, atol=most)
        assert wrap_angle(b.yaw - a.yaw - RESET.yaw) == pytest.approx(0.0, abs=atol)
