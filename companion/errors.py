"""Every error that a user can meet.

CompanionError
├── InputError          a file or an option is wrong: nothing has been started (exit code 2)
├── CameraError         the camera cannot be used, or has stopped (exit code 2 before flight)
│   └── CameraNotReadyError  it gives no picture yet: its stream or device may still come up (exit code 3)
├── VehicleError        no vehicle, the wrong vehicle, or a vehicle that refuses (exit code 3)
└── RecordingError      the recording cannot be written or read

A message says what was wrong, where, and what would be right. What is expected in flight (late, gated out,
infeasible) is a result, never an exception.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class CompanionError(Exception):
    """Root of all errors raised on purpose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One thing that is wrong with an input file or an option."""

    source: str  # file name, or "--set" and the like
    line: int | None  # first line is 1
    column: int | None  # first column is 1
    key: str  # dotted path of the key, "" for the whole document
    wrong: str  # what was found
    right: str  # what would be right

    def __str__(self) -> str:
        """Give `file:line:column: key: what was wrong; what would be right`."""
        where = self.source
        if self.line is not None:
            where += f":{self.line}:{self.column or 1}"
        key = f" {self.key}:" if self.key else ""
        return f"{where}:{key} {self.wrong}; {self.right}"


class InputError(CompanionError):
    """A mission, a configuration or an option is wrong. Carries every problem found, not the first only."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def single(cls, *, source: str, wrong: str, right: str, key: str = "") -> InputError:
        """Build the error for one problem that has no line."""
        return cls([Problem(source=source, line=None, column=None, key=key, wrong=wrong, right=right)])


class CameraError(CompanionError):
    """The camera cannot be opened or has stopped."""


class CameraNotReadyError(CameraError):
    """The camera gives no picture yet, but may later: nobody serves its stream so far, its device is not there."""


class VehicleError(CompanionError):
    """No vehicle, the wrong vehicle, or a vehicle that refuses."""


class RecordingError(CompanionError):
    """The recording cannot be written or read."""
