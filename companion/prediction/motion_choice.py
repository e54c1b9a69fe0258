"""Which motion since when: the evidence of segments, put together over the whole track.

The target follows one motion, then begins another: Z_n, the evidence of the poses up to the n-th, is

    Z_n = sum over begins m and motions k of  Z_{m-1} * p(begin at m) * p(k) * p(y_m..y_n | k),

with begins at a constant rate (Adams and MacKay, "Bayesian online changepoint detection", 2007). The begins looked at
are a handful of ages. The same sum, term by term and normalised, is the probability of each.

A pose is weighed in parts, one per call, so that no call is much longer than another. The motion is known some calls
later, for the instant of the pose.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.arrays import Array
from companion.prediction.parameters import EvidenceParameters
from companion.prediction.polynomial import rebased
from companion.prediction.segments import NOISES, ORDERS, BodyFits, PolynomialFits, SegmentModel

AGES = (0.75, 1.5, 2.25, 3.0, 4.5, 6.0, 9.0, 12.0)  # [s] of the segments, besides the whole of what is kept
_AGES = np.array(AGES) + 1e-3
_LEAST = 3  # poses in a segment
_LEVEL = 1  # orders of the height: at rest; what looks like a climb is mostly the odometry's drift
_STEADY = 2  # of the heading: at rest, or a constant rate

Rows = list[list[float]]  # a matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """What the target is taken to do, from the instant of the fit, as a mean over all that is plausible."""

    t: float  # [s] of the fit
    coefficients: Array  # (4, 4) rows c0..c3, columns north, east, down [m], heading [rad]
    velocity: complex  # [m/s] along and to the right of the heading, on top of the polynomials
    rate_variance: Array  # (4,) of the velocity and turn rate later on
    deviation_variance: Array  # (4,) of the poses from the motion,
    deviation_decay: Array  # (4,) [1/s] and how fast they return to it
    age: float  # [s] how long the target has been moving so,
    turn_age: float  # [s] and turning so
    mean_velocity: Array  # (3,) [m/s] over all that is kept
    kinds: tuple[float, ...]  # probability of rest, constant velocity, constant acceleration, cubic, along the heading

    def moved(self, t: float, heading: float) -> tuple[Rows, complex]:
        """Give the coefficients (4, 4) by the time since `t` [s], and the arc's velocity there [m/s], north + i east.

        Args:
            t: not long after the fit.
            heading: of the target then [rad].
        """
        s = t - self.t
        zeroth, first, second = [], [], []
        c0, c1, c2, c3 = self.coefficients.tolist()
        for a, b, c, d in zip(c0, c1, c2, c3, strict=True):
            zeroth.append(a + s * (b + s * (c + s * d)))
            first.append(b + s * (2.0 * c + 3.0 * s * d))
            second.append(c + 3.0 * s * d)
        arc = self.velocity * cmath.exp(1j * heading)
        zeroth[0] += s * arc.real
        zeroth[1] += s * arc.imag
        return [zeroth, first, second, c3], arc

    def rebased(self, reset: OwnshipReset) -> Motion:
        """Take it into the frame after a reset of the autopilot's estimator."""
        coefficients = self.coefficients.copy()
        coefficients[:, :3] = coefficients[:, :3] @ reset.rotation.T
        coefficients[0, :3] = reset.position(self.coefficients[0, :3])
        coefficients[0, 3] += reset.yaw
        return replace(self, coefficients=coefficients, mean_velocity=reset.rotation @ self.mean_velocity)


Weights = tuple[Array, Array, Array]  # (motions, W, NOISES) horizontally, of the height, of the heading


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Mean:
    """The mean over all motions, relative to the newest pose."""

    chosen: Array  # (ORDERS, 4, W, NOISES) weights of the polynomials
    noises: Array  # (4, NOISES) weights of the noises
    coefficients: Array  # (4, 4) of the polynomials
    place: complex  # [m] of the motion along the heading
    velocity: complex  # [m/s] along and to the right of the heading


class MotionChoice:
    """Keeps the evidence of what came before, and weighs the motions anew with each pose."""

    def __init__(self, parameters: EvidenceParameters) -> None:
        self._p = parameters
        self._model = SegmentModel(parameters)
        self._times: deque[float] = deque()
        self._poses: deque[Array] = deque()
        self._before: deque[Array] = deque()  # (3,) log Z of all that came before each pose, per group
        self._newest = np.zeros(3)  # log Z up to the newest
        self._weighing: Iterator[None] | None = None  # what is left to do with the newest pose
        self._begun = 0.0  # [s] when that began
        self._parts = 0  # of it that are done
        self._motion: Motion | None = None
        reach = parameters.curve_s
        self._late = np.array([0.0, 1.0, 2.0 * reach, 3.0 * reach * reach])  # velocity by the coefficients, later on

    def reset(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._poses.clear()
        self._before.clear()
        self._newest = np.zeros(3)
        self._model.reset()
        self._weighing = self._motion = None

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator."""
        self._finish()
        self._poses = deque(rebased(pose, reset) for pose in self._poses)
        self._model.rebase(reset)
        if self._motion is not None:
            self._motion = self._motion.rebased(reset)

    @property
    def motion(self) -> Motion | None:
        """By the newest pose that is weighed; None while there were too few."""
        return self._motion

    @property
    def poses(self) -> deque[Array]:
        """The poses kept, oldest first, (4,) each."""
        return self._poses

    @property
    def times(self) -> deque[float]:
        """Their instants [s]."""
        return self._times

    def add(self, t: float, pose: Array) -> None:
        """Append a pose (4,), and do the first part of weighing it."""
        self._finish()
        self._times.append(t)
        self._poses.append(pose)
        self._before.append(self._newest)
        while len(self._times) > self._p.samples or t - self._times[0] > self._p.span:
            self._times.popleft()
            self._poses.popleft()
            self._before.popleft()
        self._weighing, self._begun, self._parts = self._weigh_in_parts(), t, 0
        self.advance(t)

    def advance(self, t: float) -> None:
        """Do the parts that are due at `t` [s], not before the newest pose: one at first, and one each `part`."""
        due = 1.0 + (t - self._begun + 1e-3) / self._p.part
        while self._weighing is not None and self._parts + 1 <= due:
            self._do_part(self._weighing)

    def _finish(self) -> None:
        while self._weighing is not None:
            self._do_part(self._weighing)

    def _do_part(self, weighing: Iterator[None]) -> None:
        self._parts += 1
        try:
            next(weighing)
        except StopIteration:
            self._weighing = None

    def _weigh_in_parts(self) -> Iterator[None]:
        """Weigh the newest pose, stopping between the parts."""
        t, pose, model = self._times[-1], self._poses[-1], self._model
        model.add_place(t, pose)
        yield
        model.add_heading(t, pose)
        if len(self._times) < _LEAST:
            self._motion = None
            return
        times = np.array(self._times)[::-1] - t
        lengths = _lengths(times)
        yield
        linear, heading = model.linear_products(lengths), model.heading_products(lengths)
        yield
        polynomials = model.polynomials(linear, heading)
        yield
        body = model.body(linear)
        weights = self._weigh(self._begins(times, lengths), polynomials, body)
        yield
        mean = self._mean(weights, polynomials, body)
        yield
        self._motion = self._later(mean, weights, polynomials, body, -times[np.array(lengths) - 1])

    def _begins(self, times: Array, lengths: list[int]) -> Array:
        """Give the log of Z before each segment, with the probability of its begin, (3, W)."""
        rate = self._p.change_rate
        result = np.array([self._before[-length] for length in lengths])
        shares = []
        for length in lengths:
            first = float(times[length - 1])
            begun = 0.0 if length == len(times) else math.log1p(-math.exp(rate * (float(times[length]) - first)))
            shares.append(begun + rate * first)  # none since
        return result.T + shares

    def _weigh(self, begins: Array, polynomials: PolynomialFits, body: BodyFits) -> Weights:
        """Give the probability of each motion, segment and noise."""
        evidence = polynomials.evidence
        horizontal = np.empty((ORDERS + 1, *body.evidence.shape))
        np.add(evidence[:, 0], evidence[:, 1], out=horizontal[:ORDERS])
        horizontal[ORDERS] = body.evidence
        weights = []
        newest = np.empty(3)
        for group, each in enumerate((horizontal, evidence[:_LEVEL, 2], evidence[:_STEADY, 3])):
            values = each + begins[group][:, None]
            most = float(values.max())
            weight = np.exp(values - most)
            total = float(weight.sum())
            newest[group] = most + math.log(total / (len(values) * NOISES))  # each as likely beforehand
            weights.append(weight / total)
        self._newest = newest
        return weights[0], weights[1], weights[2]

    def _mean(self, weights: Weights, polynomials: PolynomialFits, body: BodyFits) -> _Mean:
        """Give the mean motion."""
        chosen = np.zeros(polynomials.evidence.shape)
        noises = np.empty((4, NOISES))
        for axis, weight in enumerate((weights[0], *weights)):
            orders = min(len(weight), ORDERS)
            chosen[:orders, axis] = weight[:orders]
            noises[axis] = weight.reshape(-1, NOISES).sum(axis=0)
        return _Mean(
            chosen=chosen,
            noises=noises,
            coefficients=polynomials.mean(chosen),
            place=complex(weights[0][ORDERS].ravel() @ body.place.ravel()),
            velocity=complex(weights[0][ORDERS].ravel() @ body.velocity.ravel()),
        )

    def _later(self, mean: _Mean, weights: Weights, polynomials: PolynomialFits, body: BodyFits, ages: Array) -> Motion:
        """Give the motion with how sure it is later on; `ages` (W,) [s] of the segments."""
        newest, span = self._poses[-1], self._times[-1] - self._times[0]
        turn = cmath.exp(1j * float(newest[3]))
        turned, variance, along = body.velocity.ravel() * turn, body.variance.ravel(), weights[0][ORDERS].ravel()
        turned_mean = mean.velocity * turn
        rates, squares = self._late @ mean.coefficients, polynomials.square(mean.chosen, self._late)
        rates[:2] += [turned_mean.real, turned_mean.imag]
        squares[:2] += [along @ (variance + turned.real**2), along @ (variance + turned.imag**2)]
        rate_variance = squares - rates * rates
        rate_variance[:2] = 0.5 * (rate_variance[0] + rate_variance[1])
        turning = weights[2][1].sum(axis=1)
        coefficients = mean.coefficients
        coefficients[0] += newest
        coefficients[0, :2] += [mean.place.real, mean.place.imag]
        return Motion(
            t=self._times[-1],
            coefficients=coefficients,
            velocity=mean.velocity,
            rate_variance=rate_variance,
            deviation_variance=(mean.noises * self._model.variance).sum(axis=1),
            deviation_decay=(mean.noises * self._model.decay).sum(axis=1),
            age=float(weights[0].sum(axis=(0, 2)) @ ages),
            turn_age=float(turning @ ages) / max(float(turning.sum()), 1e-9),
            mean_velocity=(newest[:3] - self._poses[0][:3]) / span,
            kinds=tuple(weights[0].sum(axis=(1, 2)).tolist()),
        )


def _lengths(times: Array) -> list[int]:
    """Give how many of the newest poses each segment has: a handful of ages, and all."""
    count = len(times)
    ages = np.searchsorted(-times, _AGES)
    return sorted({count, *(max(int(length), _LEAST) for length in ages)})
