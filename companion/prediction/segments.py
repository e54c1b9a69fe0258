"""How well motions of several kinds explain the end of a track: their evidence, and what they say of the future.

A segment is the newest m poses of the track. Per degree of freedom

    y_i = c_0 + c_1 u_i + c_2 u_i^2 + c_3 u_i^3 + n_i,      u_i = t_i - now <= 0,

with c ~ N(0, diag(s^2)), of which order k uses the first k + 1, and n a stationary process: the wander of the
odometry, the levelling, a target's unsteadiness. Its covariance over a lag d is sigma^2 (1 + d / tau) exp(-d / tau)
where it is smooth (positions), sigma^2 exp(-d / tau) where it is not (headings). With its Cholesky factor L_n the rows
are whitened, [H z] = L_n^-1 [U y]; with A = H^T H + diag(1 / s^2) and b = H^T z the evidence is

    log p(y) = -1/2 (z^T z - b^T A^-1 b + log det(A diag(s^2)) + m log 2 pi) - log det L_n.

Poses are put in the order of their age: a shorter segment is then the leading block of a longer one, and a lower order
the leading block of a higher, so a single factorisation gives them all, whatever gaps there are between the poses.

Horizontally there is a fifth motion: that of a target that drives with a constant velocity d relative to its own
heading psi, p(t) = c_0 + Z(t) d with Z(t) = -integral from t to now of R(psi). Written with complex numbers (north +
i east, R = e^{i psi}) it is the same regression with two unknowns. Carried on at a constant turn rate it is an arc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array
from companion.prediction.parameters import EvidenceParameters

ORDERS = 4  # rest, constant velocity, constant acceleration, cubic
NOISES = 3  # guesses of the deviations
_LOG_2PI = math.log(2.0 * math.pi)
_JITTER = 1e-4  # of the variance: measurement noise, and keeps the factorisation sound


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolynomialFits:
    """What W segments, under each noise, say with polynomials of each order, for A degrees of freedom."""

    evidence: Array  # (W, NOISES, A, ORDERS) log p of the segment's poses
    coefficients: Array  # (W, NOISES, A, ORDERS, 4) posterior means of c_0..c_3
    factors: Array  # (W, NOISES, 4, 4) A^-1/2, lower; its first k + 1 rows are order k's


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyFits:
    """What they say with a constant velocity relative to the target's heading."""

    evidence: Array  # (W, NOISES) log p of north and east
    place: Array  # (W, NOISES) complex c_0
    velocity: Array  # (W, NOISES) complex d [m/s] along the heading and to its right
    variance: Array  # (W, NOISES) [m^2/s^2] of either component of d


class SegmentModel:
    """The priors and noises, as arrays."""

    def __init__(self, parameters: EvidenceParameters) -> None:
        p = parameters
        self._linear = _Kind(
            prior=[p.place, p.speed, 0.5 * p.acceleration, p.jerk / 6.0],
            sigma=p.deviation,
            tau=p.deviation_time,
            smooth=True,
        )
        self._heading = _Kind(
            prior=[p.place_heading, p.turn_rate, 0.5 * p.turn_rate, 0.1 * p.turn_rate],
            sigma=p.deviation_heading,
            tau=p.deviation_time_heading,
            smooth=False,
        )
        # of north, east, down, heading, (NOISES, 4): deviation and how fast it dies out
        self.sigma = np.stack([p.deviation] * 3 + [p.deviation_heading], axis=1)
        self.decay = 1.0 / np.stack([p.deviation_time] * 3 + [p.deviation_time_heading], axis=1)

    def fit(self, times: Array, poses: Array, lengths: list[int]) -> tuple[PolynomialFits, PolynomialFits, BodyFits]:
        """Fit every kind of motion to every segment.

        Args:
            times: (n,) [s], falling, from 0 for the newest.
            poses: (n, 4) north, east, down [m], heading [rad, continuous], relative to the newest but for the heading.
            lengths: how many poses each segment has.

        Returns:
            Polynomials for north, east and down; for the heading; and the motion along the heading.
        """
        rows = np.empty((len(times), 9))
        rows[:, 0] = 1.0
        rows[:, 1] = times
        rows[:, 2] = times * times
        rows[:, 3] = rows[:, 2] * times
        rows[:, 4:7] = poses[:, :3]
        along = np.exp(1j * poses[:, 3])
        way = np.zeros(len(times), dtype=complex)
        np.cumsum(0.5 * np.diff(times) * (along[1:] + along[:-1]), out=way[1:])
        rows[:, 7], rows[:, 8] = way.real, way.imag
        gram, whole = self._linear.grams(times, rows, lengths)
        linear = self._linear.polynomials(gram, whole, slice(4, 7))
        body = self._linear.body(gram, whole)
        rows[:, 4] = poses[:, 3] - poses[0, 3]
        gram, whole = self._heading.grams(times, rows[:, :5], lengths)
        heading = self._heading.polynomials(gram, whole, slice(4, 5))
        heading.coefficients[..., 0] += poses[0, 3]
        return linear, heading, body


class _Kind:
    """Prior and noises of one kind of degree of freedom."""

    def __init__(self, *, prior: list[float], sigma: tuple[float, ...], tau: tuple[float, ...], smooth: bool) -> None:
        self._precision = np.array(prior) ** -2.0
        self._log_prior = 0.5 * np.cumsum(np.log(self._precision))
        self._variance = np.square(sigma)[:, None, None]
        self._rate = 1.0 / np.array(tau)[:, None, None]
        self._smooth = smooth
        self._known: tuple[Array, Array, Array] | None = None  # times, the whitening and its log for the last of them

    def grams(self, times: Array, rows: Array, lengths: list[int]) -> tuple[Array, Array]:
        """Give the inner products of the whitened rows (W, NOISES, C, C), and the log of the whitening (W, NOISES)."""
        whitening, logs = self._whitening(times)
        white = whitening @ rows
        flipped = white.swapaxes(-1, -2)
        gram = np.empty((len(lengths), NOISES, rows.shape[1], rows.shape[1]))
        for w, length in enumerate(lengths):
            np.matmul(flipped[..., :length], white[:, :length], out=gram[w])
        return gram, logs[:, np.array(lengths) - 1].T

    def _whitening(self, times: Array) -> tuple[Array, Array]:
        """Give L_n^-1 (NOISES, n, n), and minus log det L_n and m / 2 log 2 pi for each m, (NOISES, n)."""
        known = self._known
        if known is not None and len(known[0]) == len(times) and np.abs(known[0] - times).max() < 1e-6:
            return known[1], known[2]
        lag = self._rate * np.abs(times[:, None] - times)
        shape = np.exp(-lag)
        if self._smooth:
            shape *= 1.0 + lag
        shape.reshape(NOISES, -1)[:, :: len(times) + 1] += _JITTER
        lower = np.linalg.cholesky(self._variance * shape)
        whitening = np.linalg.inv(lower)
        logs = np.cumsum(-np.log(np.diagonal(lower, axis1=1, axis2=2)) - 0.5 * _LOG_2PI, axis=1)
        self._known = (times, whitening, logs)
        return whitening, logs

    def polynomials(self, gram: Array, whole: Array, values: slice) -> PolynomialFits:
        """Fit polynomials to the columns `values`."""
        system = gram[..., :4, :4].copy()
        system[..., range(4), range(4)] += self._precision
        lower = np.linalg.cholesky(system)
        factors = np.linalg.inv(lower)
        projected = (factors @ gram[..., :4, values]).swapaxes(-1, -2)  # (W, NOISES, A, 4) A^-1/2 b
        explained = np.cumsum(np.square(projected), axis=-1)
        constant = np.cumsum(np.log(np.diagonal(factors, axis1=-2, axis2=-1)), axis=-1) + self._log_prior
        squares = np.diagonal(gram, axis1=-2, axis2=-1)[..., values]
        evidence = 0.5 * (explained - squares[..., None]) + (constant + whole[..., None])[..., None, :]
        coefficients = np.cumsum(factors[:, :, None] * projected[..., None], axis=-2)
        return PolynomialFits(evidence=evidence, coefficients=coefficients, factors=factors)

    def body(self, gram: Array, whole: Array) -> BodyFits:
        """Fit the motion along the heading; columns 4, 5 north and east, 7, 8 Z as a complex number."""
        place, speed = self._precision[:2].tolist()
        a, c = gram[..., 0, 0] + place, gram[..., 7, 7] + gram[..., 8, 8] + speed
        b = gram[..., 0, 7] + 1j * gram[..., 0, 8]
        p = gram[..., 0, 4] + 1j * gram[..., 0, 5]
        q = gram[..., 7, 4] + gram[..., 8, 5] + 1j * (gram[..., 7, 5] - gram[..., 8, 4])
        determinant = a * c - (b * b.conj()).real
        at, velocity = (c * p - b * q) / determinant, (a * q - b.conj() * p) / determinant
        explained = (p.conj() * at + q.conj() * velocity).real
        evidence = 0.5 * (explained - gram[..., 4, 4] - gram[..., 5, 5]) - np.log(determinant / (place * speed))
        return BodyFits(evidence=evidence + 2.0 * whole, place=at, velocity=velocity, variance=a / determinant)
