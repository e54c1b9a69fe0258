"""The forecast of a target that winds about: it foresees the turn back, and it says nothing where there is none."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from prediction_tracks import track

from companion.estimation.ownship import OwnshipReset
from companion.geometry.rotations import rotation_about_z
from companion.prediction.evidence import EvidencePredictor
from companion.prediction.parameters import PredictorParameters, WindingParameters
from companion.prediction.predictor import make_predictor
from companion.prediction.winding import WindingRegression
from companion.prediction.winding_forecast import WindingPrediction, WindingPredictor

PARAMETERS = PredictorParameters(method="winding")
Heading = Callable[[float], float]


def regressed(heading: Heading, until: float, seed: int = 0) -> WindingRegression:
    regression, rng = WindingRegression(WindingParameters()), np.random.default_rng(seed)
    for t in np.arange(0.0, until, 0.25):
        regression.add(float(t), heading(float(t)) + 0.01 * rng.standard_normal())
    return regression


def winding(period: float, size: float = 0.5) -> Heading:
    return lambda t: 1.0 + size * math.sin(math.tau * t / period + 0.7)


@pytest.mark.parametrize("period", [6.0, 11.0, 23.0, 40.0])
def test_after_a_period_and_a_half_it_foresees_the_heading(period: float) -> None:
    heading, now = winding(period), 1.5 * period
    course = regressed(heading, now).course(now)
    for ahead in (1.0, 3.0, 6.0):
        change = float(course.change(now, np.array([now + ahead]))[0])
        assert change == pytest.approx(heading(now + ahead) - heading(now), abs=0.08)


@pytest.mark.parametrize("period", [6.0, 11.0])
def test_before_a_period_is_over_it_knows_the_turn_back_better_than_a_steady_turn(period: float) -> None:
    heading, now = winding(period), 0.85 * period
    course = regressed(heading, now).course(now)
    rate = (heading(now) - heading(now - 0.1)) / 0.1
    true = heading(now + 4.0) - heading(now)
    wound = float(course.change(now, np.array([now + 4.0]))[0])
    assert abs(wound - true) < 0.5 * abs(4.0 * rate - true)


def test_a_steady_heading_has_no_winding() -> None:
    course = regressed(lambda t: 0.4, 40.0).course(40.0)
    assert np.abs(course.change(40.0, np.linspace(40.0, 50.0, 11))).max() < 0.05


def test_a_turn_of_the_frame_changes_nothing() -> None:
    turned = regressed(winding(11.0), 20.0)
    turned.turn(1.3)
    turned.add(20.0, winding(11.0)(20.0) + 1.3)
    plain = regressed(winding(11.0), 20.0)
    plain.add(20.0, winding(11.0)(20.0))
    ahead = np.linspace(20.0, 26.0, 7)
    # the prior of the mean heading alone knows the frame
    assert turned.course(20.0).change(20.0, ahead) == pytest.approx(plain.course(20.0).change(20.0, ahead), abs=2e-3)


class Driven:
    """A target that drives along its heading, and two predictors that watch it."""

    def __init__(self, heading: Heading, speed: float, seed: int = 0) -> None:
        self.heading, self.speed = heading, speed
        self.rng = np.random.default_rng(seed)
        self.place, self.t = np.zeros(2), 0.0
        self.winding, self.evidence = make_predictor(PARAMETERS), EvidencePredictor(PredictorParameters())

    def drive(self, until: float, moving: bool = True) -> None:
        while self.t < until - 1e-9:
            turned = self.heading(self.t)
            rate = (self.heading(self.t + 0.02) - turned) / 0.02 if moving else 0.0
            speed = self.speed if moving else 0.0
            velocity = speed * np.array([math.cos(turned), math.sin(turned)])
            noise = 0.003 * self.rng.standard_normal(3)
            pose = np.array([*(self.place + noise[:2]), 0.0, turned + noise[2]])
            seen = track(self.t, pose, np.array([*velocity, 0.0, rate]))
            for predictor in (self.winding, self.evidence):
                predictor.add(seen)
                predictor.predict()
            self.place = self.place + 0.04 * velocity
            self.t += 0.04

    def place_after(self, ahead: float) -> np.ndarray:
        place = self.place.copy()
        for t in np.arange(self.t, self.t + ahead, 0.02):
            place += 0.02 * self.speed * np.array([math.cos(self.heading(t)), math.sin(self.heading(t))])
        return place


def test_a_target_along_a_sine_is_foreseen_better_than_by_the_evidence_alone() -> None:
    drive = Driven(winding(6.0), speed=0.8)
    errors: dict[str, list[float]] = {"winding": [], "evidence": []}
    for k in range(40):
        drive.drive(14.0 + 0.25 * k)
        for name, predictor in (("winding", drive.winding), ("evidence", drive.evidence)):
            prediction = predictor.predict()
            assert prediction is not None
            errors[name].append(math.dist(prediction.at(drive.t + 3.0).position_ned[:2], drive.place_after(3.0)))
    assert isinstance(drive.winding.predict(), WindingPrediction)
    assert np.mean(errors["winding"]) < 0.5 * np.mean(errors["evidence"])


def test_its_poses_are_continuous_and_its_rates_are_their_derivatives() -> None:
    drive = Driven(winding(6.0), speed=0.8)
    drive.drive(16.0)
    prediction = drive.winding.predict()
    assert isinstance(prediction, WindingPrediction)
    times = np.arange(drive.t - 0.3, drive.t + 9.0, 0.01)
    poses = [prediction.at(float(t)) for t in times]
    places = np.array([pose.position_ned for pose in poses])
    velocities = np.array([pose.velocity_ned for pose in poses])
    assert np.abs(np.diff(places, axis=0) - 0.005 * (velocities[1:] + velocities[:-1])).max() < 1e-3
    turns = np.array([pose.yaw for pose in poses])
    assert np.abs(np.diff(turns)).max() < 0.02
    assert prediction.positions_ned(times) == pytest.approx(places, abs=0.01)


def test_a_target_that_stops_is_soon_believed() -> None:
    drive = Driven(winding(11.0), speed=0.5)
    drive.drive(22.3)  # in the middle of a turn
    stopped = drive.heading(drive.t)
    drive.heading = lambda t: stopped
    for until, most in ((24.3, 0.25), (26.3, 0.1)):
        drive.drive(until, moving=False)
        prediction = drive.winding.predict()
        assert prediction is not None
        assert abs(prediction.at(drive.t + 3.0).yaw - prediction.at(drive.t).yaw) < most


def test_a_reset_of_the_frame_takes_the_forecast_along() -> None:
    drive = Driven(winding(6.0), speed=0.8)
    drive.drive(16.0)
    before = drive.winding.predict()
    reset = OwnshipReset(t=drive.t, translation_ned=np.array([3.0, -2.0, 0.0]), yaw=0.8, counter=4)
    drive.winding.rebase(reset)
    turned = drive.heading(drive.t)
    pose = np.array([*(reset.position(np.array([*drive.place, 0.0])))[:2], 0.0, turned + reset.yaw])
    velocity = rotation_about_z(reset.yaw) @ (0.8 * np.array([math.cos(turned), math.sin(turned), 0.0]))
    rate = (drive.heading(drive.t + 0.02) - turned) / 0.02
    drive.winding.add(track(drive.t, pose, np.array([*velocity, rate]), counter=4))
    after = drive.winding.predict()
    assert before is not None
    assert after is not None
    for ahead in (1.0, 4.0):
        old, new = before.at(drive.t + ahead), after.at(drive.t + ahead)
        assert new.position_ned == pytest.approx(reset.position(old.position_ned), abs=0.15)
        assert math.remainder(new.yaw - old.yaw - reset.yaw, math.tau) == pytest.approx(0.0, abs=0.1)


def test_it_begins_anew_with_another_track() -> None:
    drive = Driven(winding(6.0), speed=0.8)
    drive.drive(16.0)
    predictor = drive.winding
    assert isinstance(predictor, WindingPredictor)
    predictor.reset()
    assert predictor.predict() is None
    predictor.add(track(20.0, np.zeros(4), np.zeros(4)))
    assert not isinstance(predictor.predict(), WindingPrediction)
