"""What a campaign file may hold."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Interval, Len, MinLen

from companion.documents import load_validated
from companion.errors import InputError

Fraction = Annotated[float, Interval(ge=0.0, le=1.0)]
Camera = Literal["rendered", "corners"]
NotNegative = Annotated[float, Ge(0.0)]


class CaseKind(Enum):
    """What is done with the flights of a case."""

    FLIGHTS = "flights"  # fly each seed once, report the figures
    REPEAT = "repeat"  # fly each seed twice, compare the recordings byte for byte
    CONSISTENCY = "consistency"  # fly each seed once, compare the track's errors with its covariance


@dataclass(frozen=True, slots=True, kw_only=True)
class Required:
    """What a case must reach; what is left out is only reported."""

    success_fraction: Fraction | None = None  # of the flights
    mean_position_error_m: NotNegative | None = None  # at most
    mean_angular_error_rad: NotNegative | None = None  # at most
    inside_fraction: Fraction | None = None  # consistency: of the epochs inside the 95 % bounds


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Flights that belong together."""

    name: Annotated[str, Len(1, 60)]  # for people, and for drawing the seeds
    missions: Annotated[tuple[Path, ...], MinLen(1)]  # each is flown with every seed; paths count from this file
    seeds: Annotated[int, Interval(ge=1, le=10_000)]  # how many for each mission, when they are drawn
    seeds_of: Annotated[str, Len(1, 80)] | None = None  # cases that say the same here are flown with the same seeds
    kind: CaseKind = CaseKind.FLIGHTS
    camera: Camera = "rendered"  # pictures, or tag corners with a fitted error model
    overrides: tuple[str, ...] = ()  # like --set: `a.b=value`
    required: Required = field(default_factory=Required)  # what must be reached


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """A campaign file."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people
    cases: Annotated[tuple[Case, ...], MinLen(1)]  # in the order of the table


def load_campaign(path: str | os.PathLike[str]) -> Campaign:
    """Read a campaign file; its missions' paths come back resolved against its folder.

    Raises:
        InputError: it is wrong, with every problem found, or a mission is missing.
    """
    campaign = load_validated(path, Campaign)
    folder = Path(path).parent
    names = [case.name for case in campaign.cases]
    for name in names:
        if names.count(name) > 1:
            raise InputError.single(
                source=os.fspath(path), wrong=f'two cases are called "{name}"', right="give each its own name"
            )
    cases = []
    for case in campaign.cases:
        missions = tuple(Path(os.path.normpath(folder / mission)) for mission in case.missions)
        for mission in missions:
            if not mission.is_file():
                raise InputError.single(
                    source=os.fspath(path),
                    key=f"cases.{names.index(case.name)}.missions",
                    wrong=f"there is no file {mission}",
                    right="paths count from the campaign's folder",
                )
        cases.append(dataclasses.replace(case, missions=missions))
    return dataclasses.replace(campaign, cases=tuple(cases))
