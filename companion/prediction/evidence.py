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
from companion.prediction.motion_choice import Motion, MotionChoice, Rows
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
                phase=parameters.spacing * number / len(LEADS),  # in different calls
            )
            for number, lead in enumerate(LEADS.tolist())
        ]
        self._growing: tuple[Growth, Array] | None = None  # and its variances (J, 4) at the leads, while they hold
        self._spread: tuple[Spread, Array] | None = None  # and the variances (J, 4) it expects, while they hold
        self._manoeuvre = np.square([p.manoeuvre, p.manoeuvre, p.manoeuvre, p.manoeuvre_heading])

    def reset(self) -> None:
        """Forget everything."""
        self._choice.reset()
        self._shown = Shown.nothing(self._p)
        self._motion = self._newest = self._anchor = self._growing = self._spread = None
        for calibration in self._calibrations:
            calibration.reset()

    def rebase(self, reset: OwnshipReset) -> None:
        """Take what is kept into the frame after a reset of the autopilot's estimator."""
        self._choice.rebase(reset)
        self._pose = rebased(self._pose, reset)
        self._rate[:3] = reset.rotation @ self._rate[:3]
        self._motion, self._growing, self._spread = self._choice.motion, None, None
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
            self._choice.advance(track.t)
            self._take_motion()
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
        else:
            self._choice.advance(track.t)
        self._take_motion()
        for calibration in self._calibrations:
            if calibration.check(track, pose):
                self._spread = None

    def _take_motion(self) -> None:
        if self._choice.motion is not self._motion:
            self._motion, self._growing, self._spread = self._choice.motion, None, None
            self._shown.look(self._choice.times, self._choice.poses)

    def predict(self) -> EvidencePrediction | None:
        """Give the forecast from the newest state; None before the first."""
        track, anchor = self._newest, self._anchor
        if track is None or anchor is None:
            return None
        motion, arc = self._bounded(anchor)
        arc_rate = motion[1][3]
        if self._spread is None:
            self._spread = self._spreading(anchor)
        spread, expected = self._spread
        deviation, rate = self._departure(motion, arc, spread.growth, rate_variances(anchor))
        lasting, turn_hold, mean_rate = self._duration(abs(arc_rate) if arc else 0.0)
        prediction = EvidencePrediction(
            t=track.t,
            horizon=self.parameters.horizon,
            reset_counter=track.reset_counter,
            anchor_t=anchor.t,
            anchor_covariance=pose_covariance(anchor),
            motion=np.array(motion),
            hold=self._p.curve_s,
            turn_hold=min(turn_hold, lasting),
            lasting=lasting,
            mean_rate=mean_rate,
            arc_velocity=arc,
            arc_rate=arc_rate,
            deviation=np.array(deviation),
            deviation_rate=np.array(rate),
            decay=spread.growth.decay,
            spread=spread,
        )
        if self._motion is None:
            self._growing = self._spread = None  # they count from this anchor
        if track is anchor:
            for variance, calibration in zip(expected, self._calibrations, strict=True):
                calibration.remember(prediction, track, variance)
        return prediction

    def _departure(
        self, motion: Rows, arc: complex, growth: Growth, measured: Array
    ) -> tuple[list[float], list[float]]:
        """Give the deviation from the motion (4), and k times it plus that of the velocity as far as it is smooth.

        Args:
            motion: coefficients from the anchor on.
            arc: velocity on top of them [m/s], north + i east.
            growth: of the deviations.
            measured: variances (4,) of the filter's velocity.
        """
        deviation, rate = [], []
        for axis, (variance, k, noise) in enumerate(
            zip(growth.deviation.tolist(), growth.decay.tolist(), measured.tolist(), strict=True)
        ):
            deviation.append(float(self._pose[axis]) - motion[0][axis])
            moving = motion[1][axis] + (arc.real, arc.imag, 0.0, 0.0)[axis]
            unsteady = variance * k * k
            trust = unsteady / (unsteady + noise)
            rate.append(trust * (float(self._rate[axis]) - moving) + k * deviation[axis])
        rate[3] = 0.0
        return deviation, rate

    def _spreading(self, anchor: TargetTrack) -> tuple[Spread, Array]:
        """Give how the variance grows, and by how much (J, 4) at the leads before each one's own scale."""
        if self._growing is None:
            growth = self._growth(anchor)
            self._growing = growth, growth.at_leads()
        growth, plain = self._growing
        scales = np.array([calibration.scale for calibration in self._calibrations])
        scales[-1] *= scales[-2]  # there is little to learn from at the longest lead: it learns against the one before
        expected = plain.copy()
        expected[-1] *= scales[-2]
        return Spread.scaled(growth, plain, scales), expected

    def _bounded(self, anchor: TargetTrack) -> tuple[Rows, complex]:
        """Give the motion from the anchor on within the bounds: coefficients (4, 4), arc velocity."""
        if self._motion is None:
            return [self._pose.tolist(), self._rate.tolist(), [0.0] * 4, [0.0] * 4], 0j
        shown, hold = self._shown, self._p.curve_s
        motion, arc = self._motion.moved(anchor.t, float(self._pose[3]))
        _, first, second, third = motion
        first[3] = min(max(first[3], -shown.turn_rate), shown.turn_rate)
        curved = math.hypot(2.0 * second[0], 2.0 * second[1])
        late = math.hypot(2.0 * second[0] + 6.0 * hold * third[0], 2.0 * second[1] + 6.0 * hold * third[1])
        most = max(curved, late)
        if most > shown.acceleration:
            share = shown.acceleration / most
            for row in (second, third):
                row[:2] = [share * row[0], share * row[1]]
        north, east = (first[k] + 2.0 * hold * second[k] + 3.0 * hold * hold * third[k] for k in (0, 1))
        if math.hypot(north + arc.real, east + arc.imag) > shown.speed:
            second[:2] = third[:2] = [0.0, 0.0]
            speed = math.hypot(first[0] + arc.real, first[1] + arc.imag)
            share = min(1.0, shown.speed / max(speed, 1e-9))
            first[:2] = [share * first[0], share * first[1]]
            arc *= share
        return motion, arc

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
        north, east, _ = self._motion.mean_velocity.tolist()
        mean_rate = np.array([north, east, 0.0, 0.0])
        return lasting + curved * (turn - lasting), turn, mean_rate

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
