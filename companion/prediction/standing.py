"""No prediction: the target stands where it was last seen. For comparisons."""

from __future__ import annotations

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.messages.target import TargetTrack
from companion.prediction.forecast import PolynomialPrediction
from companion.prediction.parameters import PredictorParameters
from companion.prediction.polynomial import pose_covariance, rebased


class StandingPredictor:
    """Gives the newest state with a fresh measurement, for ever, with the growth of the variance of a slow target."""

    def __init__(self, parameters: PredictorParameters) -> None:
        self.parameters = p = parameters
        self._seen: TargetTrack | None = None  # newest with a fresh measurement
        self._pose = np.zeros(4)
        self._newest: TargetTrack | None = None
        self._manoeuvre = np.square(
            [p.manoeuvre_horizontal, p.manoeuvre_horizontal, p.manoeuvre_vertical, p.manoeuvre_heading]
        )
        self._wander = np.square([p.wander_horizontal, p.wander_horizontal, p.wander_vertical, p.wander_heading])

    def reset(self) -> None:
        """Forget everything."""
        self._seen = self._newest = None

    def rebase(self, reset: OwnshipReset) -> None:
        """Take the place into the frame after a reset of the autopilot's estimator."""
        self._pose = rebased(self._pose, reset)

    def add(self, track: TargetTrack) -> None:
        """Append a state of the track. One that is not newer is ignored."""
        if self._newest is not None and track.t <= self._newest.t:
            return
        self._newest = track
        seen = self._seen
        if seen is None or track.age <= self.parameters.fresh or track.t_began != seen.t_began:
            self._seen = track
            self._pose = np.append(track.position_ned, track.yaw_ned)

    def predict(self) -> PolynomialPrediction | None:
        """Give the forecast; None before the first state."""
        if self._newest is None or self._seen is None:
            return None
        coefficients = np.zeros((4, 4))
        coefficients[0] = self._pose
        return PolynomialPrediction(
            t=self._newest.t,
            horizon=self.parameters.horizon,
            reset_counter=self._newest.reset_counter,
            coefficients=coefficients,
            hold_after=0.0,
            anchor_covariance=pose_covariance(self._seen),
            coefficient_covariance=np.zeros((4, 4, 4)),
            manoeuvre=self._manoeuvre,
            wander=self._wander,
        )
