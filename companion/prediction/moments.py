"""Inner products of whitened rows over the end of a track, for every beginning at once, kept up to date pose by pose.

The values y of a segment are polynomials of time plus a stationary noise n of unit variance, whose covariance over a
lag d is (1 + d / tau) exp(-d / tau) where it is smooth, exp(-d / tau) where it is not, plus a white one of variance
`JITTER`. Both are Markov, in x = (n, tau n') and in n:

    x(t + d) = F(d) x(t) + w,   F = exp(-r) [1 + r, r; -r, 1 - r] with r = d / tau,   cov w = I - F F^T;

so a Kalman filter whitens a column of rows from its beginning on: innovation / sqrt(its variance) is the row of
L_n^-1 that the Cholesky factor would give, whatever the gaps. It is linear: all columns share its gains. A pose adds
one product to each sum, and nothing is gone through again.
"""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array

POWERS = 4  # columns 1, s, s^2, s^3; the values follow
JITTER = 1e-4  # of the variance: measurement noise, and keeps the factorisation sound
_LOG_2PI = math.log(2.0 * math.pi)


class SegmentMoments:
    """Takes values, and gives the inner products of any of the newest segments.

    Args:
        deviation: of the noises (N,).
        time: their correlation times (N,) [s].
        smooth: whether they are.
        values: how many there are at an instant (V).
        capacity: of how many beginnings (B) the sums are kept; older ones are forgotten.
    """

    def __init__(
        self, *, deviation: tuple[float, ...], time: tuple[float, ...], smooth: bool, values: int, capacity: int
    ) -> None:
        self._rates = [1.0 / tau for tau in time]
        self._precision = np.square(deviation)[:, None, None] ** -1.0
        self._scale = np.log(deviation) + 0.5 * _LOG_2PI
        self._smooth = smooth
        noises, columns, states = len(time), POWERS + values, 2 if smooth else 1
        self._gram: Array = np.zeros((columns, columns, noises, capacity))
        self._logs: Array = np.zeros((noises, capacity))  # sum of the logs of the innovations' deviations
        self._mean: Array = np.zeros((noises, states, columns, capacity))  # of x, given the rows so far
        self._covariance: Array = np.zeros((noises, 3 if smooth else 1, capacity))  # its elements 11, 12, 22
        self._product: Array = np.empty((columns, columns, noises * capacity))
        self._rows: Array = np.ones((columns, capacity))
        self._begins: Array = np.zeros(capacity)  # [s]
        self._references: Array = np.zeros((values, capacity))  # values at the beginnings
        self._values: Array = np.zeros(values)
        self._t = 0.0
        self._count = 0

    def reset(self) -> None:
        """Forget everything."""
        self._count = 0

    def add(self, t: float, values: Array) -> None:
        """Take the values (V,) at `t` [s], later than all before."""
        if self._count:
            self._carry(t - self._t)
            self._start(self._count % len(self._begins), t, values)
        else:
            self._start(slice(None), t, values[:, None])
        self._t, self._values = t, values
        self._count += 1
        states, covariance, rows = self._mean.shape[1], self._covariance, self._rows
        np.subtract(t, self._begins, out=rows[1])
        np.multiply(rows[1], rows[1], out=rows[2])
        np.multiply(rows[2], rows[1], out=rows[3])
        np.subtract(values[:, None], self._references, out=rows[POWERS:])
        spread = covariance[:, 0] + JITTER
        innovation = rows - self._mean[:, 0]
        weighted = innovation / spread[:, None]
        by_column = (each.transpose(1, 0, 2).reshape(len(rows), -1) for each in (innovation, weighted))
        np.multiply(next(by_column)[:, None], next(by_column), out=self._product)
        self._gram += self._product.reshape(self._gram.shape)
        self._logs -= 0.5 * np.log(spread)
        self._mean += covariance[:, :states, None] * weighted[:, None]
        if self._smooth:
            covariance[:, 2] -= covariance[:, 1] * covariance[:, 1] / spread
        covariance[:, :states] *= (JITTER / spread)[:, None]

    def transform(self, matrix: Array, shift: Array) -> None:
        """Replace all values y by `matrix` (V, V) y + `shift` (V,)."""
        self._values = matrix @ self._values + shift
        self._references = matrix @ self._references + shift[:, None]
        turn = np.eye(len(self._rows))
        turn[POWERS:, POWERS:] = matrix
        self._gram = np.einsum("ij,jknb,lk->ilnb", turn, self._gram, turn)
        self._mean = np.einsum("ij,nsjb->nsib", turn, self._mean)

    def segments(self, lengths: list[int]) -> tuple[Array, Array]:
        """Give the sums over the newest poses, as many as `lengths` (W) say, at most the capacity.

        Returns:
            Inner products (W, N, 4 + V, 4 + V) of the whitened columns 1, u, u^2, u^3 and values, with u = t_i - now
            and values less their newest; and minus log det L_n and m / 2 log 2 pi for each (W, N).
        """
        slots = np.array([(self._count - length) % len(self._begins) for length in lengths])
        gram = self._gram[..., slots].transpose(3, 2, 0, 1)
        columns = gram.shape[-1]
        back = self._begins[slots] - self._t
        to_now = np.zeros((len(lengths), 1, columns, columns))
        to_now.reshape(len(lengths), -1)[:, :: columns + 1] = 1.0
        to_now[:, 0, 1, 0] = back
        to_now[:, 0, 2, 0] = square = back * back
        to_now[:, 0, 2, 1] = 2.0 * back
        to_now[:, 0, 3, 0] = square * back
        to_now[:, 0, 3, 1] = 3.0 * square
        to_now[:, 0, 3, 2] = 3.0 * back
        to_now[:, 0, POWERS:, 0] = (self._references[:, slots] - self._values[:, None]).T
        products = to_now @ gram @ to_now.swapaxes(-1, -2)
        products *= self._precision
        return products, self._logs[:, slots].T - np.array(lengths)[:, None] * self._scale

    def _start(self, slot: int | slice, t: float, values: Array) -> None:
        """Begin segments that know nothing yet."""
        self._gram[..., slot] = 0.0
        self._logs[:, slot] = 0.0
        self._mean[..., slot] = 0.0
        self._covariance[..., slot] = 1.0
        self._covariance[:, 1:2, slot] = 0.0
        self._begins[slot] = t
        self._references[:, slot] = values

    def _carry(self, elapsed: float) -> None:
        """Let time pass [s]: the noises return to zero."""
        steps = [_smooth_step(rate * elapsed) if self._smooth else _rough_step(rate * elapsed) for rate in self._rates]
        state = np.array([step[0] for step in steps])
        covariance = np.array([step[1] for step in steps])
        new = np.array([step[2] for step in steps])
        mean = self._mean
        self._mean = (state @ mean.reshape(len(steps), mean.shape[1], -1)).reshape(mean.shape)
        self._covariance = covariance @ self._covariance
        self._covariance += new[:, :, None]


_Rows = tuple[tuple[float, ...], ...]


def _smooth_step(r: float) -> tuple[_Rows, _Rows, tuple[float, ...]]:
    """Give F (2, 2), what F P F^T makes of the elements 11, 12, 22 of P (3, 3), and these elements of I - F F^T."""
    fade = math.exp(-r)
    a, b, d = fade * (1.0 + r), fade * r, fade * (1.0 - r)
    transition = ((a, b), (-b, d))
    elements = ((a * a, 2.0 * a * b, b * b), (-a * b, a * d - b * b, b * d), (b * b, -2.0 * b * d, d * d))
    return transition, elements, (1.0 - a * a - b * b, a * b - b * d, 1.0 - b * b - d * d)


def _rough_step(r: float) -> tuple[_Rows, _Rows, tuple[float, ...]]:
    """Give the same for the noise that is not smooth."""
    fade = math.exp(-r)
    return ((fade,),), ((fade * fade,),), (1.0 - fade * fade,)
