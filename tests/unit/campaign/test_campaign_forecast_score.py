"""Forecasts that led out of sight: off by what they are off, in the true frame, and only when the target was gone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.campaign.forecast_score import ForecastScorer
from companion.campaign.truth import TargetSample, TruthSample
from companion.geometry.rotations import rotation_about_z
from companion.messages.ownship import OwnshipState
from companion.messages.target import TargetPose

SPEED, ERROR, TURN = 0.5, 0.1, 0.7
SHIFT = np.array([40.0, -7.0, 0.0])  # of the odometry's frame, which is turned by TURN as well


class Straight:
    """A forecast, in the odometry's frame, of a target that drives north; ahead of the truth by ERROR."""

    horizon, reset_counter = 6.0, 0

    def __init__(self, t: float) -> None:
        self.t = t

    def at(self, t: float) -> TargetPose:
        place = rotation_about_z(TURN) @ np.array([3.0 + SPEED * t + ERROR, 1.0, 0.0]) + SHIFT
        return TargetPose(
            t=t,
            position_ned=place,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=TURN,
            yaw_rate=0.0,
            covariance=np.zeros((4, 4)),
        )


def scored(*, lost: tuple[float, float], stops: float = math.inf) -> ForecastScorer:
    """Watch for 12 s a target out of sight between two instants."""
    scorer = ForecastScorer()
    for k in range(600):
        t = 0.02 * k
        heading = 0.3 + 0.01 * t
        target = TargetSample(
            name="rover",
            position_ned=(3.0 + SPEED * min(t, stops), 1.0, 0.0),
            yaw=0.0,
            velocity_ned=(SPEED, 0.0, 0.0),
            yaw_rate=0.0,
            moving=t < stops,
        )
        sample = TruthSample(
            t=t,
            position_ned=(0.2 * t, 0.0, 0.0),
            velocity_ned=(0.2, 0.0, 0.0),
            yaw=heading,
            armed=True,
            feet_in_contact=4,
            surface="ground",
            targets=(target,),
        )
        ownship = OwnshipState(
            t=t,
            position_ned=rotation_about_z(TURN) @ np.array([0.2 * t, 0.0, 0.0]) + SHIFT,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            ned_from_frd=rotation_about_z(heading + TURN),
            angular_velocity_frd=np.zeros(3),
            reset_counter=0,
        )
        age = t - lost[0] if lost[0] <= t < lost[1] else 0.05
        scorer.look(age=age, prediction=Straight(t), ownship=ownship, sample=sample, target=target)
    return scorer


def test_a_forecast_is_wrong_by_what_it_is_wrong_in_the_true_frame() -> None:
    # the truth is sampled every 0.02 s: up to that later than the instants compared
    assert scored(lost=(2.0, 5.0)).rmse == pytest.approx(ERROR, abs=0.02)


def test_the_forecast_of_the_first_loss_is_kept_in_the_true_frame() -> None:
    scorer = scored(lost=(2.0, 5.0))
    assert scorer.first is not None
    t, north, east = np.array(scorer.first).T
    assert t[0] == pytest.approx(2.0 + 0.5, abs=0.03)
    assert np.diff(t).min() > 0.0
    assert north == pytest.approx(3.0 + SPEED * t + ERROR, abs=1e-6)
    assert east == pytest.approx(1.0, abs=1e-6)


def test_a_short_loss_does_not_count() -> None:
    assert scored(lost=(2.0, 2.9)).rmse is None
    assert scored(lost=(2.0, 2.9)).first is None


def test_what_the_target_does_after_it_has_stopped_is_no_matter_of_the_forecast() -> None:
    assert scored(lost=(2.0, 5.0), stops=4.0).rmse == pytest.approx(ERROR, abs=0.02)
    assert scored(lost=(5.0, 8.0), stops=4.0).rmse is None
