"""Forecasts of the target by cubic regression over its recent track."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import unwrap_near
from companion.geometry.arrays import Array
from companion.messages.target import TURN_RATE, TargetTrack
from companion.prediction.calibration import ForecastCalibration
from companion.prediction.forecast import PolynomialPrediction
from companion.prediction.parameters import PredictorParameters


class PolynomialPredictor:
    """Keeps the recent track in the autopilot's local frame (our own motion removed) and extrapolates it.

    `paper`: independent least-squares cubics over the last L states (Patel et al., eq. 1 to 3).

    `regularised`: the same cubic as a Bayesian regression. It passes through the present estimate, its present velocity
    is weighed with the filter's, acceleration and jerk are small a priori, and its velocity at `cubic_horizon` is close
    to the mean velocity over the window: what is faster than the window, such as the wander of the odometry or a random
    target's steps, is not carried on for ever. With little history it becomes constant velocity.
    """

    def __init__(self, parameters: PredictorParameters | None = None) -> None:
        self.parameters = p = parameters or PredictorParameters(method="regularised")
        self._kept: deque[tuple[float, Array]] = deque(maxlen=p.samples - 1)
        self._newest: TargetTrack | None = None
        self._pose = np.zeros(4)  # of the newest track, yaw continuous
        self._counter = 0
        self._calibration = ForecastCalibration(
            weight=p.calibration_weight, lead=p.calibration_lead, spacing=p.spacing, fresh=p.fresh
        )
        self._manoeuvre = np.square(
            [p.manoeuvre_horizontal, p.manoeuvre_horizontal, p.manoeuvre_vertical, p.manoeuvre_heading]
        )
        self._wander = np.square([p.wander_horizontal, p.wander_horizontal, p.wander_vertical, p.wander_heading])
        linear, heading = p.sample_deviation, p.sample_deviation_heading
        self._sample_weight = np.array([linear, linear, linear, heading]) ** -2.0
        linear, heading = p.reversion, p.reversion_heading
        self._reversion_weight = np.array([linear, linear, linear, heading]) ** -2.0
        acceleration, jerk = p.acceleration_prior**-2.0, p.jerk_prior**-2.0
        self._prior = np.array([[acceleration, jerk]] * 4)
        self._prior[3] = p.acceleration_prior_heading**-2.0, p.jerk_prior_heading**-2.0

    def reset(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self._newest = None
        self._calibration.reset()

    def rebase(self, reset: OwnshipReset) -> None:
        """Take the kept track into the frame after a reset of the autopilot's estimator."""
        self._kept = deque(((t, rebased(pose, reset)) for t, pose in self._kept), maxlen=self._kept.maxlen)
        self._pose = rebased(self._pose, reset)
        self._calibration.rebase(reset)
        self._counter = reset.counter

    def add(self, track: TargetTrack) -> None:
        """Append a state of the track. One that is not newer is ignored."""
        newest = self._newest
        if newest is not None:
            if track.t <= newest.t:
                return
            if is_another(track, newest, counter=self._counter, gap=self.parameters.gap):
                self.reset()
                newest = None
            elif not self._kept or newest.t - self._kept[-1][0] >= self.parameters.spacing - 1e-3:
                self._kept.append((newest.t, self._pose))
        pose = np.empty(4)
        pose[:3] = track.position_ned
        pose[3] = track.yaw_ned if newest is None else unwrap_near(track.yaw_ned, float(self._pose[3]))
        self._pose = pose
        self._newest = track
        self._counter = track.reset_counter
        self._calibration.check(track, pose)

    def predict(self) -> PolynomialPrediction | None:
        """Give the forecast from the newest state; None before the first."""
        track = self._newest
        if track is None:
            return None
        p = self.parameters
        times = np.array([t for t, _ in self._kept]) - track.t
        poses = np.array([pose for _, pose in self._kept]).reshape(-1, 4) - self._pose
        if p.method == "paper" and len(times) >= 4:
            coefficients, covariance = _least_squares(np.append(times, 0.0), np.vstack([poses, np.zeros(4)]))
            hold_after = p.horizon
        else:
            coefficients, covariance = self._regularised(times, poses, track)
            hold_after = min(p.cubic_horizon, p.horizon)
        coefficients[0] += self._pose
        scale = self._calibration.scale
        prediction = PolynomialPrediction(
            t=track.t,
            horizon=p.horizon,
            reset_counter=track.reset_counter,
            coefficients=coefficients,
            hold_after=hold_after,
            anchor_covariance=pose_covariance(track),
            coefficient_covariance=covariance,
            manoeuvre=self._manoeuvre * scale,
            wander=self._wander * scale,
        )
        expected = self._manoeuvre * p.calibration_lead**2 + self._wander * p.calibration_lead
        self._calibration.remember(prediction, track, expected)
        return prediction

    def _regularised(self, times: Array, poses: Array, track: TargetTrack) -> tuple[Array, Array]:
        """Solve the normal equations of (c1, c2, c3) for each degree of freedom.

        Rows: past poses; the filter's velocity; zero acceleration and jerk; the window's mean velocity at the end.
        """
        p = self.parameters
        velocity = np.empty(4)
        velocity[:3] = track.velocity_ned
        velocity[3] = track.state[TURN_RATE]
        basis = np.stack([times, times * times, times * times * times], axis=1)
        information = self._sample_weight[:, None, None] * (basis.T @ basis)
        right = self._sample_weight[:, None] * (poses.T @ basis)
        trust = 1.0 / rate_variances(track)
        information[:, 0, 0] += trust
        right[:, 0] += trust * velocity
        information[:, 1, 1] += 4.0 * self._prior[:, 0]
        information[:, 2, 2] += 36.0 * self._prior[:, 1]
        if len(times) > 2 and -float(times[0]) >= p.reversion_span:
            end = np.array([1.0, 2.0 * p.cubic_horizon, 3.0 * p.cubic_horizon**2])
            information += self._reversion_weight[:, None, None] * np.outer(end, end)
            right += (self._reversion_weight * _mean_velocity(times, poses))[:, None] * end
        inverse = np.linalg.inv(information)
        coefficients = np.zeros((4, 4))
        coefficients[1:] = np.einsum("dij,dj->id", inverse, right)
        covariance = np.zeros((4, 4, 4))
        covariance[:, 1:, 1:] = inverse
        return coefficients, covariance


def _least_squares(times: Array, poses: Array) -> tuple[Array, Array]:
    """Fit cubics by ordinary least squares: eta = (T^T T)^-1 T^T d (Patel et al., eq. 1 and 2).

    Their T has the powers in falling order and counts time from the oldest state; the polynomial is the same.
    """
    vandermonde = np.vander(times, 4, increasing=True)
    span = -float(times[0])
    scale = span ** np.arange(4)
    inverse = np.linalg.inv((vandermonde / scale).T @ (vandermonde / scale)) / np.outer(scale, scale)
    coefficients = inverse @ (vandermonde.T @ poses)
    residual = poses - vandermonde @ coefficients
    variance = np.square(residual).sum(axis=0) / max(1, len(times) - 4)
    return coefficients, variance[:, None, None] * inverse


def _mean_velocity(times: Array, poses: Array) -> Array:
    """Give the slope (4,) of the least-squares line over the window, the present (0, 0) included."""
    count = len(times) + 1
    centred = times - times.sum() / count
    present = -times.sum() / count
    slope: Array = (centred @ poses) / (centred @ centred + present * present)
    return slope


def is_another(track: TargetTrack, newest: TargetTrack, *, counter: int, gap: float) -> bool:
    """Say whether a track does not go on from the newest state: begun anew, in another frame, or after a gap [s].

    Anew: with another measurement. That may be long ago, where the filter has changed its mind which ones were real.
    """
    restarted = track.t_began != newest.t_began
    return restarted or track.reset_counter != counter or track.t - newest.t > gap


def rate_variances(track: TargetTrack) -> Array:
    """Give the variances (4,) of the track's velocity and turn rate; the same for north and east."""
    _, _, _, _, x, y, z, turn = track.covariance.diagonal().tolist()
    horizontal = 0.5 * (x + y)
    return np.array([horizontal, horizontal, z, turn])


def pose_covariance(track: TargetTrack) -> Array:
    """Turn the track's pose covariance from `level` to north, east, down."""
    yaw = track.yaw_ned - float(track.state[3])
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    result: Array = turn @ track.covariance[:4, :4] @ turn.T
    return result


def rebased(pose: Array, reset: OwnshipReset) -> Array:
    """Take a pose (4,) into the frame after a reset of the autopilot's estimator."""
    moved = np.empty(4)
    moved[:3] = reset.position(pose[:3])
    moved[3] = pose[3] + reset.yaw
    return moved
