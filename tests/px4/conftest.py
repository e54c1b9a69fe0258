"""Prints the flights on PX4 as a table beside the requirement."""

from __future__ import annotations

from typing import Any

import pytest

FLOWN = pytest.StashKey[list[dict[str, Any]]]()


@pytest.fixture
def flown(request: pytest.FixtureRequest) -> list[dict[str, Any]]:
    """The flights of this session; a test adds its own."""
    return request.config.stash.setdefault(FLOWN, [])


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    rows = config.stash.get(FLOWN, [])
    if not rows:
        return
    terminalreporter.section("flights on PX4, errors against its simulator's truth")
    form = "{:<28} {:>4}  {:<11} {:>12} {:>13} {:>10}  {}"
    terminalreporter.write_line(
        form.format("mission", "seed", "outcome", "position [m]", "heading [deg]", "time [s]", "")
    )
    for row in rows:
        position, heading, time = f"{row['position']:.3f}", f"{row['heading_deg']:.1f}", f"{row['duration']:.1f}"
        words = (row["mission"], row["seed"], row["outcome"], position, heading, time, row["note"])
        terminalreporter.write_line(form.format(*words).rstrip())
    mean = sum(row["position"] for row in rows) / len(rows)
    met = sum(row["outcome"] in ("landed", "intercepted", "followed") for row in rows)
    terminalreporter.write_line(f"met {met} of {len(rows)}; mean position error {mean:.3f} m (at most 0.10 m)")
