"""The least-squares problem behind the calibration of anchors; its equation stands in `anchor_calibration`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Interval
from scipy.optimize import least_squares

from companion.estimation.anchor_start import AnchorFit, fit_anchor, mirrored
from companion.geometry.arrays import Array, frozen

_GOLDEN = 0.6180339887498949  # multiples of it, modulo one, are spread as evenly as can be
_OUTLIER = 4.0  # standard deviations
_CAUCHY = 2.385  # standard deviations from which a residual counts less and less: 95 % efficient for normal noise
_MIRROR_DOUBT = 8.0  # a mirror image whose cost is higher by less than this, exp(-8) less likely, cannot be excluded


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorCalibrationParameters:
    """What is known before a calibration, and what is asked of its result."""

    range_std: Annotated[float, Gt(0.0)] = 0.02  # [m] of one range: the paper's figure, DWM1000 in sight of each other
    delay_std: Annotated[float, Gt(0.0)] = 0.3  # [m] of a delay before: uncalibrated DW1000 radios are off by so much
    drift_share: Annotated[float, Gt(0.0)] = 0.01  # of the way flown between knots, standard deviation of the drift
    drift_rate: Annotated[float, Gt(0.0)] = 0.001  # [m/s] likewise while it hovers
    knot_interval: Annotated[float, Gt(0.0)] = 8.0  # [s] drift of odometry changes over metres, not over centimetres
    gap_most: Annotated[float, Gt(0.0)] = 0.2  # [s] between odometry samples; ranges in longer gaps are not used
    readings_least: Annotated[int, Ge(10)] = 50  # of an anchor
    readings_most: Annotated[int, Ge(50)] = (
        1500  # of an anchor, evenly chosen: two minutes at 12 Hz; bounds time and memory
    )
    # [m] standard deviation of the flown path along its second and third principal axes: below these the sides of a
    # line and of a plane are told apart by less than ranges scatter
    breadth_least: Annotated[float, Gt(0.0)] = 0.4
    height_least: Annotated[float, Gt(0.0)] = 0.2
    position_std_most: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.1  # [m] of an anchor: worse is no survey


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlownPath:
    """Where the tag's antenna was, by odometry."""

    t: Array  # (N,) [s] rising
    position: Array  # (N, 3) [m]
    covariance: Array  # (3, 3) [m^2] of each position against a smooth path; what drifts is not in it

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen(self.t))
        object.__setattr__(self, "position", frozen(self.position, (self.t.size, 3)))
        object.__setattr__(self, "covariance", frozen(self.covariance, (3, 3)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlownRanges:
    """The ranges of a flight."""

    t: Array  # (M,) [s] when each was taken
    anchor: Array  # (M,) number of its anchor, as a float
    range: Array  # (M,) [m]

    def __post_init__(self) -> None:
        for name in ("t", "anchor", "range"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if not self.t.shape == self.anchor.shape == self.range.shape:
            raise ValueError("times, anchors and ranges must be of one length")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnchorEstimate:
    """One anchor."""

    anchor: int  # its number
    position: Array  # (3,) [m]
    delay: float  # [m] its ranges are too long by this
    covariance: Array  # (4, 4) [m^2] of position and delay
    readings: int  # that were used
    outliers: int  # of them, more than four standard deviations off
    residual_rms: float  # [m] of the others


def anchor_problem(
    path: FlownPath, ranges: FlownRanges, parameters: AnchorCalibrationParameters
) -> tuple[AnchorProblem, int]:
    """Choose the readings, and give the path its knots; with the number of readings without odometry.

    Args:
        path: of the tag's antenna, two samples or more.
        ranges: to all anchors, one or more.
        parameters: what is known before.
    """
    after = np.clip(np.searchsorted(path.t, ranges.t), 1, path.t.size - 1)
    inside = (ranges.t >= path.t[0]) & (ranges.t <= path.t[-1])
    usable = inside & (path.t[after] - path.t[after - 1] <= parameters.gap_most) & np.isfinite(ranges.range)
    numbers = np.unique(ranges.anchor[usable])
    chosen = []
    for number in numbers:
        of_it = np.flatnonzero(usable & (ranges.anchor == number))
        chosen.append(of_it[_thinned(of_it.size, parameters.readings_most)])
    index = np.sort(np.concatenate(chosen)) if chosen else np.zeros(0, dtype=int)
    t = ranges.t[index]
    first, last = (float(t[0]), float(t[-1])) if t.size else (float(path.t[0]), float(path.t[-1]))
    pieces = max(1, round((last - first) / parameters.knot_interval))
    knots = np.linspace(min(first, float(path.t[0])), last, pieces + 1)
    position = np.column_stack([np.interp(t, path.t, path.position[:, axis]) for axis in range(3)])
    flown = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path.position, axis=0), axis=1))])
    way = np.diff(np.interp(knots, path.t, flown))
    problem = AnchorProblem(
        numbers=tuple(int(number) for number in numbers),
        anchor=np.searchsorted(numbers, ranges.anchor[index]),
        t=t,
        range=ranges.range[index],
        position=position,
        jitter=float(np.trace(path.covariance)) / 3.0,
        knots=knots,
        drift_std=parameters.drift_share * way + parameters.drift_rate * np.diff(knots),
        parameters=parameters,
    )
    return problem, int(ranges.t.size - np.count_nonzero(usable))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnchorProblem:
    """Unknowns: position and delay of each anchor, then the drift at all knots but the first."""

    numbers: tuple[int, ...]  # of the anchors
    anchor: Any  # (n,) index into `numbers`
    t: Array  # (n,) [s]
    range: Array  # (n,) [m]
    position: Array  # (n, 3) [m] by odometry
    jitter: float  # [m^2] variance of each position along any direction
    knots: Array  # (K,) [s]
    drift_std: Array  # (K - 1,) [m] between knots
    parameters: AnchorCalibrationParameters

    @property
    def count(self) -> int:
        """How many anchors."""
        return len(self.numbers)

    @property
    def std(self) -> float:
        """Standard deviation [m] of a range against the path."""
        return float(np.sqrt(self.parameters.range_std**2 + self.jitter))

    def starts(self) -> Array:
        """Give position and delay (count, 4) of each anchor, as if nothing drifted."""
        loose = self.std + 0.5 * float(np.sqrt(np.sum(self.drift_std**2)) + np.sum(self.drift_std))
        fits = []
        for index in range(self.count):
            mine = self.anchor == index
            fits.append(fit_anchor(self.position[mine], self.range[mine], loose, self.parameters.delay_std))
        return np.array([[*fit.position, fit.delay] for fit in fits])

    def solve(self, starts: Array) -> Any:
        """Solve, first with a loss that forgives a poor start, then with Cauchy's."""
        unknowns = np.concatenate([starts.ravel(), np.zeros(3 * self.drift_std.size)])
        result = None
        for loss in (_soft, _cauchy):
            result = least_squares(
                self.residuals,
                unknowns if result is None else result.x,
                jac=self.jacobian,
                loss=lambda z, loss=loss: self._robust(z, loss),
                x_scale=1.0,
                xtol=1e-6,
                ftol=1e-6,
                gtol=1e-6,
                max_nfev=60,
            )
        return result

    def residuals(self, unknowns: Array) -> Array:
        """Ranges, delays and drift steps, each in standard deviations."""
        anchors, drift = self._split(unknowns)
        offsets = self.position + self._at_readings(drift) - anchors[self.anchor, :3]
        expected = np.linalg.norm(offsets, axis=1) + anchors[self.anchor, 3]
        steps = np.diff(drift, axis=0) / self.drift_std[:, np.newaxis]
        return np.concatenate(
            [(expected - self.range) / self.std, anchors[:, 3] / self.parameters.delay_std, steps.ravel()]
        )

    def jacobian(self, unknowns: Array) -> Array:
        """Give the derivative of `residuals`."""
        anchors, drift = self._split(unknowns)
        offsets = self.position + self._at_readings(drift) - anchors[self.anchor, :3]
        sight = offsets / np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)[:, np.newaxis] / self.std
        readings, steps, first = self.range.size, 3 * self.drift_std.size, 4 * self.count
        matrix = np.zeros((readings + self.count + steps, first + steps))
        rows = np.arange(readings)
        piece, share = self._pieces()
        for axis in range(3):
            matrix[rows, 4 * self.anchor + axis] = -sight[:, axis]
            matrix[rows, first + 3 * piece + axis] = share * sight[:, axis]
            later = piece > 0
            matrix[rows[later], first + 3 * (piece[later] - 1) + axis] = (1.0 - share[later]) * sight[later, axis]
        matrix[rows, 4 * self.anchor + 3] = 1.0 / self.std
        delays = np.arange(self.count)
        matrix[readings + delays, 4 * delays + 3] = 1.0 / self.parameters.delay_std
        weights = np.repeat(1.0 / self.drift_std, 3)
        below = np.arange(steps)
        matrix[readings + self.count + below, first + below] = weights
        matrix[readings + self.count + below[3:], first + below[:-3]] = -weights[3:]
        return matrix

    def estimates(self, solution: Any) -> tuple[AnchorEstimate, ...]:
        """Read the anchors off a solution."""
        anchors, _ = self._split(solution.x)
        covariance = np.linalg.pinv(solution.jac.T @ solution.jac)
        errors = self.residuals(solution.x)[: self.range.size]
        found = []
        for index, number in enumerate(self.numbers):
            mine = errors[self.anchor == index]
            good = mine[np.abs(mine) <= _OUTLIER]
            block = slice(4 * index, 4 * index + 4)
            found.append(
                AnchorEstimate(
                    anchor=number,
                    position=frozen(anchors[index, :3]),
                    delay=float(anchors[index, 3]),
                    covariance=frozen(covariance[block, block]),
                    readings=mine.size,
                    outliers=mine.size - good.size,
                    residual_rms=self.std * float(np.sqrt(np.mean(good**2))) if good.size else float("inf"),
                )
            )
        return tuple(found)

    def drift_strain(self, drift: Array) -> float:
        """Give the root mean square of the drift's steps, in standard deviations of what odometry is trusted with."""
        return float(np.sqrt(np.mean((np.diff(drift, axis=0) / self.drift_std[:, np.newaxis]) ** 2)))

    def mirror_doubt(self, index: int, found: AnchorEstimate, drift: Array) -> bool:
        """Tell whether an anchor might as well stand behind the plane that the path lies in most nearly."""
        mine = self.anchor == index
        position = (self.position + self._at_readings(drift))[mine]
        here = AnchorFit.of(
            position, self.range[mine], found.position, found.delay, self.std, self.parameters.delay_std
        )
        there = here.refined(mirrored(found.position, position))
        apart = float(np.linalg.norm(there.position - found.position))
        return apart > self.parameters.position_std_most and there.cost - here.cost < _MIRROR_DOUBT

    def _split(self, unknowns: Array) -> tuple[Array, Array]:
        """Give anchors (count, 4) and drift (K, 3)."""
        first = 4 * self.count
        return unknowns[:first].reshape(-1, 4), np.vstack([np.zeros(3), unknowns[first:].reshape(-1, 3)])

    def _pieces(self) -> tuple[Any, Array]:
        """Give the piece between knots in which each reading lies, and how far along it."""
        piece = np.clip(np.searchsorted(self.knots, self.t, side="right") - 1, 0, self.knots.size - 2)
        return piece, (self.t - self.knots[piece]) / (self.knots[piece + 1] - self.knots[piece])

    def _at_readings(self, drift: Array) -> Array:
        piece, share = self._pieces()
        moved: Array = drift[piece] + share[:, np.newaxis] * (drift[piece + 1] - drift[piece])
        return moved

    def _robust(self, squares: Array, loss: Any) -> Array:
        """Apply a loss to the ranges only; priors stay quadratic."""
        readings = self.range.size
        values = np.vstack([squares, np.ones_like(squares), np.zeros_like(squares)])
        values[:, :readings] = loss(squares[:readings])
        return values


def _thinned(count: int, most: int) -> Any:
    """Choose `most` of `count` numbers, spread evenly, but in no step that a radio's round of anchors could follow."""
    return np.argsort((np.arange(count) * _GOLDEN) % 1.0, kind="stable")[:most]


def _soft(squares: Array) -> Array:
    """Give soft L1 of squared residuals, with its first and second derivative (3, n)."""
    root = np.sqrt(1.0 + squares)
    return np.vstack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])


def _cauchy(squares: Array) -> Array:
    """Give Cauchy's loss likewise."""
    scale = _CAUCHY**2
    grown = 1.0 + squares / scale
    return np.vstack([scale * np.log(grown), 1.0 / grown, -1.0 / (scale * grown**2)])
