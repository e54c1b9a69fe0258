"""Does the covariance of the target's track tell the truth? Normalised estimation error squared over many runs.

At each epoch k (time since the track began) the NEES of run i is e' P^-1 e with the error e of [position in `level`,
heading], 4 numbers. For a consistent estimator the sum over N runs is chi-square with 4 N degrees of freedom, so
the average lies between its 2.5 % and 97.5 % points, divided by N, at 95 % of the epochs (Bar-Shalom, Li,
Kirubarajan: Estimation with Applications to Tracking and Navigation, section 5.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from companion.campaign.truth import TruthSample, sample_from_record
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.recording import Recording

DIMENSION = 4  # [position (3), heading]
EPOCH_S = 0.1  # [s]
CONFIDENCE = 0.95
CLEAR_HEIGHT_M = 1.0  # [m] above the place where it stood: surely in the air


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NeesSeries:
    """One run."""

    epoch: Array  # (n,) number of the epoch since the track began, increasing, as floats
    nees: Array  # (n,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """What many runs say."""

    runs: int
    epochs: int  # those with enough runs
    inside: float  # fraction of the epochs whose average is inside the bounds
    below: float  # fraction below: the covariance is too large
    above: float  # fraction above: the covariance is too small
    mean: float  # average over all runs and epochs, divided by the 4 degrees of freedom: 1 when consistent


def nees_of(recording: Recording, *, target: str | None = None, epoch_s: float = EPOCH_S) -> NeesSeries:
    """Compute the NEES of a flight, from the first track to the first contact with a surface after take-off.

    Args:
        recording: with the channels `truth` and `track`.
        target: name of the target in the truth; None: the first.
        epoch_s: the first track in each of these spans counts [s].
    """
    truth = _truth_arrays(recording, target)
    tracks = [record.data for record in recording.of("track")]
    if truth is None or not tracks:
        return NeesSeries(epoch=np.empty(0), nees=np.empty(0))
    times, relative, heading, end = truth
    start = float(tracks[0]["t"])
    epochs: list[float] = []
    values: list[float] = []
    for track in tracks:
        t = float(track["t"])
        epoch = math.floor((t - start) / epoch_s + 1e-6)
        if (epochs and epoch <= epochs[-1]) or not times[0] <= t <= min(end, times[-1]):
            continue
        error = np.array(track["state"][:DIMENSION])
        error[:3] -= [float(np.interp(t, times, relative[:, axis])) for axis in range(3)]
        error[3] = wrap_angle(float(error[3]) - float(np.interp(t, times, heading)))
        covariance = np.array(track["covariance"])[:DIMENSION, :DIMENSION]
        epochs.append(float(epoch))
        values.append(float(error @ np.linalg.solve(covariance, error)))
    return NeesSeries(epoch=np.array(epochs), nees=np.array(values))


def consistency(series: Sequence[NeesSeries], *, least_runs: int | None = None) -> Consistency:
    """Average over the runs at each epoch and compare with the bounds.

    Args:
        series: one for each run.
        least_runs: epochs with fewer runs are left out; None: half of the runs.
    """
    least = max(1, (len(series) + 1) // 2) if least_runs is None else least_runs
    length = 1 + max((int(run.epoch[-1]) for run in series if run.epoch.size), default=-1)
    total, count = np.zeros(length), np.zeros(length)
    for run in series:
        index = run.epoch.astype(int)
        total[index] += run.nees
        count[index] += 1.0
    used = count >= least
    if not used.any():
        return Consistency(runs=len(series), epochs=0, inside=0.0, below=0.0, above=0.0, mean=math.nan)
    total, count = total[used], count[used]
    tail = 0.5 * (1.0 - CONFIDENCE)
    lower, upper = chi2.ppf(tail, DIMENSION * count), chi2.ppf(1.0 - tail, DIMENSION * count)
    return Consistency(
        runs=len(series),
        epochs=int(used.sum()),
        inside=float(np.mean((total >= lower) & (total <= upper))),
        below=float(np.mean(total < lower)),
        above=float(np.mean(total > upper)),
        mean=float(total.sum() / count.sum() / DIMENSION),
    )


def _truth_arrays(recording: Recording, target: str | None) -> tuple[Array, Array, Array, float] | None:
    """Give times (n,), the true relative position in `level` (n, 3), the relative heading (n,) and the end [s]."""
    samples = [sample_from_record(record.data) for record in recording.of("truth")]
    if not samples:
        return None
    targets = [sample.target(target) for sample in samples]
    times = np.array([sample.t for sample in samples])
    yaw = np.array([sample.yaw for sample in samples])
    offset = np.array([t.position_ned for t in targets]) - np.array([s.position_ned for s in samples])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    relative = np.column_stack(
        (
            cosine * offset[:, 0] + sine * offset[:, 1],
            -sine * offset[:, 0] + cosine * offset[:, 1],
            offset[:, 2],
        )
    )
    heading = np.unwrap(np.array([t.yaw for t in targets]) - yaw)
    return times, relative, heading, _first_contact(samples)


def _first_contact(samples: Sequence[TruthSample]) -> float:
    """Give the time [s] of the first contact of a vehicle that has been surely in the air; infinite without one.

    At lift-off the feet leave the ground one by one and may touch it again: that is no landing.
    """
    flown = False
    for sample in samples:
        if sample.feet_in_contact == 0:
            flown = flown or samples[0].position_ned[2] - sample.position_ned[2] > CLEAR_HEIGHT_M
        elif flown:
            return sample.t
    return math.inf
