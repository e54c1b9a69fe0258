"""Switch by a table that was solved beforehand."""

from __future__ import annotations

from dataclasses import replace

from companion.guidance.decision_process.approach_log import Action
from companion.guidance.decision_process.table import LETTERS, UNKNOWN, SwitchingTable
from companion.guidance.docking.policies import FixedDistances
from companion.messages.docking import SwitchingSituation, SwitchingVerdict

_WORDS = {
    LETTERS[Action.KEEP]: "keep",
    LETTERS[Action.SWITCH]: "switch",
    LETTERS[Action.SWITCH_NEAR]: "switch, align near",
    LETTERS[Action.AHEAD]: "keep, aim ahead",
}
_LEAVING = (LETTERS[Action.SWITCH], LETTERS[Action.SWITCH_NEAR])


class OptimalSwitching:
    """Looks the decision up in the table's cell; fixed distances answer where the table knows nothing."""

    def __init__(self, table: SwitchingTable, *, carefulness: float, fallback: FixedDistances | None = None) -> None:
        """Choose the table's policy.

        Args:
            table: the solved decisions.
            carefulness: lambda; the table's nearest is taken (`carefulness` says which).
            fallback: distances for situations never seen when the table was made; the paper's unless given.

        Raises:
            ValueError: `carefulness` is not positive.
        """
        chosen = table.nearest(carefulness)
        self.carefulness = chosen.carefulness
        self._grid = table.grid
        self._letters = "".join(chosen.rows)
        self._fallback = fallback or FixedDistances()

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        """Look the situation's cell up."""
        cell = self._grid.cell(situation)
        letter = UNKNOWN if cell is None else self._letters[cell]
        if letter == UNKNOWN:
            why = "outside of the table" if cell is None else "never seen when the table was made"
            verdict = self._fallback.decide(situation)
            return replace(verdict, reason=f"{why}, so by fixed distances: {verdict.reason}", fallback=True)
        return SwitchingVerdict(
            switch=letter in _LEAVING,
            ahead=letter == LETTERS[Action.AHEAD],
            near=letter == LETTERS[Action.SWITCH_NEAR],
            reason=(
                f"table, carefulness {self.carefulness:g}: {_WORDS[letter]} at range "
                f"{situation.range:.3f} m, misalignment {situation.misalignment:.2f}, position known to "
                f"{1000.0 * situation.position_std:.1f} mm, vision {'there' if situation.vision else 'missing'}"
            ),
        )
