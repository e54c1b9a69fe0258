"""One step of the target's filter: a pure function from a state and a measurement to the next state."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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
    measurement_jacobian,
    tilt_variances,
    transition,
    wander_densities,
)
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.target import MeasurementVerdict

_GROUPS = (  # what is measured: the values and rates that it corrects
    (slice(0, 2), (slice(0, 2), slice(4, 6))),
    (slice(2, 3), (slice(2, 8, 4),)),
    (slice(3, 4), (slice(3, 8, 4),)),
)
_PENDING = 20  # rejected measurements remembered


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
    # measurements rejected since the last that was fused, and how many up to each agree one after the other
    pending: tuple[tuple[RelativePose, int], ...]
    window: tuple[WindowEntry, ...]  # sliding window; empty for the augmented model


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterTuning:
    """What is computed once from the parameters."""

    parameters: TargetEstimatorParameters
    acceleration: Array  # (4,)
    wander: Array  # (4,)
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
            gate=gate,
            shortening=shortening,
            shortening_variance=variance,
        )


def step(
    state: FilterState | None, measured: RelativePose, tuning: FilterTuning
) -> tuple[FilterState, MeasurementVerdict]:
    """Fuse one measurement, begin a track with it, or reject it."""
    if state is None or measured.t - state.t > tuning.parameters.coast_limit:
        return begin(measured, tuning), MeasurementVerdict.INITIALISED
    mean, covariance = predict(state, measured.t, tuning)
    innovation = measured.value - expected_measurement(mean, measured.origin, measured.axes)
    innovation[2] -= tuning.shortening * measured.value[2]
    innovation[3] = wrap_angle(float(innovation[3]))
    jacobian = measurement_jacobian(mean, measured.origin, measured.axes)
    cross = covariance @ jacobian.T
    spread = jacobian @ cross + measured.covariance
    nis = float(innovation @ np.linalg.solve(spread, innovation))
    if not nis <= tuning.gate:
        return _reject(state, measured, innovation, spread, tuning)
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
    return (
        FilterState(
            t=measured.t,
            mean=mean,
            covariance=covariance,
            nis=nis,
            nis_mean=state.nis_mean + weight * (0.25 * nis - state.nis_mean),
            fused=state.fused + 1,
            noise_scale=_adapted(state.noise_scale, innovation, spread, tuning.parameters),
            pending=(),
            window=window,
        ),
        MeasurementVerdict.FUSED,
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


def predict(state: FilterState, t: float, tuning: FilterTuning) -> tuple[Array, Array]:
    """Give mean (12,) and covariance (12, 12) at `t` [s], not before the state."""
    dt = t - state.t
    parameters = tuning.parameters
    matrix = transition(dt, parameters)
    covariance: Array = matrix @ state.covariance @ matrix.T
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
        pending=(),
        window=window,
    )


def _adapted(
    scale: tuple[float, float, float], innovation: Array, spread: Array, parameters: TargetEstimatorParameters
) -> tuple[float, float, float]:
    """Raise the process noise of a group whose innovations are too large, lower it towards 1 otherwise."""
    if parameters.adaptation_gain == 0.0:
        return scale
    n, e, d, h = innovation.tolist()
    (snn, sne, _, _), (_, see, _, _), (_, _, sdd, _), (_, _, _, shh) = spread.tolist()
    determinant = snn * see - sne * sne
    horizontal = 0.5 * (n * n * see - 2.0 * n * e * sne + e * e * snn) / determinant
    return (
        _scaled(scale[0], horizontal, parameters),
        _scaled(scale[1], d * d / sdd, parameters),
        _scaled(scale[2], h * h / shh, parameters),
    )


def _scaled(scale: float, normalised: float, parameters: TargetEstimatorParameters) -> float:
    excess = min(normalised, parameters.adaptation_clip) - parameters.adaptation_dead_band
    grown = scale * math.exp(parameters.adaptation_gain * excess)
    return min(max(1.0, grown), parameters.wander_scale_limit)


def _reject(
    state: FilterState, measured: RelativePose, innovation: Array, spread: Array, tuning: FilterTuning
) -> tuple[FilterState, MeasurementVerdict]:
    """Remember a rejected measurement.

    One alone is an outlier. Two or more that agree with each other mean that the target manoeuvres: the process noise
    rises. Enough of them begin the track anew. Others may lie between them: random ones do not agree, neither with the
    track nor with each other.
    """
    parameters = tuning.parameters
    kept = [
        (earlier, length) for earlier, length in state.pending if measured.t - earlier.t <= parameters.restart_window
    ][-_PENDING:]
    chain = 1
    for earlier, length in sorted(kept, key=lambda item: -item[1]):
        if length < chain:
            break
        if _agree(earlier, measured, tuning):
            chain = length + 1
    if chain >= parameters.restart_after:
        return begin(measured, tuning), MeasurementVerdict.INITIALISED
    scale = state.noise_scale
    if chain > 1:
        scale = _adapted(scale, innovation, spread, parameters)
    rejected = replace(state, pending=(*kept, (measured, chain)), noise_scale=scale)
    return rejected, MeasurementVerdict.REJECTED_GATE


def _agree(earlier: RelativePose, later: RelativePose, tuning: FilterTuning) -> bool:
    """Tell whether a target could have moved from one to the other."""
    difference = later.value - earlier.value
    difference[0:3] += later.origin - earlier.origin
    difference[3] = wrap_angle(float(difference[3]))
    dt = later.t - earlier.t
    motion = (tuning.parameters.restart_speed * dt / 3.0) ** 2  # the most it does is three deviations
    turn = (tuning.parameters.restart_turn_rate * dt / 3.0) ** 2
    spread = earlier.covariance + later.covariance + np.diag([motion, motion, motion, turn])
    return float(difference @ np.linalg.solve(spread, difference)) <= tuning.gate


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
