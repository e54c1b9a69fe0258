"""The estimator fed with a run of the synthetic world, or with single measurements from a vehicle at rest."""

from __future__ import annotations

import numpy as np
from estimation_world import Run

from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator
from companion.estimation.target_model import TargetEstimatorParameters
from companion.geometry.angles import wrap_angle
from companion.messages.ownship import OwnshipState
from companion.messages.target import MeasurementVerdict, TargetMeasurement, TargetTrack


def history_of(run: Run) -> OwnshipHistory:
    history = OwnshipHistory()
    for state in run.ownships:
        history.add(state)
    return history


def fly(run: Run, estimator: TargetEstimator, rate_divisor: int = 1) -> list[TargetTrack]:
    history, tracks, k = OwnshipHistory(), [], 0
    for number, state in enumerate(run.ownships):
        history.add(state)
        now = state.t + 0.005
        while k < len(run.measurements) and run.measurements[k][0] <= now:
            estimator.update(run.measurements[k][1], history)
            k += 1
        if number % rate_divisor == 0:
            track = estimator.track(now, history)
            if track is not None:
                tracks.append(track)
    return tracks


def error(run: Run, track: TargetTrack) -> np.ndarray:
    difference = track.state[:4] - run.truth(track.t)
    difference[3] = wrap_angle(difference[3])
    return difference


def still(
    t: float, position: tuple[float, float, float], heading: float = 0.3, sigma: float = 0.01
) -> TargetMeasurement:
    return TargetMeasurement(t=t, position_level=np.array(position), heading=heading, covariance=np.eye(4) * sigma**2)


def resting(t: float) -> OwnshipState:
    return OwnshipState(
        t=t,
        position_ned=np.zeros(3),
        velocity_ned=np.zeros(3),
        acceleration_ned=np.zeros(3),
        ned_from_frd=np.eye(3),
        angular_velocity_frd=np.zeros(3),
        reset_counter=11,
    )


def resting_history(t: float = 5.0) -> OwnshipHistory:
    history = OwnshipHistory()
    for number in range(int(50.0 * t) + 25):
        history.add(resting(0.02 * number))
    return history


class Watching:
    """A vehicle at rest, and its estimator."""

    def __init__(self, parameters: TargetEstimatorParameters | None = None) -> None:
        self.estimator = TargetEstimator(parameters)
        self._history = OwnshipHistory()
        self._t = 0.0

    def see(self, t: float, place: tuple[float, float, float], heading: float = 0.3) -> MeasurementVerdict:
        """Measure the target at `t` [s]."""
        self._wait(t)
        return self.estimator.update(still(t, place, heading), self._history)

    def track(self, t: float) -> TargetTrack:
        """Give the track at `t` [s]."""
        self._wait(t)
        track = self.estimator.track(t, self._history)
        assert track is not None
        return track

    def _wait(self, t: float) -> None:
        while self._t <= t:
            self._history.add(resting(self._t))
            self._t += 0.02
