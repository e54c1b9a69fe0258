"""The states of the decision process: course, mode, range, misalignment, position uncertainty and vision, in cells."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

from companion.messages.docking import DockingMode, SwitchingSituation

MODES = (DockingMode.APPROACH, DockingMode.REORIENT, DockingMode.ALIGN)  # in which there is something to decide


def _range_edges() -> tuple[float, ...]:
    """Every 5 cm, two decisions' worth of way; the way to learn from is not longer than 2 m."""
    return tuple(round(0.05 * k, 3) for k in range(1, 41))


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionGrid:
    """Edges of the cells, ascending. A situation below the first or from the last edge on is outside of the grid."""

    range: tuple[float, ...] = _range_edges()  # [m]
    # norm of the error quaternion's vector part: turned; a turn's parts, some 30 deg each; not begun
    misalignment: tuple[float, ...] = (0.0, 0.05, 0.45, 0.70, 0.83, 1.01)
    position_std: tuple[float, ...] = (0.0, 0.002, 0.006, 0.010, 0.015, 0.025, 0.50)  # [m]

    def __post_init__(self) -> None:
        for name in ("range", "misalignment", "position_std"):
            edges = getattr(self, name)
            if len(edges) < 2 or any(low >= high for low, high in pairwise(edges)):
                raise ValueError(f"the grid's edges of {name} are {list(edges)}: give two or more, ascending")

    @property
    def shape(self) -> tuple[int, int, int, int, int, int]:
        """Number of courses, modes, ranges, misalignments, position uncertainties, and vision or none.

        Courses: to the docked place, and ahead.
        """
        return 2, len(MODES), len(self.range) - 1, len(self.misalignment) - 1, len(self.position_std) - 1, 2

    @property
    def rows(self) -> int:
        """Number of courses, modes and ranges together."""
        return math.prod(self.shape[:3])

    @property
    def row_length(self) -> int:
        """Number of cells of one course, mode and range."""
        return math.prod(self.shape[3:])

    def cell(self, situation: SwitchingSituation) -> int | None:
        """Give the number of the situation's cell, counted as in a C array of `shape`; None outside of the grid."""
        _, modes, ranges, misalignments, stds, _ = self.shape
        i = bisect_right(self.range, situation.range) - 1
        j = bisect_right(self.misalignment, situation.misalignment) - 1
        k = bisect_right(self.position_std, situation.position_std) - 1
        if situation.mode not in MODES or not (0 <= i < ranges and 0 <= j < misalignments and 0 <= k < stds):
            return None
        leg = int(situation.ahead) * modes + MODES.index(situation.mode)
        return (((leg * ranges + i) * misalignments + j) * stds + k) * 2 + int(situation.vision)
