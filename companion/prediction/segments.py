"""How well motions of several kinds explain the end of a track: their evidence, and what they say of the future.

A segment is the newest m poses of the track. Per degree of freedom

    y_i = c_0 + c_1 u_i + c_2 u_i^2 + c_3 u_i^3 + n_i,      u_i = t_i - now <= 0,

with c ~ N(0, diag(s^2)), of which order k uses the first k + 1, and n a stationary process: the wander of the
odometry, the levelling, a target's unsteadiness. Its covariance over a lag d is sigma^2 (1 + d / tau) exp(-d / tau)
where it is smooth (positions), sigma^2 exp(-d / tau) where it is not (headings). With its Cholesky factor L_n the rows
are whitened, [H z] = L_n^-1 [U y]; with A = H^T H + diag(1 / s^2) and b = H^T z the evidence is

    log p(y) = -1/2 (z^T z - b^T A^-1 b + log det(A diag(s^2)) + m log 2 pi) - log det L_n.

`SegmentMoments` keeps the products. A lower order is the leading block of a higher, so a single elimination of
[A | b | 1] gives them all: its rows, divided by the roots of the pivots, are A^1/2, A^-1/2 b and A^-1/2.

Horizontally there is a fifth motion: that of a target that drives with a constant velocity d relative to its own
heading psi, p(t) = c_0 + Z(t) d with Z(t) = -integral from t to now of R(psi). Written with complex numbers (north +
i east, R = e^{i psi}) it is the same regression with two unknowns. Carried on at a constant turn rate it is an arc.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from companion.estimation.ownship import OwnshipReset
from companion.geometry.arrays import Array
from companion.prediction.moments import POWERS, SegmentMoments
from companion.prediction.parameters import EvidenceParameters

ORDERS = 4  # rest, constant velocity, constant acceleration, cubic
NOISES = 3  # guesses of the deviations
_AXES = 4  # north, east, down, heading
_VALUES = 3  # of them in the linear kind; the heading has one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolynomialFits:
    """What W segments, under each noise, say with polynomials of each order, for north, east, down and heading."""

    evidence: Array  # (ORDERS, 4, W, NOISES) log p of the segment's poses
    projected: Array  # (ORDERS, 4, W, NOISES) A^-1/2 b
    factors: Array  # (ORDERS, 4, 2, W, NOISES) A^-1/2, lower, by row and column, for positions and heading

    def mean(self, weights: Array) -> Array:
        """Give the mean (4, 4) of c_0 to c_3 of each axis, all of them by weights (ORDERS, 4, W, NOISES)."""
        shares = weights.copy()
        for order in range(ORDERS - 2, -1, -1):
            shares[order] += shares[order + 1]  # a row of A^-1/2 counts with its order and all above
        shares *= self.projected
        flat = shares.reshape(ORDERS, _AXES, -1).transpose(1, 0, 2).reshape(_AXES, -1)
        factors = self.factors.reshape(ORDERS, POWERS, 2, -1).transpose(2, 1, 0, 3).reshape(2, POWERS, -1)
        coefficients = np.empty((POWERS, _AXES))
        coefficients[:, :_VALUES] = factors[0] @ flat[:_VALUES].T
        coefficients[:, _VALUES] = factors[1] @ flat[_VALUES]
        return coefficients

    def square(self, weights: Array, combination: Array) -> Array:
        """Give the mean squares (4,) of a sum of c_0 to c_3 with the weights `combination` (4,), `weights` as above."""
        rows = (combination @ self.factors.reshape(ORDERS, POWERS, -1)).reshape(ORDERS, 2, *self.projected.shape[2:])
        means, variances = np.empty(self.projected.shape), np.cumsum(rows * rows, axis=0)
        np.multiply(rows[:, :1], self.projected[:, :_VALUES], out=means[:, :_VALUES])
        np.multiply(rows[:, 1], self.projected[:, _VALUES], out=means[:, _VALUES])
        np.cumsum(means, axis=0, out=means)
        means *= means
        means[:, :_VALUES] += variances[:, :1]
        means[:, _VALUES] += variances[:, 1]
        means *= weights
        result: Array = means.sum(axis=(0, 2, 3))
        return result


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyFits:
    """What they say with a constant velocity relative to the target's heading."""

    evidence: Array  # (W, NOISES) log p of north and east
    place: Array  # (W, NOISES) complex c_0
    velocity: Array  # (W, NOISES) complex d [m/s] along the heading and to its right
    variance: Array  # (W, NOISES) [m^2/s^2] of either component of d


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SegmentProducts:
    """Whitened products of W segments under each noise."""

    gram: Array  # (W, NOISES, C, C) of the columns 1, u, u^2, u^3, then the values
    log: Array  # (W, NOISES) of the whitening


class SegmentModel:
    """Takes poses, and fits every kind of motion to the newest of them. Poses relative to the newest."""

    def __init__(self, parameters: EvidenceParameters) -> None:
        p = parameters
        linear = [p.place, p.speed, 0.5 * p.acceleration, p.jerk / 6.0]
        heading = [p.place_heading, p.turn_rate, 0.5 * p.turn_rate, 0.1 * p.turn_rate]
        self._precision = np.stack([linear, heading], axis=1) ** -2.0  # (POWERS, 2)
        self._log_prior = 0.5 * np.cumsum(np.log(self._precision), axis=0)[:, :, None, None]
        self._linear = SegmentMoments(
            deviation=p.deviation, time=p.deviation_time, smooth=True, values=_VALUES + 2, capacity=p.samples
        )
        self._heading = SegmentMoments(
            deviation=p.deviation_heading, time=p.deviation_time_heading, smooth=False, values=1, capacity=p.samples
        )
        self._way = 0.0j  # [m] integral of R(psi) so far
        self._newest: tuple[float, complex] | None = None  # instant and R(psi)
        # of north, east, down, heading, (4, NOISES): deviation squared and how fast it dies out
        self.variance = np.square([p.deviation] * 3 + [p.deviation_heading])
        self.decay = 1.0 / np.array([p.deviation_time] * 3 + [p.deviation_time_heading])

    def reset(self) -> None:
        """Forget everything."""
        self._linear.reset()
        self._heading.reset()
        self._newest = None

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator."""
        turn, shift = np.zeros((5, 5)), np.zeros(5)
        turn[:3, :3] = reset.rotation
        turn[3:, 3:] = reset.rotation[:2, :2]
        shift[:3] = reset.translation_ned
        self._linear.transform(turn, shift)
        self._heading.transform(np.eye(1), np.array([reset.yaw]))
        turned = cmath.exp(1j * reset.yaw)
        self._way *= turned
        if self._newest is not None:
            self._newest = (self._newest[0], self._newest[1] * turned)

    def add_place(self, t: float, pose: Array) -> None:
        """Take the place of a pose (4,) at `t` [s]; `add_heading` takes the rest of it."""
        north, east, down, heading = pose.tolist()
        along = cmath.exp(1j * heading)
        if self._newest is not None:
            before, course = self._newest
            self._way += 0.5 * (t - before) * (along + course)
        self._newest = (t, along)
        self._linear.add(t, np.array([north, east, down, self._way.real, self._way.imag]))

    def add_heading(self, t: float, pose: Array) -> None:
        """Take its heading."""
        self._heading.add(t, pose[3:])

    def linear_products(self, lengths: list[int]) -> SegmentProducts:
        """Give the products of the segments with the newest so many poses; values north, east, down, Z."""
        gram, log = self._linear.segments(lengths)
        return SegmentProducts(gram=gram, log=log)

    def heading_products(self, lengths: list[int]) -> SegmentProducts:
        """Give the same with the heading as the value."""
        gram, log = self._heading.segments(lengths)
        return SegmentProducts(gram=gram, log=log)

    def polynomials(self, positions: SegmentProducts, headings: SegmentProducts) -> PolynomialFits:
        """Fit polynomials to all degrees of freedom."""
        linear, heading = positions.gram, headings.gram
        values = POWERS + _VALUES
        rows = np.zeros((POWERS, values + POWERS, 2, *linear.shape[:2]))  # [A | b | 1]
        rows[:, :values, 0] = linear[..., :POWERS, :values].transpose(2, 3, 0, 1)
        rows[:, : POWERS + 1, 1] = heading[..., :POWERS, :].transpose(2, 3, 0, 1)
        pivots = np.empty((ORDERS, 2, *linear.shape[:2]))
        for k in range(POWERS):
            rows[k, k] += self._precision[k, :, None, None]
            rows[k, values + k] = 1.0
        for k in range(POWERS):
            np.sqrt(rows[k, k], out=pivots[k])
            rows[k, k:] /= pivots[k]
            rows[k + 1 :, k + 1 :] -= rows[k, k + 1 : POWERS, None] * rows[k, k + 1 :]
        projected = np.empty((ORDERS, _AXES, *linear.shape[:2]))
        projected[:, :_VALUES] = rows[:, POWERS:values, 0]
        projected[:, _VALUES] = rows[:, POWERS, 1]
        squares = np.empty(projected.shape[1:])
        squares[:_VALUES] = np.diagonal(linear, axis1=-2, axis2=-1)[..., POWERS:values].transpose(2, 0, 1)
        squares[_VALUES] = heading[..., POWERS, POWERS]
        constant = self._log_prior - np.cumsum(np.log(pivots), axis=0)
        evidence = np.cumsum(projected * projected, axis=0)
        evidence -= squares
        evidence *= 0.5
        evidence[:, :_VALUES] += constant[:, :1] + positions.log
        evidence[:, _VALUES] += constant[:, 1] + headings.log
        return PolynomialFits(evidence=evidence, projected=projected, factors=rows[:, values:])

    def body(self, positions: SegmentProducts) -> BodyFits:
        """Fit the motion along the heading."""
        gram = positions.gram  # columns 4, 5 north and east, 7, 8 Z
        place, speed = self._precision[:2, 0].tolist()
        a, c = gram[..., 0, 0] + place, gram[..., 7, 7] + gram[..., 8, 8] + speed
        b = gram[..., 0, 7] + 1j * gram[..., 0, 8]
        p = gram[..., 0, 4] + 1j * gram[..., 0, 5]
        q = gram[..., 7, 4] + gram[..., 8, 5] + 1j * (gram[..., 7, 5] - gram[..., 8, 4])
        determinant = a * c - (b * b.conj()).real
        at, velocity = (c * p - b * q) / determinant, (a * q - b.conj() * p) / determinant
        explained = (p.conj() * at + q.conj() * velocity).real
        evidence = 0.5 * (explained - gram[..., 4, 4] - gram[..., 5, 5]) - np.log(determinant / (place * speed))
        return BodyFits(evidence=evidence + 2.0 * positions.log, place=at, velocity=velocity, variance=a / determinant)
