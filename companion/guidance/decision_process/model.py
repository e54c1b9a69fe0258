"""The transition model: what follows a decision, counted from logged approaches.

For each cell s and action a that was seen, N(s, a, .) counts the next cells and the two ends:

    P(s' | s, a) = N(s, a, s') / n(s, a)                     among visited cells; an action never seen is no choice
    P(miss | s, a, end) = (misses + w m) / (ends + w)        so that few flights do not look certain

with w the prior's weight and m the share of misses among the ends after the same action in the same mode at nearby
ranges (weights exp(-(range cells apart)^2 / 2 k^2)), itself held off 0 and 1 by half a miss and half a docking
(Jeffreys). Times, impulses and inaccuracies are the cell's own means: they scatter little, and differ much from cell
to cell.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from companion.geometry.arrays import Array
from companion.guidance.decision_process.approach_log import Action, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningParameters:
    """How few samples are treated."""

    prior_weight: Annotated[float, Ge(0.0)] = 2.0  # ends that the neighbours' share counts for
    neighbour_cells: Annotated[float, Gt(0.0)] = 2.0  # k: they fade out over so many cells of range
    least_visits: Annotated[int, Gt(0)] = 6  # an action seen less often in a cell is chosen only for want of another


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransitionModel:
    """A shortest-path problem over visited states: pairs of state and action, sorted by state, then by action."""

    states: tuple[int, ...]  # cells of the grid, ascending
    pair_state: Index  # (K,) position in `states`
    pair_action: Index  # (K,) `Action`
    visits: Index  # (K,)
    time: Array  # (K,) [s] mean to the next epoch
    impulse: Array  # (K,) [N s]
    missed: Array  # (K,) probability that the next thing is the end, a miss
    docked: Array  # (K,) likewise, docked
    inaccuracy: Array  # (K,) mean that the contact adds, where it is the next thing
    row: Index  # (M,) pair
    column: Index  # (M,) next state, as a position in `states`
    probability: Array  # (M,)
    start: Array  # (n,) share of the approaches that begin in each state


@dataclass(slots=True)
class _Counts:
    """Sums over the epochs of one pair."""

    cell: int
    action: int
    visits: int = 0
    time: float = 0.0
    impulse: float = 0.0
    missed: int = 0
    docked: int = 0
    inaccuracy: float = 0.0
    following: dict[int, int] | None = None


def learn(approaches: Iterable[LoggedApproach], grid: DecisionGrid, parameters: LearningParameters) -> TransitionModel:
    """Count, smooth, and leave out what was seen too rarely.

    Epochs outside of the grid are passed over; their costs count for the one before.

    Raises:
        ValueError: no approach holds an epoch inside the grid.
    """
    counts: dict[tuple[int, int], _Counts] = {}
    first: dict[int, int] = {}
    for approach in approaches:
        _count(approach, grid, counts, first)
    if not counts:
        raise ValueError("no approach has a decision inside the grid: log some, or widen the grid's edges")
    kept = _choosable([counts[key] for key in sorted(counts)], parameters.least_visits)
    return _model(kept, first, grid, parameters)


def _count(
    approach: LoggedApproach, grid: DecisionGrid, counts: dict[tuple[int, int], _Counts], first: dict[int, int]
) -> None:
    """Add one approach to the sums."""
    last: _Counts | None = None
    for epoch in approach.epochs:
        cell = grid.cell(epoch.situation)
        if cell is not None:
            if last is None:
                first[cell] = first.get(cell, 0) + 1
            else:
                following = last.following if last.following is not None else {}
                following[cell] = following.get(cell, 0) + 1
                last.following = following
            last = counts.setdefault((cell, int(epoch.action)), _Counts(cell, int(epoch.action)))
            last.visits += 1
        if last is not None:
            last.time += epoch.elapsed
            last.impulse += epoch.impulse
    if last is not None:
        last.docked += int(approach.docked)
        last.missed += int(not approach.docked)
        last.inaccuracy += approach.inaccuracy


def _choosable(pairs: list[_Counts], least_visits: int) -> list[_Counts]:
    """Leave out pairs seen too rarely, unless a state would be left from which no end is reached."""
    kept = {(p.cell, p.action) for p in pairs if p.visits >= least_visits}
    while True:
        ending = _reaching_an_end([p for p in pairs if (p.cell, p.action) in kept])
        again = {(p.cell, p.action) for p in pairs if p.cell not in ending} - kept
        if not again:
            return [p for p in pairs if (p.cell, p.action) in kept]
        kept |= again


def _reaching_an_end(pairs: list[_Counts]) -> set[int]:
    """Give the cells from which some choice of pairs leads to an end with some probability."""
    ending: set[int] = set()
    while True:
        more = {
            p.cell
            for p in pairs
            if p.cell not in ending and (p.docked or p.missed or any(c in ending for c in p.following or {}))
        }
        if not more:
            return ending
        ending |= more


def _model(
    pairs: list[_Counts], first: dict[int, int], grid: DecisionGrid, parameters: LearningParameters
) -> TransitionModel:
    states = tuple(sorted({p.cell for p in pairs}))
    place = {cell: k for k, cell in enumerate(states)}
    visits = np.array([p.visits for p in pairs], dtype=np.int64)
    ends = np.array([p.docked + p.missed for p in pairs], dtype=np.float64)
    miss_share = _miss_share(pairs, grid, parameters)
    arcs = [(k, place[cell], count) for k, p in enumerate(pairs) for cell, count in sorted((p.following or {}).items())]
    start = np.zeros(len(states))
    for cell, count in first.items():
        start[place[cell]] = count
    return TransitionModel(
        states=states,
        pair_state=np.array([place[p.cell] for p in pairs], dtype=np.int64),
        pair_action=np.array([p.action for p in pairs], dtype=np.int64),
        visits=visits,
        time=np.array([p.time for p in pairs]) / visits,
        impulse=np.array([p.impulse for p in pairs]) / visits,
        missed=miss_share * ends / visits,
        docked=(1.0 - miss_share) * ends / visits,
        inaccuracy=np.array([p.inaccuracy for p in pairs]) / visits,
        row=np.array([arc[0] for arc in arcs], dtype=np.int64),
        column=np.array([arc[1] for arc in arcs], dtype=np.int64),
        probability=np.array([arc[2] / visits[arc[0]] for arc in arcs]),
        start=start / start.sum(),
    )


def _miss_share(pairs: list[_Counts], grid: DecisionGrid, parameters: LearningParameters) -> Array:
    """Give the share of misses (K,) among each pair's ends, drawn to that at nearby ranges."""
    cells = np.array([p.cell for p in pairs])
    per_mode = grid.row_length * grid.shape[2]
    group = len(Action) * (cells // per_mode) + np.array([p.action for p in pairs])
    ranges = cells % per_mode // grid.row_length
    missed = np.array([p.missed for p in pairs], dtype=np.float64)
    ends = missed + np.array([p.docked for p in pairs], dtype=np.float64)
    apart = (ranges[:, None] - ranges[None, :]) / parameters.neighbour_cells
    near = np.exp(-0.5 * apart**2) * (group[:, None] == group[None, :])
    neighbours = (near @ missed + 0.5) / (near @ ends + 1.0)
    w = parameters.prior_weight
    share: Array = (missed + w * neighbours) / np.maximum(ends + w, 1e-12)
    return share
