"""Which measurements are real? The most probable answer, found as by Viterbi.

A measurement shows the target with probability 1 - p; otherwise it is random: anywhere in the camera's view, up to some
range, in any heading. Hypothesis j says that measurement j is the newest real one; its state is that of the filter
after j, by the most probable choice among those before. With w_j its probability (up to a common factor), d the density
of random measurements and N that of a real one, the next measurement z_k makes

    w_k = max_j w_j (1 - p) N(z_k | state j),    w_j <- w_j p d(z_k).

A target may also change its rates suddenly (N is then wider, and such a change has its own probability), and it may be
somewhere else altogether: nothing so far was real. So a track that began with a random measurement, or a target that
jumped, needs no rule of its own. The gate of a track not seen for long cannot take in just anything: the wider N, the
lower it is, until a random measurement explains z_k better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.estimation.target_filter import (
    Comparison,
    FilterState,
    FilterTuning,
    RelativePose,
    begin,
    compare,
    fuse,
    log_peak,
    log_peak_after,
)
from companion.estimation.target_model import SIZE, transition
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.target import MeasurementVerdict

_NEGLIGIBLE = math.log(1e-3)  # [-] logarithm of odds below which a hypothesis is no doubt
_FORGOTTEN = 20.0  # [-] logarithm of odds by which a hypothesis must be less probable than that of a jump


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """The target, if the newest measurement in the state is the newest real one."""

    score: float  # logarithm of the probability, up to a constant common to all
    state: FilterState


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypotheses:
    """What is known after a measurement. Never changed: a step makes a new one."""

    ranked: tuple[Hypothesis, ...]  # at least one, the most probable first, which has the score 0
    believed: FilterState  # of one of them
    nothing: float  # score of: no measurement so far shows the target where it is now


def step(
    known: Hypotheses | None, measured: RelativePose, tuning: FilterTuning
) -> tuple[Hypotheses, MeasurementVerdict]:
    """Take in one measurement, later than all before."""
    parameters = tuning.parameters
    alive: tuple[Hypothesis, ...] = ()
    nothing = 0.0
    if known is not None:
        alive = tuple(h for h in known.ranked if measured.t - h.state.t <= parameters.coast_limit)
        nothing = known.nothing if alive else 0.0
    random = math.log(parameters.outlier_probability) + tuning.outlier_density
    real = math.log1p(-parameters.outlier_probability)
    fresh = _newest(alive, measured, nothing + real + tuning.outlier_density, real, tuning)
    older = [Hypothesis(score=h.score + random, state=h.state) for h in alive]
    ranked = sorted([fresh, *older], key=lambda h: -h.score)
    best, jump = ranked[0], math.log(parameters.jump_probability)
    ranked = [h for h in ranked[: parameters.hypotheses] if h.score - best.score >= jump - _FORGOTTEN]
    believed = best.state
    if known is not None:
        near = best.score - parameters.belief_margin
        believed = next((h.state for h in ranked if h.state is known.believed and h.score >= near), believed)
    after = Hypotheses(
        ranked=tuple(Hypothesis(score=h.score - best.score, state=h.state) for h in ranked),
        believed=believed,
        nothing=max(nothing + random - best.score, jump),
    )
    return after, _verdict(known, believed, measured)


def doubt(known: Hypotheses, mean: Array, t: float, tuning: FilterTuning) -> Array | float:
    """Give what the covariance (12, 12) of the belief must grow by, as others are possible too.

    Equation: the sum over the others of w (x - mean) (x - mean)^T, with w the probability of each and x its state.

    Args:
        known: what is known.
        mean: (12,) the belief at `t`.
        t: [s].
        tuning: the filter's.
    """
    others = [h for h in known.ranked if h.score > _NEGLIGIBLE and h.state is not known.believed]
    if not others:
        return 0.0
    total = sum(math.exp(h.score) for h in known.ranked)
    spread = np.zeros((SIZE, SIZE))
    for other in others:
        away = transition(t - other.state.t, tuning.parameters) @ other.state.mean - mean
        away[3] = wrap_angle(float(away[3]))
        spread += math.exp(other.score) / total * np.outer(away, away)
    return spread


def _verdict(known: Hypotheses | None, believed: FilterState, measured: RelativePose) -> MeasurementVerdict:
    if known is None or believed.began != known.believed.began:
        return MeasurementVerdict.INITIALISED
    return MeasurementVerdict.FUSED if believed.t == measured.t else MeasurementVerdict.REJECTED_GATE


def _newest(
    alive: tuple[Hypothesis, ...], measured: RelativePose, begun: float, real: float, tuning: FilterTuning
) -> Hypothesis:
    """Give the hypothesis that `measured` is real, by its most probable predecessor; `begun`: the score without any."""
    exact = log_peak(measured.covariance)
    score = begun
    found: tuple[FilterState, Comparison] | None = None
    for hypothesis in alive:
        least = score - hypothesis.score - real
        highest = min(exact, log_peak_after(measured.t - hypothesis.state.t, tuning))
        if max(highest, tuning.outlier_density) <= least:
            continue
        comparison, log_likelihood = _likeliest(hypothesis.state, measured, least, tuning)
        if log_likelihood > least:
            score = hypothesis.score + real + log_likelihood
            found = hypothesis.state, comparison
    state = begin(measured, tuning) if found is None else fuse(found[0], measured, found[1], tuning)
    return Hypothesis(score=score, state=state)


def _likeliest(
    state: FilterState, measured: RelativePose, least: float, tuning: FilterTuning
) -> tuple[Comparison, float]:
    """Compare with a target that goes on as it did and, where that is hard to believe, with one that manoeuvres.

    Gives the likelier and its log likelihood, which is of no interest below `least`.
    """
    going_on = compare(state, measured, tuning)
    likelihood = _log_likelihood(going_on, tuning)
    sudden = math.log(tuning.parameters.manoeuvre_probability)
    most = likelihood + 0.5 * going_on.nis + sudden  # that a manoeuvre can reach
    if most <= max(likelihood, least):
        return going_on, likelihood
    manoeuvring = compare(state, measured, tuning, going_on=going_on)
    if manoeuvring.nis > tuning.gate:
        return going_on, -math.inf
    manoeuvre = _log_likelihood(manoeuvring, tuning) + sudden
    return (going_on, likelihood) if likelihood > manoeuvre else (manoeuvring, manoeuvre)


def _log_likelihood(comparison: Comparison, tuning: FilterTuning) -> float:
    """Logarithm of the density [1 / (m^3 rad)] of a real measurement: the target is in the view, or there were none."""
    return max(log_peak(comparison.spread), tuning.outlier_density) - 0.5 * comparison.nis
