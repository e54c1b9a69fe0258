"""The rows of a table about the estimator alone: measured on this computer, nothing is flown."""

from __future__ import annotations

from companion.config.docking import load_docking
from companion.errors import InputError
from companion.papers.estimator_cost import STRUCTURES, measure
from companion.papers.rows import Row, measured_row
from companion.papers.spec import Exhibit, PaperCase
from companion.runtime.docking.wiring import proximity_setup


def rows_on_computer(exhibit: Exhibit, case: PaperCase) -> tuple[Row, ...]:
    """Measure the structure that a case is named after, with anchors and target of its mission.

    Raises:
        InputError: the case names no structure or no mission, or the mission is wrong.
    """
    structure = next((name for name in STRUCTURES if name == case.name), None)
    if structure is None or case.mission is None:
        raise InputError.single(
            source=f"{exhibit.label}, {case.name}",
            wrong="a case of the computer is named after a structure of the filter, and has a docking mission",
            right=f"its name is one of {', '.join(STRUCTURES)}; give its mission",
        )
    cost = measure(proximity_setup(load_docking(case.mission, overrides=case.overrides)), structure)
    figures = {
        "operations_flop": float(cost.operations),
        "memory_kb": cost.memory_kb,
        "runtime_ms": 1e-3 * cost.median_us,
    }
    return tuple(measured_row(exhibit, case, name, value) for name, value in figures.items())


def ratio_sentence(rows: tuple[Row, ...]) -> str:
    """Hold the operations of the two structures against each other; empty where one is missing."""
    flop = {row.case: row for row in rows if row.unit == "FLOP"}
    small, large = flop.get("tandem"), flop.get("compounded")
    if small is None or large is None or not small.ours or not large.ours:
        return ""
    published = ""
    if small.published and large.published:
        published = f"; published {small.published / large.published:.3f}"
    return f"operations, tandem / compounded: {small.ours / large.ours:.3f}{published}"
