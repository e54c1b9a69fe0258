"""From the pad's pose in the camera to a track, a forecast and an intercept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.config.tree import EstimationSection
from companion.estimation.measurement import measure_target
from companion.estimation.ownship import OwnshipHistory, OwnshipReset
from companion.estimation.pad_slope import PadSlope
from companion.estimation.target_ekf import TargetEstimator
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.geometry.transform import RigidTransform
from companion.messages.ownship import OwnshipState
from companion.messages.perception import PadObservation
from companion.messages.target import (
    HEADING,
    POSITION,
    Intercept,
    MeasurementVerdict,
    Prediction,
    TargetMeasurement,
    TargetTrack,
)
from companion.prediction.coasting import coasted
from companion.prediction.intercept import earliest_intercept
from companion.prediction.parameters import PredictorParameters
from companion.prediction.predictor import make_predictor
from companion.prediction.reach import Reachability

_FRESH_S = 0.3  # [s] a sighting older than this no longer stands for the target


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fusion:
    """What became of one observation."""

    observation: PadObservation
    measurement: TargetMeasurement | None
    verdict: MeasurementVerdict | None  # None: the pad was not seen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """What is known of the target at one step."""

    track: TargetTrack | None
    prediction: Prediction | None
    intercept: Intercept | None
    sighted_ned: Array | None  # (3,) [m] where the newest measurement alone puts the target now
    slope_ned: Array  # (2,) north and east components of the pad's downward normal, by the autopilot's attitude
    t_sighted: float = -math.inf  # [s] capture time of the newest measurement


NOTHING_SEEN = Picture(track=None, prediction=None, intercept=None, sighted_ned=None, slope_ned=np.zeros(2))


class Tracking:
    """Holds the ownship history, the estimator and the predictor."""

    def __init__(
        self,
        estimation: EstimationSection,
        prediction: PredictorParameters,
        *,
        frd_from_cam: RigidTransform,
        reach: Reachability,
    ) -> None:
        self._p = estimation
        self._frd_from_cam = frd_from_cam
        self._reach = reach
        self.history = OwnshipHistory(estimation.ownship)
        self._estimator = TargetEstimator(estimation.target)
        self._slope = PadSlope(estimation.pad_slope)
        self._predictor = make_predictor(prediction)
        self._horizon = prediction.horizon
        self._fresh = prediction.fresh
        self.t_frame = -math.inf  # [s] capture time of the newest frame
        self._sighting: tuple[float, Array] | None = None  # newest fused measurement, as a position in the local frame

    def add_ownship(self, state: OwnshipState) -> OwnshipReset | None:
        """Append a state; a reset of the autopilot's estimator is followed at once and given back."""
        reset = self.history.add(state)
        if reset is not None:
            self._estimator.rebase(reset)
            self._predictor.rebase(reset)
            self._sighting = None
        return reset

    def fuse(self, observations: Sequence[PadObservation]) -> list[Fusion]:
        """Fuse what the camera saw, at its capture time."""
        results = []
        for observation in observations:
            self.t_frame = max(self.t_frame, observation.t)
            measurement: TargetMeasurement | None = None
            verdict: MeasurementVerdict | None = None
            ownship = self.history.at(observation.t) if observation.seen else None
            if observation.seen and ownship is None:
                verdict = MeasurementVerdict.REJECTED_TOO_OLD
            elif ownship is not None:
                measured = measure_target(
                    observation=observation,
                    ownship=ownship,
                    frd_from_cam=self._frd_from_cam,
                    prior=self._estimator.track(observation.t, self.history),
                    parameters=self._p.measurement,
                )
                if isinstance(measured, MeasurementVerdict):
                    verdict = measured
                else:
                    measurement = measured
                    verdict = self._estimator.update(measured, self.history)
                    if verdict in (MeasurementVerdict.FUSED, MeasurementVerdict.INITIALISED):
                        place = ownship.position_ned + rotation_about_z(ownship.yaw) @ measured.position_level
                        self._sighting = (measured.t, place)
                        if verdict is MeasurementVerdict.INITIALISED:
                            self._slope.reset()
                        self._slope.update(measured.t, measured.slope_level, measured.slope_std)
            results.append(Fusion(observation=observation, measurement=measurement, verdict=verdict))
        return results

    def look(self, t: float) -> Picture:
        """Give track, forecast and intercept at `t` [s]."""
        track = self._estimator.track(t, self.history)
        ownship = self.history.at(t)
        if track is None or ownship is None:
            self._predictor.reset()
            self._slope.reset()
            return NOTHING_SEEN
        self._predictor.add(track)
        slope = self._slope.ned(ownship.yaw)
        prediction = self._predictor.predict()
        if prediction is None:
            return replace(NOTHING_SEEN, track=track, slope_ned=slope)
        if track.age > self._fresh:
            track = coasted(track, prediction, ownship)
        intercept = earliest_intercept(
            prediction=prediction,
            position_ned=ownship.position_ned,
            velocity_ned=ownship.velocity_ned,
            reach=self._reach,
            t=t,
            horizon=self._horizon,
        )
        return Picture(
            track=track,
            prediction=prediction,
            intercept=intercept,
            sighted_ned=self._sighted_now(track),
            slope_ned=slope,
            t_sighted=track.t_measured,
        )

    def track_at(self, t: float) -> TargetTrack | None:
        """Give the track at `t` [s], which may lie in the past; None where there is none."""
        return self._estimator.track(t, self.history)

    def _sighted_now(self, track: TargetTrack) -> Array:
        """Move the newest sighting on at the track's velocity; without a fresh one, the track itself."""
        if self._sighting is None or track.t - self._sighting[0] > _FRESH_S:
            return track.position_ned
        t, place = self._sighting
        result: Array = place + track.velocity_ned * (track.t - t)
        return result

    def expected_pad(self, t: float) -> RigidTransform | None:
        """Give the pose `cam_from_pad` expected in a frame captured at `t` [s], None without a track."""
        track = self._estimator.track(t, self.history)
        ownship = self.history.at(t)
        if track is None or ownship is None:
            return None
        level_from_pad = RigidTransform(
            rotation=rotation_about_z(float(track.state[HEADING])), translation=track.state[POSITION]
        )
        frd_from_level = RigidTransform(
            rotation=ownship.ned_from_frd.T @ rotation_about_z(ownship.yaw), translation=np.zeros(3)
        )
        return self._frd_from_cam.inverse() @ frd_from_level @ level_from_pad
