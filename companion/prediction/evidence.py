"""Forecasts of the target by the motion that the evidence speaks for, bounded by what the target has shown."""

from __future__ import annotations

import math

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import unwrap_near
from companion.geometry.arrays import Array
from companion.messages.target import TURN_RATE, TargetTrack
from companion.prediction.calibration import ForecastCalibration
from companion.prediction.evidence_forecast import EvidencePrediction
from companion.prediction.motion_choice import Motion, MotionChoice
from companion.prediction.parameters import PredictorParameters
from companion.prediction.polynomial import is_another, pose_covariance, rate_variances, rebased
from companion.prediction.shown import Shown
from companion.prediction.spread import LEADS, Growth, Spread

_CURVED = 0.5  # [rad] an arc of this angle is no line


class EvidencePredictor:
    """Weighs rest, constant velocity, acceleration, cubics and arcs by how well they explain the track so far.

    Only states with a fresh measurement count; through a dropout the forecast made from the last of them stands, with a
    covariance that grows from there. `MotionChoice` says what the target does, the newest state where it is; the
    forecast leads from the one into the other. Its speed, acceleration and turn rate stay within what the target has
    shown.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self.parameters = parameters
        self._p = p = parameters.evidence
        self._choice = MotionChoice(p)
        self._shown = Shown.nothing(p)
        self._motion: Motion | None = None
        self._newest: TargetTrack | None = None
        self._anchor: TargetTrack | None = None  # newest with a fresh measurement
        self._pose = np.zeros(4)  # of the anchor, yaw continuous
        self._rate = np.zeros(4)
        self._counter = 0
        self._calibrations = [
            ForecastCalibration(
                weight=0.5 * parameters.calibration_weight / lead,
                lead=lead,
                spacing=parameters.spacing,
                fresh=parameters.fresh,
            )
            for lead in LEADS.tolist()
        ]
        self._manoeuvre = np.square([p.manoeuvre, p.manoeuvre, p.manoeuvre, p.manoeuvre_heading])

    def reset(self) -> None:
        """Forget everything."""
        self._choice.reset()
        self._shown = Shown.nothing(self._p)
        self._motion = self._newest = self._anchor = None
        for calibration in self._calibrations:
            calibration.reset()

    def rebase(self, reset: OwnshipReset) -> None:
        """Take what is kept into the frame after a reset of the autopilot's estimator."""
        self._choice.rebase(reset)
        self._pose = rebased(self._pose, reset)
        self._rate[:3] = reset.rotation @ self._rate[:3]
        self._motion = self._choice.motion
        for calibration in self._calibrations:
            calibration.rebase(reset)
        self._counter = reset.counter

    def add(self, track: TargetTrack) -> None:
        """Append a state of the track. One that is not newer is ignored."""
        newest = self._newest
        if newest is not None:
            if track.t <= newest.t:
                return
            if is_another(track, newest, counter=self._counter, gap=self.parameters.gap):
                self.reset()
        self._newest = track
        self._counter = track.reset_counter
        if track.age > self.parameters.fresh and self._anchor is not None:
            return
        pose = np.empty(4)
        pose[:3] = track.position_ned
        pose[3] = track.yaw_ned if self._anchor is None else unwrap_near(track.yaw_ned, float(self._pose[3]))
        self._anchor = track
        self._pose = pose
        self._rate[:3] = track.velocity_ned
        self._rate[3] = track.state[TURN_RATE]
        times = self._choice.times
        if not times or track.t - times[-1] >= self._p.spacing - 1e-3:
            self._choice.add(track.t, pose)
            self._shown.look(self._choice.times, self._choice.poses)
        else:
            self._choice.advance(track.t)
        self._motion = self._choice.motion
        for calibration in self._calibrations:
            calibration.check(track, pose)

    def predict(self) -> EvidencePrediction | None:
        """Give the forecast from the newest state; None before the first."""
        track, anchor = self._newest, self._anchor
        if track is None or anchor is None:
            return None
        motion, arc, arc_rate = self._bounded(anchor)
        deviation = self._pose - motion[0]
        growth = self._growth(anchor)
        decay = growth.decay
        rate = self._rate - motion[1]
        rate[0] -= arc.real
        rate[1] -= arc.imag
        unsteady = growth.deviation * decay * decay
        rate *= unsteady / (unsteady + rate_variances(anchor))
        rate += decay * deviation
        rate[3] = 0.0
        lasting, turn_hold, mean_rate = self._duration(abs(arc_rate) if arc else 0.0)
        scales = np.array([calibration.scale for calibration in self._calibrations])
        scales[-1] *= scales[-2]  # there is little to learn from at the longest lead: it learns against the one before
        prediction = EvidencePrediction(
            t=track.t,
            horizon=self.parameters.horizon,
            reset_counter=track.reset_counter,
            anchor_t=anchor.t,
            anchor_covariance=pose_covariance(anchor),
            motion=motion,
            hold=self._p.curve_s,
            turn_hold=min(turn_hold, lasting),
            lasting=lasting,
            mean_rate=mean_rate,
            arc_velocity=arc,
            arc_rate=arc_rate,
            deviation=deviation,
            deviation_rate=rate,
            decay=decay,
            spread=Spread.scaled(growth, scales),
        )
        if track is anchor:
            expected = growth.after(LEADS)
            expected[-1] *= scales[-2]
            for k, calibration in enumerate(self._calibrations):
                calibration.remember(prediction, track, expected[k])
        return prediction

    def _bounded(self, anchor: TargetTrack) -> tuple[Array, complex, float]:
        """Give the motion from the anchor on within the bounds: coefficients (4, 4), arc velocity, arc rate."""
        if self._motion is None:
            return np.array([self._pose, self._rate, np.zeros(4), np.zeros(4)]), 0j, 0.0
        shown, hold = self._shown, self._p.curve_s
        motion, arc = self._motion.moved(anchor.t, float(self._pose[3]))
        turn = float(motion[1, 3])
        motion[1, 3] = min(max(turn, -shown.turn_rate), shown.turn_rate)
        (n1, n2, n3), (e1, e2, e3) = motion[1:, 0].tolist(), motion[1:, 1].tolist()
        curved = math.hypot(2.0 * n2, 2.0 * e2)
        late = math.hypot(2.0 * n2 + 6.0 * n3 * hold, 2.0 * e2 + 6.0 * e3 * hold)
        most = max(curved, late)
        if most > shown.acceleration:
            motion[2:, :2] *= shown.acceleration / most
        end = motion[1, :2] + 2.0 * hold * motion[2, :2] + 3.0 * hold * hold * motion[3, :2]
        speed = math.hypot(float(end[0]) + arc.real, float(end[1]) + arc.imag)
        if speed > shown.speed:
            motion[2:, :2] = 0.0
            speed = math.hypot(n1 + arc.real, e1 + arc.imag)
            share = min(1.0, shown.speed / max(speed, 1e-9))
            motion[1, :2] *= share
            arc *= share
        return motion, arc, float(motion[1, 3])

    def _duration(self, arc_rate: float) -> tuple[float, float, Array]:
        """Give how long the motion and the turning are expected to last [s], and the mean velocity (4,) after that.

        About as long again as they have lasted so far. A target that drives along its heading does not drive on as it
        does once it no longer turns as it does.
        """
        if self._motion is None:
            return self._p.curve_s, self._p.curve_s, np.zeros(4)
        lasting = max(self._motion.age, self._p.curve_s)
        turn = min(max(self._motion.turn_age, self._p.curve_s), lasting)
        curved = min(1.0, arc_rate * turn / _CURVED)
        return lasting + curved * (turn - lasting), turn, np.append(self._motion.mean_velocity[:2], [0.0, 0.0])

    def _growth(self, anchor: TargetTrack) -> Growth:
        """Give how the variance grows, before scaling."""
        motion, p = self._motion, self._p
        if motion is None:
            linear, heading = p.deviation[1] ** 2, p.deviation_heading[1] ** 2
            return Growth(
                rate=rate_variances(anchor),
                manoeuvre=self._manoeuvre,
                deviation=np.array([linear, linear, linear, heading]),
                decay=np.ones(4),
            )
        return Growth(
            rate=motion.rate_variance,
            manoeuvre=self._manoeuvre,
            deviation=motion.deviation_variance,
            decay=motion.deviation_decay,
        )
