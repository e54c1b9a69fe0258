"""Solve a shortest-path problem: the choice of actions that costs least until the end.

    V(s) = min over a of  c(s, a) + sum over s' of P(s' | s, a) V(s')
    c    = time / T0 + w impulse / J0 + u E(inaccuracy | s, a) + lambda P(miss | s, a)

The inaccuracy of a contact is (position error / allowed)^2 + (attitude error / allowed)^2: what is bought by it is
distance from a miss, also where no flight has missed yet (P(error > allowed) <= E(error^2) / allowed^2, Chebyshev).

Undiscounted: every cost is positive, and from every state some choice leads to an end, so that value iteration from 0
rises to the one solution, and no choice that never ends is optimal (Bertsekas, Dynamic Programming and Optimal
Control, vol. II, ch. 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from companion.geometry.arrays import Array
from companion.guidance.decision_process.model import Index, TransitionModel

_TIE = 1e-9  # [costs] a pair must be better by more than this to be chosen before an earlier one


@dataclass(frozen=True, slots=True, kw_only=True)
class CostWeights:
    """What time, impulse and inaccuracy are measured by; a miss costs lambda times a docking by fixed distances."""

    time_scale: Annotated[float, Gt(0.0)] = 140.0  # [s] T0: a docking by fixed distances (Parikh et al., table II)
    impulse_scale: Annotated[float, Gt(0.0)] = 1.0  # [N s] J0: set it to the same flights' mean
    impulse_weight: Annotated[float, Ge(0.0)] = (
        1.5  # w: gas that is spent is gone, and ends the mission; time only passes
    )
    # u: a contact at the edge of what counts as docked costs three dockings. A usual one, at a fifth of it, 0.12: 17 s
    inaccuracy_weight: Annotated[float, Ge(0.0)] = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The best choice and what it costs."""

    values: Array  # (n,) cost until the end from each state
    choice: Index  # (n,) pair chosen in each state
    residual: float  # largest change of a value by one more iteration
    iterations: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """What the model expects of a choice, from where approaches begin."""

    time: float  # [s] until the end
    impulse: float  # [N s]
    miss: float  # probability
    inaccuracy: float  # of the contact, see `LoggedApproach`


def pair_costs(model: TransitionModel, weights: CostWeights, carefulness: float) -> Array:
    """Give the cost (K,) of each pair; `carefulness` is lambda."""
    costs: Array = (
        model.time / weights.time_scale
        + weights.impulse_weight * model.impulse / weights.impulse_scale
        + weights.inaccuracy_weight * model.inaccuracy
        + carefulness * model.missed
    )
    return costs


def value_iteration(
    model: TransitionModel, costs: Array, *, tolerance: float = 1e-11, most_iterations: int = 100_000
) -> Solution:
    """Iterate from 0 until no value changes by more than `tolerance`, relative to the largest value.

    Args:
        model: states and transitions.
        costs: (K,) of the pairs, none negative.
        tolerance: dimensionless.
        most_iterations: more are taken for a problem without end.

    Raises:
        ValueError: it does not converge, since some state has no way to an end.
    """
    values: Array = np.zeros(len(model.states))
    first = _first_pairs(model)
    for iteration in range(1, most_iterations + 1):
        updated: Array = np.minimum.reduceat(_pair_values(model, costs, values), first)
        residual = float(np.max(np.abs(updated - values)))
        values = updated
        if residual <= tolerance * max(1.0, float(np.max(values))):
            choice = _best_pairs(model, _pair_values(model, costs, values))
            return Solution(values=values, choice=choice, residual=residual, iterations=iteration)
    raise ValueError(f"no convergence in {most_iterations} iterations: from some state no choice leads to an end")


def policy_iteration(model: TransitionModel, costs: Array) -> Solution:
    """Solve the same problem by evaluating a choice and improving it, until it stays: a check of the other.

    Raises:
        ValueError: some state has no way to an end.
    """
    choice = _proper_choice(model)
    for iteration in range(1, len(costs) * len(model.states) + 2):
        values = evaluated(model, choice, costs)
        pair_values = _pair_values(model, costs, values)
        best = _best_pairs(model, pair_values)
        better = pair_values[best] < pair_values[choice] - _TIE
        if not better.any():
            residual = float(np.max(np.abs(pair_values[best] - values)))
            return Solution(values=values, choice=best, residual=residual, iterations=iteration)
        choice = np.where(better, best, choice)
    raise ValueError("policy iteration does not end: costs must be finite numbers")


def evaluated(model: TransitionModel, choice: Index, per_pair: Array) -> Array:
    """Give the expected sum (n,) of something per pair until the end, under a choice."""
    n = len(model.states)
    moves = np.zeros((n, n))
    position = np.full(len(model.pair_state), -1)
    position[choice] = np.arange(n)
    chosen = position[model.row] >= 0
    np.add.at(moves, (position[model.row[chosen]], model.column[chosen]), model.probability[chosen])
    return np.asarray(np.linalg.solve(np.eye(n) - moves, per_pair[choice]), dtype=np.float64)


def expectation(model: TransitionModel, choice: Index) -> Expectation:
    """Give what the model expects of a choice, to six decimals: farther ones depend on the computer."""
    parts = (model.time, model.impulse, model.missed, model.inaccuracy)
    time, impulse, miss, inaccuracy = (round(float(model.start @ evaluated(model, choice, part)), 6) for part in parts)
    return Expectation(time=time, impulse=impulse, miss=miss, inaccuracy=inaccuracy)


def _pair_values(model: TransitionModel, costs: Array, values: Array) -> Array:
    following = np.bincount(model.row, weights=model.probability * values[model.column], minlength=len(costs))
    result: Array = costs + following
    return result


def _first_pairs(model: TransitionModel) -> Index:
    return np.searchsorted(model.pair_state, np.arange(len(model.states)))


def _best_pairs(model: TransitionModel, pair_values: Array) -> Index:
    """Give each state's best pair; the earlier one (keep) where they tie."""
    first = _first_pairs(model)
    best = first.copy()
    for pair, state in enumerate(model.pair_state.tolist()):
        if pair_values[pair] < pair_values[best[state]] - _TIE:
            best[state] = pair
    return best


def _proper_choice(model: TransitionModel) -> Index:
    """Choose for each state a pair that leads nearer to an end with some probability."""
    choice = np.full(len(model.states), -1)
    ends = model.docked + model.missed > 0.0
    while True:
        reached = choice >= 0
        leads = ends.copy()
        np.logical_or.at(leads, model.row, reached[model.column])
        new = leads & ~reached[model.pair_state]
        if not new.any():
            break
        for pair in np.flatnonzero(new).tolist():
            choice[model.pair_state[pair]] = pair
    if (choice < 0).any():
        raise ValueError("from some state no choice leads to an end")
    return choice
