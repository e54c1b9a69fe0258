"""What a check has found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum


class Verdict(Enum):
    """How a check ended."""

    FINE = "fine"
    NOT_FINE = "not fine"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One row of the report."""

    check: str  # what was looked at
    verdict: Verdict
    found: str  # plain, with units
    wanted: str  # what would be right; where nothing was checked, what the operator can do
    figures: Mapping[str, float | str | bool | None] = field(default_factory=dict)  # for programs; unit in the name

    def __str__(self) -> str:
        """Give it in one line."""
        return f"{self.check}: {self.found}" + ("" if self.verdict is Verdict.FINE else f"; wanted: {self.wanted}")


def judged(
    check: str, fine: bool, found: str, wanted: str, figures: Mapping[str, float | str | bool | None] | None = None
) -> Finding:
    """Build a finding of a check that could be made."""
    verdict = Verdict.FINE if fine else Verdict.NOT_FINE
    return Finding(check=check, verdict=verdict, found=found, wanted=wanted, figures=figures or {})


def not_checked(check: str, why: str, advice: str) -> Finding:
    """Build a finding of a check that could not be made."""
    return Finding(check=check, verdict=Verdict.NOT_CHECKED, found=why, wanted=advice)
