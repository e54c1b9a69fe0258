"""The target's estimator: late and out-of-order measurements fused at their capture time."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation.consistency import chi_square_quantile
from companion.estimation.ownship import OwnshipHistory, OwnshipPose, OwnshipReset
from companion.estimation.target_filter import FilterState, FilterTuning, RelativePose, WindowEntry, predict
from companion.estimation.target_hypotheses import Hypotheses, Hypothesis, doubt, step
from companion.estimation.target_model import TargetEstimatorParameters, turn_about_down
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.target import HEADING, STATE_SIZE, MeasurementVerdict, TargetMeasurement, TargetTrack


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Record:
    measured: RelativePose
    after: Hypotheses
    verdict: MeasurementVerdict


class TargetEstimator:
    """Extended Kalman filter of the target relative to the observer.

    x, y, height and heading with constant linear and angular velocity (Patel et al., section 3). Our own motion is
    taken out by odometry. Every measurement is fused at its capture time: the states after the measurements of the last
    `history` seconds are kept, and one that comes late is slipped in and those after it are fused again, so the order
    of arrival does not matter.
    """

    def __init__(self, parameters: TargetEstimatorParameters | None = None) -> None:
        self.parameters = parameters or TargetEstimatorParameters()
        self._tuning = FilterTuning.of(self.parameters, chi_square_quantile(self.parameters.gate_probability, 4))
        self._times: list[float] = []
        self._records: list[_Record] = []
        self._base: Hypotheses | None = None  # before the first record
        self._base_t = -math.inf  # [s] of the newest forgotten record
        self._reset_counter = 0

    def reset(self) -> None:
        """Forget the target."""
        self._times.clear()
        self._records.clear()
        self._base = None
        self._base_t = -math.inf

    def update(self, measurement: TargetMeasurement, history: OwnshipHistory) -> MeasurementVerdict:
        """Fuse a measurement at its capture time, however late it comes.

        Args:
            measurement: relative to the vehicle, in `level`.
            history: our own motion, reaching back to the capture.
        """
        if not _valid(measurement):
            return MeasurementVerdict.REJECTED_INVALID
        t = measurement.t
        index = bisect_left(self._times, t)
        if index < len(self._times) and self._times[index] == t:
            return MeasurementVerdict.REJECTED_INVALID
        newest = self._times[-1] if self._times else -math.inf
        if t <= self._base_t or t < newest - self.parameters.history:
            return MeasurementVerdict.REJECTED_TOO_OLD
        pose = history.pose_at(t)
        if pose is None or history.newest is None:
            older = history.newest is not None and t < history.newest.t
            return MeasurementVerdict.REJECTED_TOO_OLD if older else MeasurementVerdict.REJECTED_INVALID
        self._reset_counter = history.newest.reset_counter
        measured = _along_odometry(measurement, pose)
        self._times.insert(index, t)
        self._replay(index, [measured, *(record.measured for record in self._records[index:])])
        verdict = self._records[index].verdict
        self._forget()
        return verdict

    def track(self, t: float, history: OwnshipHistory) -> TargetTrack | None:
        """Give the target at `t` [s]; None without a track, without odometry there, or after coasting too long."""
        index = bisect_right(self._times, t)
        hypotheses = self._records[index - 1].after if index else self._base
        if hypotheses is None:
            return None
        state = hypotheses.believed
        if t < state.t or t - state.t > self.parameters.coast_limit:
            return None
        pose = history.pose_at(t)
        if pose is None:
            return None
        return _track(hypotheses, t, pose, self._reset_counter, self._tuning)

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator: everything kept is taken into the new frame."""
        turn = turn_about_down(reset.yaw)
        self._records = [
            _Record(
                measured=_rebased_measurement(record.measured, reset, turn),
                after=_rebased_hypotheses(record.after, reset, turn),
                verdict=record.verdict,
            )
            for record in self._records
        ]
        if self._base is not None:
            self._base = _rebased_hypotheses(self._base, reset, turn)
        self._reset_counter = reset.counter

    def _replay(self, index: int, measurements: list[RelativePose]) -> None:
        """Take in measurements, in order of capture, on what was known before the record `index`."""
        hypotheses = self._records[index - 1].after if index else self._base
        del self._records[index:]
        for measured in measurements:
            hypotheses, verdict = step(hypotheses, measured, self._tuning)
            self._records.append(_Record(measured=measured, after=hypotheses, verdict=verdict))

    def _forget(self) -> None:
        horizon = self._times[-1] - self.parameters.history
        surplus = bisect_left(self._times, horizon)
        if surplus:
            self._base = self._records[surplus - 1].after
            self._base_t = self._times[surplus - 1]
            del self._times[:surplus]
            del self._records[:surplus]


def _valid(measurement: TargetMeasurement) -> bool:
    """Tell whether every number is finite and the covariance is positive."""
    position = measurement.position_level
    total = float(position @ position) + float(measurement.covariance.sum()) + measurement.heading + measurement.t
    if not math.isfinite(total):
        return False
    try:
        np.linalg.cholesky(measurement.covariance)
    except np.linalg.LinAlgError:
        return False
    return True


def _along_odometry(measurement: TargetMeasurement, pose: OwnshipPose) -> RelativePose:
    """Turn a measurement from `level` to the odometry's axes."""
    north, east, down, yaw, axes = pose
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = measurement.position_level.tolist()
    turn = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return RelativePose(
        t=measurement.t,
        value=np.array([c * x - s * y, s * x + c * y, z, measurement.heading + yaw]),
        covariance=turn @ measurement.covariance @ turn.T,
        origin=np.array([north, east, down]),
        axes=axes,
    )


def _track(hypotheses: Hypotheses, t: float, pose: OwnshipPose, counter: int, tuning: FilterTuning) -> TargetTrack:
    """Predict to `t` and express the target in `level` and in the odometry's frame."""
    state = hypotheses.believed
    mean, covariance = predict(state, t, tuning)
    covariance += doubt(hypotheses, mean, t, tuning)
    north, east, down, yaw, axes = pose
    n, e, d, heading, vn, ve, vd, turn_rate, _, bias_pitch, _, wander_pitch = mean.tolist()
    pitch = bias_pitch + wander_pitch  # what the autopilot's is wrong by
    c, s = math.cos(yaw), math.sin(yaw)
    rn, re = n - north, e - east
    turn = turn_about_down(-yaw)[:STATE_SIZE]
    # An error in pitch turns the heading of a vehicle that rolls, and with it all that is seen from it.
    lever = float(axes[2, 1]) / max(1.0 - float(axes[2, 0]) ** 2, 0.1)
    x, y = c * rn + s * re, c * re - s * rn
    for column in (9, 11):
        turn[0, column], turn[1, column], turn[HEADING, column] = -lever * y, lever * x, lever
    level = turn @ covariance @ turn.T
    level[2, 2] += tuning.shortening_variance * (d - down) ** 2
    # The mount's error shifts all measurements alike, so the target's position carries it whole, whatever is fused.
    for axis in range(3):
        level[axis, axis] += tuning.parameters.mount_sigma**2
    return TargetTrack(
        t=t,
        t_measured=state.t,
        state=np.array(
            [
                x - lever * pitch * y,
                y + lever * pitch * x,
                d - down,
                wrap_angle(heading - yaw + lever * pitch),
                c * vn + s * ve,
                c * ve - s * vn,
                vd,
                turn_rate,
            ]
        ),
        covariance=level,
        position_ned=mean[0:3],
        velocity_ned=mean[4:7],
        yaw_ned=wrap_angle(heading),
        reset_counter=counter,
        nis=state.nis,
        nis_mean=state.nis_mean,
        fused=state.fused,
        t_began=state.began,
    )


def _rebased_measurement(measured: RelativePose, reset: OwnshipReset, turn: Array) -> RelativePose:
    value = turn[:4, :4] @ measured.value
    value[3] += reset.yaw
    return RelativePose(
        t=measured.t,
        value=value,
        covariance=turn[:4, :4] @ measured.covariance @ turn[:4, :4].T,
        origin=reset.position(measured.origin),
        axes=reset.rotation @ measured.axes,
    )


def _rebased_hypotheses(hypotheses: Hypotheses, reset: OwnshipReset, turn: Array) -> Hypotheses:
    moved = [_rebased_state(each.state, reset, turn) for each in hypotheses.ranked]
    believed = next(
        state for state, each in zip(moved, hypotheses.ranked, strict=True) if each.state is hypotheses.believed
    )
    ranked = zip(hypotheses.ranked, moved, strict=True)
    return replace(
        hypotheses,
        ranked=tuple(Hypothesis(score=each.score, state=state) for each, state in ranked),
        believed=believed,
    )


def _rebased_state(state: FilterState, reset: OwnshipReset, turn: Array) -> FilterState:
    mean = turn @ state.mean
    mean[0:3] += reset.translation_ned
    mean[3] += reset.yaw
    return replace(
        state,
        mean=mean,
        covariance=turn @ state.covariance @ turn.T,
        window=tuple(_rebased_entry(entry, reset, turn) for entry in state.window),
    )


def _rebased_entry(entry: WindowEntry, reset: OwnshipReset, turn: Array) -> WindowEntry:
    pose = turn[:4, :4] @ entry.pose
    pose[0:3] += reset.translation_ned
    pose[3] += reset.yaw
    variance = (turn[:4, :4] @ np.diag(entry.variance) @ turn[:4, :4].T).diagonal()
    return WindowEntry(t=entry.t, pose=pose, variance=variance)
