"""Which motion since when: the evidence of segments, put together over the whole track.

The target follows one motion, then begins another: Z_n, the evidence of the poses up to the n-th, is

    Z_n = sum over begins m and motions k of  Z_{m-1} * p(begin at m) * p(k) * p(y_m..y_n | k),

with begins at a constant rate (Adams and MacKay, "Bayesian online changepoint detection", 2007). The begins looked at
are a handful of ages. The same sum, term by term and normalised, is the probability of each.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.arrays import Array
from companion.prediction.parameters import EvidenceParameters
from companion.prediction.segments import ORDERS, BodyFits, PolynomialFits, SegmentModel

AGES = (0.75, 1.5, 2.25, 3.0, 4.5, 6.0, 9.0, 12.0)  # [s] of the segments, besides the whole of what is kept
_LEAST = 3  # poses in a segment
_LEVEL = 1  # orders of the height: at rest; what looks like a climb is mostly the odometry's drift
_STEADY = 2  # of the heading: at rest, or a constant rate


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

    def moved(self, t: float, heading: float) -> tuple[Array, complex]:
        """Give the coefficients (4, 4) by the time since `t` [s], and the arc's velocity there [m/s], north + i east.

        Args:
            t: not long after the fit.
            heading: of the target then [rad].
        """
        s = t - self.t
        c0, c1, c2, c3 = self.coefficients
        shifted = np.array(
            [c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + 3.0 * s * c3), c2 + 3.0 * s * c3, c3]
        )
        arc = self.velocity * cmath.exp(1j * heading)
        shifted[0, 0] += s * arc.real
        shifted[0, 1] += s * arc.imag
        return shifted, arc

    def rebased(self, reset: OwnshipReset) -> Motion:
        """Take it into the frame after a reset of the autopilot's estimator."""
        coefficients = self.coefficients.copy()
        coefficients[:, :3] = coefficients[:, :3] @ reset.rotation.T
        coefficients[0, :3] = reset.position(self.coefficients[0, :3])
        coefficients[0, 3] += reset.yaw
        return replace(self, coefficients=coefficients, mean_velocity=reset.rotation @ self.mean_velocity)


class MotionChoice:
    """Keeps the evidence of what came before, and weighs the motions anew with each pose."""

    def __init__(self, parameters: EvidenceParameters) -> None:
        self._p = parameters
        self._model = SegmentModel(parameters)
        self._times: deque[float] = deque()
        self._poses: deque[Array] = deque()
        self._before: deque[Array] = deque()  # (3,) log Z of all that came before each pose, per group
        self._newest = np.zeros(3)  # log Z up to the newest
        reach = parameters.curve_s
        self._late = np.array([0.0, 1.0, 2.0 * reach, 3.0 * reach * reach])  # velocity by the coefficients, later on

    def reset(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._poses.clear()
        self._before.clear()
        self._newest = np.zeros(3)

    def replace(self, poses: list[Array]) -> None:
        """Give all poses kept new values, after a reset of the autopilot's estimator."""
        self._poses = deque(poses)

    @property
    def poses(self) -> deque[Array]:
        """The poses kept, oldest first, (4,) each."""
        return self._poses

    @property
    def times(self) -> deque[float]:
        """Their instants [s]."""
        return self._times

    def add(self, t: float, pose: Array) -> Motion | None:
        """Append a pose (4,) and weigh the motions; None while there are too few."""
        self._times.append(t)
        self._poses.append(pose)
        self._before.append(self._newest)
        while len(self._times) > self._p.samples or t - self._times[0] > self._p.span:
            self._times.popleft()
            self._poses.popleft()
            self._before.popleft()
        if len(self._times) < _LEAST:
            return None
        times = np.array(self._times)[::-1] - t
        poses = np.array(self._poses)[::-1]
        poses[:, :3] -= pose[:3]
        lengths = _lengths(times)
        linear, heading, body = self._model.fit(times, poses, lengths)
        weights = self._weigh(times, lengths, linear, heading, body)
        ages = -times[np.array(lengths) - 1]
        turning = weights[2][:, :, 1].sum(axis=1)
        return self._mean(
            weights,
            linear,
            heading,
            body,
            age=float(weights[0].sum(axis=(1, 2)) @ ages),
            turn_age=float(turning @ ages) / max(float(turning.sum()), 1e-9),
        )

    def _begins(self, times: Array, lengths: list[int]) -> Array:
        """Give the log of Z before each segment, with the probability of its begin, (W, 3)."""
        rate = self._p.change_rate
        result = np.array([self._before[-length] for length in lengths])
        for w, length in enumerate(lengths):
            if length < len(times):
                result[w] += math.log1p(-math.exp(rate * float(times[length] - times[length - 1])))
            result[w] += rate * float(times[length - 1])  # none since
        return result

    def _weigh(
        self, times: Array, lengths: list[int], linear: PolynomialFits, heading: PolynomialFits, body: BodyFits
    ) -> tuple[Array, Array, Array]:
        """Give the probability of each segment, noise and motion: horizontally, of the height, of the heading."""
        begins = self._begins(times, lengths)[:, None, None, :]  # over noises and orders
        horizontal = np.empty((*body.evidence.shape, ORDERS + 1))
        horizontal[..., :ORDERS] = linear.evidence[:, :, 0] + linear.evidence[:, :, 1]
        horizontal[..., ORDERS] = body.evidence
        groups = (horizontal, linear.evidence[:, :, 2, :_LEVEL], heading.evidence[:, :, 0, :_STEADY])
        weights = []
        newest = np.empty(3)
        for group, evidence in enumerate(groups):
            values = evidence + begins[..., group]
            most = float(values.max())
            weight = np.exp(values - most)
            total = float(weight.sum())
            newest[group] = most + math.log(total / (values.shape[1] * values.shape[2]))  # each as likely beforehand
            weights.append(weight / total)
        self._newest = newest
        return weights[0], weights[1], weights[2]

    def _mean(
        self,
        weights: tuple[Array, Array, Array],
        linear: PolynomialFits,
        heading: PolynomialFits,
        body: BodyFits,
        *,
        age: float,
        turn_age: float,
    ) -> Motion:
        newest = self._poses[-1]
        coefficients = np.empty((4, 4))
        rates, deviations, decays = np.empty(4), np.empty(4), np.empty(4)
        along = weights[0][..., ORDERS]
        place, velocity = complex((along * body.place).sum()), complex((along * body.velocity).sum())
        turned = body.velocity * cmath.exp(1j * float(newest[3]))
        for axis, weight in enumerate((weights[0], *weights)):
            fits, index = (linear, axis) if axis < 3 else (heading, 0)
            orders = min(weight.shape[-1], ORDERS)
            chosen = weight[..., :orders]
            fitted = fits.coefficients[:, :, index, :orders]
            coefficients[:, axis] = chosen.reshape(-1) @ fitted.reshape(-1, 4)
            late = fitted @ self._late
            variance = np.cumsum(np.square(fits.factors[:, :, :orders] @ self._late), axis=-1)
            rate = float((chosen * late).sum())
            square = float((chosen * (variance + late * late)).sum())
            if axis < 2:
                part = turned.imag if axis else turned.real
                coefficients[0, axis] += place.imag if axis else place.real
                rate += float((along * part).sum())
                square += float((along * (body.variance + part * part)).sum())
            rates[axis] = square - rate * rate
            noises = weight.sum(axis=(0, 2))
            deviations[axis] = noises @ np.square(self._model.sigma[:, axis])
            decays[axis] = noises @ self._model.decay[:, axis]
        coefficients[0, :3] += newest[:3]
        rates[:2] = 0.5 * (rates[0] + rates[1])
        return Motion(
            t=self._times[-1],
            coefficients=coefficients,
            velocity=velocity,
            rate_variance=rates,
            deviation_variance=deviations,
            deviation_decay=decays,
            age=age,
            turn_age=turn_age,
            mean_velocity=(newest[:3] - self._poses[0][:3]) / (self._times[-1] - self._times[0]),
            kinds=tuple(weights[0].sum(axis=(0, 1)).tolist()),
        )


def _lengths(times: Array) -> list[int]:
    """Give how many of the newest poses each segment has: a handful of ages, and all."""
    count = len(times)
    ages = np.searchsorted(-times, np.array(AGES) + 1e-3)
    return sorted({count, *(max(int(length), _LEAST) for length in ages)})
