"""The solved decisions as a small table of plain text, with what it was made from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from companion.guidance.decision_process.approach_log import Action, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.guidance.decision_process.model import LearningParameters, TransitionModel, learn
from companion.guidance.decision_process.solve import (
    CostWeights,
    Expectation,
    expectation,
    pair_costs,
    value_iteration,
)

CAREFULNESS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # lambdas solved for
LETTERS = {Action.KEEP: "k", Action.SWITCH: "s", Action.SWITCH_NEAR: "n", Action.AHEAD: "a"}
UNKNOWN = "."


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What a table was made from."""

    commit: str  # of the program that flew
    seeds: tuple[int, ...]  # of the flights
    approaches: int  # number of flights
    docked: int  # of them
    world: str = ""  # of the simulation that they were flown in
    learning: LearningParameters
    weights: CostWeights


@dataclass(frozen=True, slots=True, kw_only=True)
class Decisions:
    """The decisions of one lambda."""

    carefulness: float  # lambda: cost of a miss
    expected: Expectation  # of these decisions, by the model
    residual: float  # of value iteration [costs]
    # one row for each course, mode and range, one letter for each misalignment, uncertainty and vision: k keep,
    # s switch, n switch and align near, a keep and aim ahead, . never seen
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchingTable:
    """When to switch, by cell of the grid, for several degrees of carefulness."""

    format: Literal[2] = 2
    provenance: Provenance
    grid: DecisionGrid = field(default_factory=DecisionGrid)
    policies: tuple[Decisions, ...]  # ascending carefulness

    def __post_init__(self) -> None:
        """Refuse a table that does not fit its grid."""
        rows, length = self.grid.rows, self.grid.row_length
        if not self.policies:
            raise ValueError("the table holds no policies: it must have one for at least one carefulness")
        for policy in self.policies:
            if len(policy.rows) != rows or any(len(row) != length for row in policy.rows):
                raise ValueError(
                    f"the rows of carefulness {policy.carefulness:g} do not fit the grid: "
                    f"it needs {rows} rows of {length} letters"
                )
            if set("".join(policy.rows)) - {*LETTERS.values(), UNKNOWN}:
                raise ValueError(
                    f"the rows of carefulness {policy.carefulness:g} hold other letters than "
                    f"k (keep), s (switch), n (switch and align near), a (aim ahead) and {UNKNOWN} (never seen)"
                )

    def nearest(self, carefulness: float) -> Decisions:
        """Give the decisions of the nearest lambda, by ratio.

        Raises:
            ValueError: `carefulness` is not positive.
        """
        if not carefulness > 0.0:
            raise ValueError(f"carefulness is {carefulness:g}: it must be greater than 0")
        return min(self.policies, key=lambda policy: abs(math.log(policy.carefulness / carefulness)))


def solve_table(
    approaches: Sequence[LoggedApproach],
    *,
    commit: str,
    grid: DecisionGrid,
    learning: LearningParameters,
    weights: CostWeights,
    carefulness: Sequence[float] = CAREFULNESS,
    world: str = "",
) -> SwitchingTable:
    """Learn the model once and solve it for each carefulness.

    Raises:
        ValueError: there is nothing to learn from, or a carefulness is not positive.
    """
    if any(value <= 0.0 for value in carefulness):
        raise ValueError(f"carefulness is {list(carefulness)}: every one must be greater than 0")
    model = learn(approaches, grid, learning)
    return SwitchingTable(
        provenance=Provenance(
            commit=commit,
            seeds=tuple(approach.seed for approach in approaches),
            approaches=len(approaches),
            docked=sum(approach.docked for approach in approaches),
            world=world,
            learning=learning,
            weights=weights,
        ),
        grid=grid,
        policies=tuple(_decisions(model, grid, weights, value) for value in sorted(carefulness)),
    )


def _decisions(model: TransitionModel, grid: DecisionGrid, weights: CostWeights, carefulness: float) -> Decisions:
    solution = value_iteration(model, pair_costs(model, weights, carefulness))
    letters = [UNKNOWN] * math.prod(grid.shape)
    for cell, pair in zip(model.states, solution.choice.tolist(), strict=True):
        letters[cell] = LETTERS[Action(int(model.pair_action[pair]))]
    text, length = "".join(letters), grid.row_length
    rows = tuple(text[start : start + length] for start in range(0, len(text), length))
    return Decisions(
        carefulness=carefulness,
        expected=expectation(model, solution.choice),
        residual=float(f"{solution.residual:.1e}"),
        rows=rows,
    )
