"""Measures of motion, each a function of one signal or of two flights. Times [s], lengths [m], speeds [m/s]."""

import math

import numpy as np

from sitl_stub.fidelity.flight import Array, Track


def signal_at(t: Array, values: Array, when: Array) -> Array:
    """Interpolate `values`, shape (n,) or (n, k), at the times `when`, shape (m,)."""
    if values.ndim == 1:
        return np.interp(when, t, values)
    return np.stack([np.interp(when, t, column) for column in values.T], axis=1)


def rms_difference(first_t: Array, first: Array, second_t: Array, second: Array) -> float:
    """Root mean square of the difference (its length, for vectors) of two signals, at the first one's times."""
    difference = first - signal_at(second_t, second, first_t)
    square = difference**2 if difference.ndim == 1 else np.sum(difference**2, axis=1)
    return math.sqrt(float(np.mean(square)))


def first_time(t: Array, values: Array, level: float) -> float:
    """Time [s] at which a rising signal first reaches `level`, interpolated; NaN when it never does."""
    above = np.flatnonzero(values >= level)
    if above.size == 0:
        return math.nan
    i = int(above[0])
    if i == 0:
        return float(t[0])
    low, high = values[i - 1], values[i]
    return float(t[i - 1] + (level - low) / (high - low) * (t[i] - t[i - 1]))


def rise_time(t: Array, share: Array) -> float:
    """Time [s] from 10 % to 90 % of a step whose response is `share`, 0 before and 1 at the goal."""
    return first_time(t, share, 0.9) - first_time(t, share, 0.1)


def overshoot(share: Array) -> float:
    """How far a step response goes beyond its goal [% of the step]; 0 when it does not."""
    return 100.0 * max(0.0, float(np.max(share)) - 1.0)


def moving_mean(t: Array, values: Array, window: float) -> Array:
    """Mean of an evenly sampled signal over a centred window [s]; shorter at both ends."""
    count = max(1, round(window * (len(t) - 1) / float(t[-1] - t[0])))
    kernel = np.ones(count)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones_like(values), kernel, "same")


def circle_lag(track: Track, wanted: Track) -> float:
    """By how much a path is behind the wanted one [s]: the shift of time with the smallest distance in phase.

    Both are points on circles about the middle of the wanted path: the phase's mean difference over its mean speed.
    """
    centre = 0.5 * (wanted.position[:, :2].max(axis=0) + wanted.position[:, :2].min(axis=0))
    angle = np.unwrap(_phase(wanted.position, centre))
    at = signal_at(track.t, track.position, wanted.t)
    behind = np.angle(np.exp(1j * (angle - _phase(at, centre))))
    speed = (angle[-1] - angle[0]) / (wanted.t[-1] - wanted.t[0])
    return float(np.mean(behind) / speed)


def circle_radius(track: Track, wanted: Track) -> float:
    """Mean distance [m] of a path from the centre of the wanted circle."""
    centre = 0.5 * (wanted.position[:, :2].max(axis=0) + wanted.position[:, :2].min(axis=0))
    return float(np.mean(np.hypot(*(track.position[:, :2] - centre).T)))


def _phase(position: Array, centre: Array) -> Array:
    phase: Array = np.arctan2(position[:, 1] - centre[1], position[:, 0] - centre[0])
    return phase


def correlation_time(t: Array, values: Array, level: float = math.exp(-1.0)) -> float:
    """Lag [s] at which the autocorrelation of a signal about its mean first falls to `level`; evenly sampled in t."""
    about = values - np.mean(values)
    count = len(about)
    spectrum = np.fft.rfft(about, 2 * count)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:count]
    correlation /= correlation[0]
    below = np.flatnonzero(correlation < level)
    interval = float(t[-1] - t[0]) / (count - 1)
    return float(below[0]) * interval if below.size else float(t[-1] - t[0])
