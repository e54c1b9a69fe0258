"""What a paper's file may hold: its tables and figures, case by case, with what was published."""

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

Figure = Annotated[float, Ge(0.0)]
Count = Annotated[int, Interval(ge=0, le=10_000)]


class Vehicle(Enum):
    """The paper's platforms."""

    UAV = "uav"
    ROVER = "rover"
    FREE_FLYER = "free-flyer"
    CUBESAT = "cubesat"


class Trials(Enum):
    """Where the paper's trials were made."""

    SIMULATED = "simulated"
    HARDWARE = "hardware"  # quoted, never flown here


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """The figures of one case as printed; means over its trials. Left out: not printed."""

    position_error_m: Figure | None = None  # after the end
    angular_error_rad: Figure | None = None  # after the end
    along_track_error_m: Figure | None = None  # after the end
    cross_track_error_m: Figure | None = None  # after the end
    station_position_m: Figure | None = None  # station-keeping
    station_position_std_m: Figure | None = None
    station_angle_rad: Figure | None = None  # station-keeping
    station_angle_std_rad: Figure | None = None
    path_rmse_m: Figure | None = None  # of the predicted path
    latency_s: Figure | None = None  # of the computer
    duration_s: Figure | None = None  # of a docking, from the start to the contact
    impulse_ns: Figure | None = None  # of all nozzles until then
    successes: Count | None = None
    trials: Count | None = None


_FIGURES = tuple(each.name for each in dataclasses.fields(Published) if each.name not in ("successes", "trials"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperCase:
    """One column of a table, or one setting of a figure."""

    name: Annotated[str, Len(1, 40)]  # unique within its table or figure
    what: Annotated[str, Len(1, 120)]  # for people
    at: str = ""  # in a figure of bars: at which place of the axis it stands,
    series: str = ""  # and of which series it is
    trials: Trials = Trials.SIMULATED
    mission: Path | None = None  # counts from this file's folder; none: this project cannot fly it yet
    overrides: tuple[str, ...] = ()  # like --set: `a.b=value`
    published: Published = field(default_factory=Published)  # as printed


@dataclass(frozen=True, slots=True, kw_only=True)
class Exhibit:
    """One table or figure: exactly one of the two numbers."""

    table: Annotated[int, Interval(ge=1, le=99)] | None = None
    figure: Annotated[int, Interval(ge=1, le=99)] | None = None
    title: Annotated[str, Len(1, 120)]
    text: Annotated[str, MinLen(1)]  # what the paper says of the experiment
    vehicle: Vehicle
    runs: Annotated[int, Interval(ge=1, le=10_000)] = 10  # for each case, as in the paper
    paired: bool = False  # all cases are flown with the same seeds: they differ in one setting
    measures: tuple[str, ...] = ()  # shown though none is printed: names of published figures
    cases: Annotated[tuple[PaperCase, ...], MinLen(1)]

    def measured(self, case: PaperCase, name: str) -> bool:
        """Whether a figure of a case is shown: it is printed, or asked for."""
        return name in self.measures or getattr(case.published, name) is not None

    @property
    def label(self) -> str:
        """Its name in the paper."""
        return f"table {self.table}" if self.table is not None else f"figure {self.figure}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """A paper's file."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 40)]
    citation: Annotated[str, MinLen(1)]
    exhibits: Annotated[tuple[Exhibit, ...], MinLen(1)]


def load_paper(path: str | os.PathLike[str]) -> Paper:
    """Read a paper's file; its missions' paths come back resolved against its folder.

    Raises:
        InputError: it is wrong, with every problem found, or a mission is missing.
    """
    paper = load_validated(path, Paper)
    seen: set[str] = set()
    exhibits = []
    for index, exhibit in enumerate(paper.exhibits):
        key = f"exhibits.{index}"
        if (exhibit.table is None) == (exhibit.figure is None):
            raise _wrong(path, key, "this is neither a table nor a figure, or both", "give one of table and figure")
        if exhibit.label in seen:
            raise _wrong(path, key, f"{exhibit.label} stands twice", "put all its cases in one place")
        seen.add(exhibit.label)
        unknown = [name for name in exhibit.measures if name not in _FIGURES]
        if unknown:
            raise _wrong(path, f"{key}.measures", f"no such figure: {unknown[0]}", f"there are {', '.join(_FIGURES)}")
        names = [case.name for case in exhibit.cases]
        if len(set(names)) < len(names):
            raise _wrong(path, key, f"{exhibit.label} has two cases of one name", "give each its own name")
        cases = tuple(_resolved(path, f"{key}.cases.{place}", case) for place, case in enumerate(exhibit.cases))
        exhibits.append(dataclasses.replace(exhibit, cases=cases))
    return dataclasses.replace(paper, exhibits=tuple(exhibits))


def _resolved(path: str | os.PathLike[str], key: str, case: PaperCase) -> PaperCase:
    if case.mission is None:
        return case
    if case.trials is Trials.HARDWARE:
        raise _wrong(path, key, "a case of the paper's hardware has a mission", "leave mission out")
    mission = Path(os.path.normpath(Path(path).parent / case.mission))
    if not mission.is_file():
        raise _wrong(path, f"{key}.mission", f"there is no file {mission}", "paths count from this file's folder")
    return dataclasses.replace(case, mission=mission)


def _wrong(path: str | os.PathLike[str], key: str, wrong: str, right: str) -> InputError:
    return InputError.single(source=os.fspath(path), key=key, wrong=wrong, right=right)
