"""Forecasts of a target that drives along its heading and may wind about regularly."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import unwrap_near
from companion.geometry.arrays import Array
from companion.messages.target import Prediction, TargetPose, TargetTrack
from companion.prediction.evidence import EvidencePredictor
from companion.prediction.evidence_forecast import EvidencePrediction
from companion.prediction.parameters import PredictorParameters
from companion.prediction.polynomial import is_another
from companion.prediction.winding import HeadingCourse, WindingRegression


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WindingPrediction:
    """Another forecast, with the expected winding in the place of its turn, as far as that is believed.

    With the change of heading c(t) since the anchor and the anchor's velocity v, the winding target is at

        p(t) = p_anchor + integral of R(c) v,    psi(t) = psi_anchor + c(t);

    the forecast is that and the other one, weighed with `share`. The covariance is the other's.
    """

    base: EvidencePrediction
    share: float  # 0 .. 1 of the winding
    times: Array  # (N,) [s] from the anchor on, a constant step apart
    changes: Array  # (N,) [rad] of heading since the anchor
    places: Array  # (N,) [m] complex, north + i east, driven since the anchor
    anchor: TargetPose

    @property
    def t(self) -> float:
        """Instant [s] at which the forecast begins."""
        return self.base.t

    @property
    def horizon(self) -> float:
        """Time [s] after `t` up to which it may be asked."""
        return self.base.horizon

    @property
    def reset_counter(self) -> int:
        """Reset counter of the odometry that anchors it."""
        return self.base.reset_counter

    def at(self, t: float) -> TargetPose:
        """Give the target at `t` [s]; beyond the horizon the velocity is held."""
        pose = self.base.at(t)
        place, course, turn = self._wound(t)
        share, rest = self.share, 1.0 - self.share
        position, velocity = pose.position_ned.copy(), pose.velocity_ned.copy()
        acceleration = rest * pose.acceleration_ned
        for axis, where, rate in ((0, place.real, course.real), (1, place.imag, course.imag)):
            position[axis] = rest * position[axis] + share * (float(self.anchor.position_ned[axis]) + where)
            velocity[axis] = rest * velocity[axis] + share * rate
        acceleration[0] -= share * turn * course.imag
        acceleration[1] += share * turn * course.real
        return TargetPose(
            t=t,
            position_ned=position,
            velocity_ned=velocity,
            acceleration_ned=acceleration,
            yaw=rest * pose.yaw + share * (self.anchor.yaw + self._change(t)),
            yaw_rate=rest * pose.yaw_rate + share * turn,
            covariance=pose.covariance,
        )

    def positions_ned(self, times: Array) -> Array:
        """Give positions (N, 3) [m] at the instants (N,) [s]."""
        result = self.base.positions_ned(times)
        inside = np.clip(times, self.times[0], self.times[-1])
        real = np.interp(inside, self.times, self.places.real)
        imag = np.interp(inside, self.times, self.places.imag)
        outside = times - inside
        end = self._velocity * np.exp(1j * float(self.changes[-1]))
        course = np.where(outside < 0.0, self._velocity, end)
        result[:, 0] += self.share * (float(self.anchor.position_ned[0]) + real + course.real * outside - result[:, 0])
        result[:, 1] += self.share * (float(self.anchor.position_ned[1]) + imag + course.imag * outside - result[:, 1])
        return result

    @property
    def _velocity(self) -> complex:
        north, east, _ = self.anchor.velocity_ned.tolist()
        return complex(north, east)

    def _index(self, t: float) -> tuple[int, float]:
        """Give the step that `t` [s] lies in and the share of it gone by; below 0 or above 1 outside of all."""
        first, step = float(self.times[0]), float(self.times[1] - self.times[0])
        at = (t - first) / step
        index = min(max(int(at), 0), len(self.times) - 2)
        return index, at - index

    def _change(self, t: float) -> float:
        index, part = self._index(t)
        part = min(max(part, 0.0), 1.0)
        return float(self.changes[index]) * (1.0 - part) + float(self.changes[index + 1]) * part

    def _wound(self, t: float) -> tuple[complex, complex, float]:
        """Give where it has driven since the anchor [m], its velocity [m/s], north + i east, and turn rate [rad/s]."""
        index, part = self._index(t)
        step = float(self.times[1] - self.times[0])
        turn = (float(self.changes[index + 1]) - float(self.changes[index])) / step if 0.0 <= part <= 1.0 else 0.0
        velocity = self._velocity * complex(math.cos(self._change(t)), math.sin(self._change(t)))
        inside = min(max(part, 0.0), 1.0)
        place = complex(self.places[index]) * (1.0 - inside) + complex(self.places[index + 1]) * inside
        return place + velocity * ((part - inside) * step), velocity, turn


@dataclass(frozen=True, slots=True, kw_only=True)
class _Expected:
    """What was forecast for one instant."""

    t: float  # [s]
    wound: float  # [rad] heading, by the winding
    other: float  # [rad] and by the other forecast


class WindingPredictor:
    """The evidence's forecast, with the turn of a regular winding where past forecasts say that this is better.

    Both are asked for the heading `lead` ahead, and the winding's share is other^2 / (other^2 + winding^2 + floor^2) by
    the mean squares of what they missed by. What the heading did in the last second must agree too: a target that
    has stopped, or begun something else, is believed at once.

    Args:
        parameters: of the predictors.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._base = EvidencePredictor(parameters)
        self._parameters = parameters
        self._p = parameters.winding
        self._regression = WindingRegression(self._p)
        self._forget()

    def _forget(self) -> None:
        self._regression.reset()
        self._newest: TargetTrack | None = None
        self._anchor_t = -math.inf  # [s] of the newest state with a fresh measurement
        self._heading = 0.0  # [rad] then, not wrapped
        self._first: tuple[Array, float] | None = None  # (3,) [m] and heading [rad] where it was first seen
        self._begun = False
        self._kept: deque[tuple[float, float]] = deque()  # [s], [rad] of the last second
        self._course: HeadingCourse | None = None
        self._unasked = False  # there is a new course, for which nothing is expected yet
        self._expected: deque[_Expected] = deque()
        self._judged = 0
        self._missed_winding = self._missed_other = 0.0  # [rad^2] means
        self._counter = 0

    def reset(self) -> None:
        """Forget everything."""
        self._base.reset()
        self._forget()

    def rebase(self, reset: OwnshipReset) -> None:
        """Take what is kept into the frame after a reset of the autopilot's estimator."""
        self._base.rebase(reset)
        self._counter = reset.counter
        self._regression.turn(reset.yaw)
        self._heading += reset.yaw
        if self._first is not None:
            self._first = (reset.position(self._first[0]), self._first[1] + reset.yaw)
        self._kept = deque((t, heading + reset.yaw) for t, heading in self._kept)
        self._expected = deque(
            _Expected(t=e.t, wound=e.wound + reset.yaw, other=e.other + reset.yaw) for e in self._expected
        )

    def add(self, track: TargetTrack) -> None:
        """Append a state of the track. One that is not newer is ignored."""
        newest = self._newest
        if newest is not None and track.t <= newest.t:
            return
        if newest is not None and is_another(track, newest, counter=self._counter, gap=self._parameters.gap):
            self._forget()
        self._base.add(track)
        first = self._newest is None
        self._newest, self._counter = track, track.reset_counter
        if track.age > self._parameters.fresh:
            return
        self._heading = track.yaw_ned if first else unwrap_near(track.yaw_ned, self._heading)
        self._anchor_t = track.t
        if self._kept and track.t - self._kept[-1][0] < self._p.spacing - 1e-3:
            return
        if not self._has_begun(track):
            return
        self._judge(track.t)
        self._kept.append((track.t, self._heading))
        while track.t - self._kept[0][0] > self._p.recent + 1e-3:
            self._kept.popleft()
        self._regression.add(track.t, self._heading)
        self._course = self._regression.course(track.t)
        self._unasked = True

    def predict(self) -> Prediction | None:
        """Give the forecast from the newest state; None before the first."""
        base, course = self._base.predict(), self._course
        if base is None or course is None:
            return base
        t, p = self._anchor_t, self._p
        if self._unasked:
            self._unasked = False
            ahead = t + p.lead
            change = float(course.change(t, np.array([ahead]))[0])
            other = self._heading + base.at(ahead).yaw - base.at(t).yaw
            self._expected.append(_Expected(t=ahead, wound=self._heading + change, other=other))
        share = self._share()
        if share < p.share_least:
            return base
        times: Array = t + p.step * np.arange(round(p.ahead / p.step) - round(p.spacing / p.step) + 0.0)
        changes = course.change(t, times)
        anchor = base.at(t)
        middle = np.exp(0.5j * (changes[1:] + changes[:-1]))
        north, east, _ = anchor.velocity_ned.tolist()
        places = np.concatenate(([0.0j], np.cumsum(middle) * (p.step * complex(north, east))))
        return WindingPrediction(base=base, share=share, times=times, changes=changes, places=places, anchor=anchor)

    def _has_begun(self, track: TargetTrack) -> bool:
        """Say whether the target has set off: how it stood before would be no part of its winding."""
        if self._first is None:
            self._first = (track.position_ned, self._heading)
        if not self._begun:
            place, heading = self._first
            gone = math.dist(place[:2].tolist(), track.position_ned[:2].tolist())
            self._begun = gone > self._p.begun or abs(self._heading - heading) > self._p.begun_turn
        return self._begun

    def _judge(self, t: float) -> None:
        """Compare what was forecast for now with what has become of it."""
        while self._expected and self._expected[0].t <= t:
            expected = self._expected.popleft()
            if not self._kept or t - self._kept[-1][0] > 2.0 * self._p.spacing:
                continue  # the target was out of sight then
            before, heading = self._kept[-1]
            heading += (self._heading - heading) * (expected.t - before) / (t - before)
            self._judged += 1
            weight = max(1.0 / self._judged, self._p.spacing / self._p.patience)
            self._missed_winding += weight * ((heading - expected.wound) ** 2 - self._missed_winding)
            self._missed_other += weight * ((heading - expected.other) ** 2 - self._missed_other)

    def _share(self) -> float:
        p, course = self._p, self._course
        if course is None or self._judged < p.judged_least:
            return 0.0
        missed = self._missed_other
        share = missed / (missed + self._missed_winding + p.floor * p.floor)
        then, heading = self._kept[0]
        surprise = self._heading - heading - float(course.change(then, np.array([self._anchor_t]))[0])
        return share / (1.0 + (surprise / p.surprise) ** 2) ** 2
