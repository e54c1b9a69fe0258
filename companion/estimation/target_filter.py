"""The target's filter, one measurement at a time: pure functions from a state and a measurement to the next state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.estimation.target_model import (
    POSE,
    RATES,
    SIZE,
    TILT,
    TargetEstimatorParameters,
    acceleration_densities,
    add_process_noise,
    expected_measurement,
    height_shortening,
    manoeuvre_densities,
    measurement_jacobian,
    tilt_variances,
    transition,
    wander_densities,
)
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array

_GROUPS = (  # what is measured: the values and rates that it corrects
    (slice(0, 2), (slice(0, 2), slice(4, 6))),
    (slice(2, 3), (slice(2, 8, 4),)),
    (slice(3, 4), (slice(3, 8, 4),)),
)
_LOG_TURN = math.log(2.0 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelativePose:
    """A measurement turned to the odometry's axes, with the vehicle's place in the odometry's frame at its capture."""

    t: float  # [s]
    value: Array  # (4,) target minus vehicle [m], the pad's heading from the odometry's north [rad]
    covariance: Array  # (4, 4)
    origin: Array  # (3,) [m] the vehicle
    axes: Array  # (3, 2) its forward and right axes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WindowEntry:
    """A filtered pose remembered for velocity by differences."""

    t: float  # [s]
    pose: Array  # (4,)
    variance: Array  # (4,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterState:
    """The filter after a measurement. Never changed: a step makes a new one."""

    t: float  # [s] of the newest fused measurement
    mean: Array  # (12,)
    covariance: Array  # (12, 12)
    nis: float  # of the newest fused measurement
    nis_mean: float  # averaged, per degree of freedom
    fused: int  # measurements since the track began
    noise_scale: tuple[float, float, float]  # adaptation of horizontal, vertical, turn
    began: float  # [s] capture of the measurement with which the track began
    window: tuple[WindowEntry, ...]  # sliding window; empty for the augmented model


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterTuning:
    """What is computed once from the parameters."""

    parameters: TargetEstimatorParameters
    acceleration: Array  # (4,)
    wander: Array  # (4,)
    manoeuvre: Array  # (4,) of the random walk in a manoeuvre
    outlier_density: float  # logarithm of that of random measurements [1 / (m^3 rad)]
    gate: float  # squared Mahalanobis distance
    shortening: float  # share of a height that the tilt error takes off, on average,
    shortening_variance: float  # and its variance

    @classmethod
    def of(cls, parameters: TargetEstimatorParameters, gate: float) -> FilterTuning:
        """Build it; `gate` is the chi-square quantile of 4 degrees of freedom."""
        shortening, variance = height_shortening(parameters)
        return cls(
            parameters=parameters,
            acceleration=acceleration_densities(parameters),
            wander=wander_densities(parameters),
            manoeuvre=manoeuvre_densities(parameters),
            outlier_density=-_LOG_TURN - math.log(parameters.outlier_volume),
            gate=gate,
            shortening=shortening,
            shortening_variance=variance,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """A measurement held against what a state leads one to expect of it."""

    mean: Array  # (12,) the state at the capture
    covariance: Array  # (12, 12)
    innovation: Array  # (4,) [m, m, m, rad]
    cross: Array  # (12, 4) covariance of the state with the measurement
    spread: Array  # (4, 4) covariance of the innovation
    nis: float  # squared Mahalanobis distance
    strain: tuple[float, float, float]  # squared innovations of horizontal, vertical, turn, of a target that goes on


def log_peak(spread: Array) -> float:
    """Give the logarithm of the highest density [1 / (m^3 rad)] of a normal distribution with a covariance (4, 4)."""
    return -2.0 * _LOG_TURN - 0.5 * float(np.linalg.slogdet(spread)[1])


def log_peak_after(dt: float, tuning: FilterTuning) -> float:
    """Give a bound of it, of any measurement `dt` [s] after a state, from the process noise alone."""
    grown = tuning.acceleration * (dt * dt * dt / 3.0) + tuning.wander * dt
    return -2.0 * _LOG_TURN - 0.5 * math.log(math.prod(grown.tolist()))


def compare(
    state: FilterState, measured: RelativePose, tuning: FilterTuning, *, going_on: Comparison | None = None
) -> Comparison:
    """Hold a measurement against a state before it.

    Args:
        state: the filter's.
        measured: later than the state.
        tuning: the filter's.
        going_on: a comparison with a target that goes on as it did, which is hard to believe. Given this, the target
            is taken to manoeuvre.
    """
    mean, covariance = predict(state, measured.t, tuning, manoeuvre=going_on is not None)
    innovation = measured.value - expected_measurement(mean, measured.origin, measured.axes)
    innovation[2] -= tuning.shortening * measured.value[2]
    innovation[3] = wrap_angle(float(innovation[3]))
    jacobian = measurement_jacobian(mean, measured.origin, measured.axes)
    cross = covariance @ jacobian.T
    spread = jacobian @ cross + measured.covariance
    return Comparison(
        mean=mean,
        covariance=covariance,
        innovation=innovation,
        cross=cross,
        spread=spread,
        nis=float(innovation @ np.linalg.solve(spread, innovation)),
        strain=_strain(innovation, spread) if going_on is None else going_on.strain,
    )


def fuse(state: FilterState, measured: RelativePose, comparison: Comparison, tuning: FilterTuning) -> FilterState:
    """Correct a state by a measurement. The comparison's arrays are used up."""
    mean, covariance, innovation = comparison.mean, comparison.covariance, comparison.innovation
    cross, spread = comparison.cross, comparison.spread
    gain = cross @ np.linalg.inv(spread) if tuning.parameters.tilt_estimated else _separate_gain(cross, spread)
    mean += gain @ innovation
    reduced = cross @ gain.T
    covariance += gain @ spread @ gain.T - reduced - reduced.T
    covariance += covariance.T.copy()
    covariance *= 0.5
    weight = max(tuning.parameters.nis_averaging, 1.0 / (state.fused + 1.0))
    window = state.window
    if tuning.parameters.velocity_model == "sliding_window":
        window = _slide(window, measured.t, mean, covariance, tuning)
    return FilterState(
        t=measured.t,
        mean=mean,
        covariance=covariance,
        nis=comparison.nis,
        nis_mean=state.nis_mean + weight * (0.25 * comparison.nis - state.nis_mean),
        fused=state.fused + 1,
        noise_scale=_adapted(state.noise_scale, comparison.strain, tuning.parameters),
        began=state.began,
        window=window,
    )


def _separate_gain(cross: Array, spread: Array) -> Array:
    """Give the gain (12, 4): horizontal, height and heading by their own innovations only, tilts not at all.

    The optimal one would see the tilt error in a height or heading that is off by a millimetre or a milliradian, and
    shift the target sideways by 30 times that: more than either is known to. The covariance update holds for any gain.
    """
    gain = np.zeros_like(cross)
    for measured, corrected in _GROUPS:
        inverse = np.linalg.inv(spread[measured, measured])
        for states in corrected:
            gain[states, measured] = cross[states, measured] @ inverse
    return gain


def predict(state: FilterState, t: float, tuning: FilterTuning, *, manoeuvre: bool = False) -> tuple[Array, Array]:
    """Give mean (12,) and covariance (12, 12) at `t` [s], not before the state.

    With a manoeuvre the acceleration is the largest that it may be adapted to, and the random walk the manoeuvre's.
    """
    dt = t - state.t
    parameters = tuning.parameters
    matrix = transition(dt, parameters)
    covariance: Array = matrix @ state.covariance @ matrix.T
    if manoeuvre:
        acceleration = tuning.acceleration * parameters.acceleration_scale_limit
        wander = tuning.manoeuvre
    else:
        horizontal, vertical, turn = state.noise_scale
        scale = np.array([horizontal, horizontal, vertical, turn])
        acceleration = tuning.acceleration * np.minimum(scale, parameters.acceleration_scale_limit)
        wander = tuning.wander * scale
    if state.window:
        # The velocity is a difference over the window: its error lasts as long as the window does.
        span = max(state.window[-1].t - state.window[0].t, 1e-3)
        wander = wander + state.covariance.diagonal()[RATES] * span
    add_process_noise(covariance, dt, acceleration, wander, parameters)
    return matrix @ state.mean, covariance


def begin(measured: RelativePose, tuning: FilterTuning) -> FilterState:
    """Begin a track: pose from the measurement, velocity unknown, tilt error from its prior."""
    parameters = tuning.parameters
    mean = np.zeros(SIZE)
    mean[0:3] = measured.origin + measured.value[0:3]
    mean[2] -= tuning.shortening * measured.value[2]
    mean[3] = measured.value[3]
    tilting = measurement_jacobian(mean, measured.origin, measured.axes)[:, TILT]
    variances = tilt_variances(parameters)
    covariance = np.zeros((SIZE, SIZE))
    covariance[POSE, POSE] = measured.covariance + (tilting * variances) @ tilting.T
    covariance[POSE, TILT] = -tilting * variances
    covariance[TILT, POSE] = covariance[POSE, TILT].T
    covariance[TILT, TILT] = np.diag(variances)
    covariance[4, 4] = covariance[5, 5] = parameters.initial_velocity_horizontal**2
    covariance[6, 6] = parameters.initial_velocity_vertical**2
    covariance[7, 7] = parameters.initial_turn_rate**2
    window: tuple[WindowEntry, ...] = ()
    if parameters.velocity_model == "sliding_window":
        window = (_entry(measured.t, mean, covariance),)
    return FilterState(
        t=measured.t,
        mean=mean,
        covariance=covariance,
        nis=0.0,
        nis_mean=1.0,
        fused=1,
        noise_scale=(1.0, 1.0, 1.0),
        began=measured.t,
        window=window,
    )


def _strain(innovation: Array, spread: Array) -> tuple[float, float, float]:
    """Give the normalised squared innovation of each group: 1 on average where the process noise is right."""
    n, e, d, h = innovation.tolist()
    (snn, sne, _, _), (_, see, _, _), (_, _, sdd, _), (_, _, _, shh) = spread.tolist()
    determinant = snn * see - sne * sne
    return 0.5 * (n * n * see - 2.0 * n * e * sne + e * e * snn) / determinant, d * d / sdd, h * h / shh


def _adapted(
    scale: tuple[float, float, float], strain: tuple[float, float, float], parameters: TargetEstimatorParameters
) -> tuple[float, float, float]:
    """Raise the process noise of a group whose innovations are too large, lower it towards 1 otherwise."""
    if parameters.adaptation_gain == 0.0:
        return scale
    return (
        _scaled(scale[0], strain[0], parameters),
        _scaled(scale[1], strain[1], parameters),
        _scaled(scale[2], strain[2], parameters),
    )


def _scaled(scale: float, normalised: float, parameters: TargetEstimatorParameters) -> float:
    excess = min(normalised, parameters.adaptation_clip) - parameters.adaptation_dead_band
    grown = scale * math.exp(parameters.adaptation_gain * excess)
    return min(max(1.0, grown), parameters.wander_scale_limit)


def _entry(t: float, mean: Array, covariance: Array) -> WindowEntry:
    return WindowEntry(t=t, pose=mean[POSE].copy(), variance=covariance.diagonal()[POSE].copy())


def _slide(
    window: tuple[WindowEntry, ...], t: float, mean: Array, covariance: Array, tuning: FilterTuning
) -> tuple[WindowEntry, ...]:
    """Set the rates to the mean first difference over the window (Patel et al., section 3), in place.

    The poses are in the odometry's frame, so our own motion is already cancelled. The mean of the first differences
    over W steps is the difference of the ends by the time between them.
    """
    newest = _entry(t, mean, covariance)
    window = (*window[-tuning.parameters.window_steps :], newest)
    oldest = window[0]
    span = t - oldest.t
    mean[RATES] = (newest.pose - oldest.pose) / span
    covariance[RATES, :] = 0.0
    covariance[:, RATES] = 0.0
    variance = (newest.variance + oldest.variance) / (span * span) + tuning.acceleration * (span / 3.0)
    covariance.reshape(-1)[np.arange(4, 8) * (SIZE + 1)] = variance
    return window
