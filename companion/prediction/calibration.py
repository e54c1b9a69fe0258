"""How much wider than supposed forecasts are: learnt from the ones whose time has come."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.target import TargetPose, TargetTrack


class AnchoredPrediction(Protocol):
    """A forecast that says how sure the pose is that it begins from."""

    @property
    def t(self) -> float:
        """Instant [s] at which it begins."""

    @property
    def anchor_covariance(self) -> Array:
        """Of that pose, (4, 4)."""

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]."""


LEAST = 0.2  # the variance is never scaled below this
MOST = 1e4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pending:
    due: float  # [s]
    pose: Array  # (4,) foretold
    fitted: Array  # (4,) variance foretold of the fitted coefficients
    expected: Array  # (4,) variance foretold of what the target may do, before scaling


class ForecastCalibration:
    """Averages the squared misses of past forecasts, over the variance expected of them, per axis group.

    Groups: horizontal, vertical, heading. Both forecast and outcome are tracks, so an error that both share (the tilt
    of the levelling) does not count: it is in the track's own covariance.

    Args:
        weight: of one forecast in the mean.
        lead: [s] how old the forecasts are.
        spacing: [s] one of them is kept in each such time,
        phase: [s] which begins so much after a whole number of them.
        fresh: [s] a track older than this neither checks nor is checked.
    """

    def __init__(self, *, weight: float, lead: float, spacing: float, fresh: float, phase: float = 0.0) -> None:
        self._weight = weight
        self._lead = lead  # [s]
        self._spacing = spacing  # [s]
        self._fresh = fresh  # [s]
        self._phase = phase  # [s]
        self._slot = -math.inf  # number of the spacing in which the newest was kept
        self._pending: deque[_Pending] = deque(maxlen=max(2, int(lead / spacing) + 2))
        self._scale = np.ones(4)

    @property
    def scale(self) -> Array:
        """Factor on the growth of the variance of north, east, down, heading, (4,)."""
        return self._scale

    def reset(self) -> None:
        """Forget everything."""
        self._pending.clear()
        self._slot = -math.inf
        self._scale = np.ones(4)

    def rebase(self, reset: OwnshipReset) -> None:
        """Take what is foretold into the frame after a reset of the autopilot's estimator."""
        moved = []
        for item in self._pending:
            pose = np.empty(4)
            pose[:3] = reset.position(item.pose[:3])
            pose[3] = item.pose[3] + reset.yaw
            moved.append(replace(item, pose=pose))
        self._pending = deque(moved, maxlen=self._pending.maxlen)

    def remember(self, prediction: AnchoredPrediction, track: TargetTrack, expected: Array) -> None:
        """Keep a forecast to check it when its time has come.

        Args:
            prediction: the forecast.
            track: that it begins from; a stale one is not worth checking.
            expected: variance (4,) that what the target may do adds over the lead, before scaling.
        """
        slot = math.floor((prediction.t - self._phase) / self._spacing + 1e-6)
        if slot <= self._slot or self._weight == 0.0 or track.age > self._fresh:
            return
        self._slot = slot
        due = prediction.t + self._lead
        pose = prediction.at(due)
        foretold = np.empty(4)
        foretold[:3] = pose.position_ned
        foretold[3] = pose.yaw
        grown = (pose.covariance - prediction.anchor_covariance).diagonal() - self._scale * expected
        self._pending.append(_Pending(due=due, pose=foretold, fitted=grown, expected=np.maximum(expected, 1e-12)))

    def check(self, track: TargetTrack, pose: Array) -> bool:
        """Compare the forecasts whose time has come with what has come, `pose` (4,); say whether the scale changed."""
        changed = False
        while self._pending and self._pending[0].due <= track.t:
            item = self._pending.popleft()
            late = track.t - item.due
            if late > self._spacing or track.age > self._fresh:
                continue
            miss = pose - item.pose
            miss[:3] -= late * track.velocity_ned
            miss[3] = wrap_angle(float(miss[3]))
            north, east, down, heading = ((miss * miss - item.fitted) / item.expected).tolist()
            horizontal = 0.5 * (north + east)
            self._scale = np.array(
                [
                    min(max(scale + self._weight * (ratio - scale), LEAST), MOST)
                    for scale, ratio in zip(self._scale.tolist(), (horizontal, horizontal, down, heading), strict=True)
                ]
            )
            changed = True
        return changed
