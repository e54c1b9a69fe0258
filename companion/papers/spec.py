"""What a paper's file may hold: its tables and figures, case by case, with what was published."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
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
    COMPUTER = "computer"  # of the estimator alone: measured on this computer, not flown


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
    way_left_m: Figure | None = None  # horizontal distance of a pad out of sight where the way to it was left
    coarse_error_m: Figure | None = None  # of the estimate without camera then
    approach_s: Figure | None = None  # from the end of the climb to the touchdown on such a pad
    energy_kj: Figure | None = None  # likewise
    reorient_range_m: Figure | None = None  # r2, of a docking
    align_range_m: Figure | None = None  # r1, of a docking
    operations_flop: Figure | None = None  # of one prediction and one update of the estimator
    memory_kb: Figure | None = None  # likewise
    runtime_ms: Figure | None = None  # likewise
    successes: Count | None = None
    trials: Count | None = None


_FIGURES = tuple(each.name for each in dataclasses.fields(Published) if each.name not in ("successes", "trials"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperCase:
    """One column of a table, or one setting of a figure."""

    name: Annotated[str, Len(1, 40)]  # unique within its table or figure
    what: Annotated[str, Len(1, 120)]  # for people
    short: str = ""  # in a study: beside its point, instead of the name
    at: str = ""  # in a figure of bars: at which place of the axis it stands,
    series: str = ""  # and of which series it is
    trials: Trials = Trials.SIMULATED
    mission: Path | None = None  # counts from this file's folder; none: this project cannot fly it yet
    overrides: tuple[str, ...] = ()  # like --set: `a.b=value`
    policy_table: Path | None = None  # of `policy: optimal`, instead of the configuration's; counts from here too
    published: Published = field(default_factory=Published)  # as printed


@dataclass(frozen=True, slots=True, kw_only=True)
class Exhibit:
    """One table or figure of the paper, or a study of ours that goes beyond it: exactly one of the three."""

    table: Annotated[int, Interval(ge=1, le=99)] | None = None
    figure: Annotated[int, Interval(ge=1, le=99)] | None = None
    study: Annotated[str, Len(1, 40)] | None = None  # flown only where asked for by this name
    title: Annotated[str, Len(1, 120)]
    text: Annotated[str, MinLen(1)]  # what the paper says of the experiment
    vehicle: Vehicle
    runs: Annotated[int, Interval(ge=1, le=10_000)] = 10  # for each case, as in the paper
    paired: bool = False  # all cases are flown with the same seeds: they differ in one setting
    measures: tuple[str, ...] = ()  # shown though none is printed: names of published figures
    not_compared: tuple[str, ...] = ()  # printed, but of a vehicle unlike ours: only their ratios say something
    together: bool = False  # drawn in one picture: the cases differ in where they start
    flights_of: Annotated[int, Interval(ge=1, le=99)] | None = None  # shows this table's flights: its runs and cases
    cases: tuple[PaperCase, ...] = ()  # one at least; with flights_of: none

    def measured(self, case: PaperCase, name: str) -> bool:
        """Whether a figure of a case is shown: it is printed, or asked for."""
        return name in self.measures or getattr(case.published, name) is not None

    @property
    def label(self) -> str:
        """Its name in the paper."""
        if self.study is not None:
            return f"study {self.study}"
        return f"table {self.table}" if self.table is not None else f"figure {self.figure}"

    @property
    def flown_as(self) -> str:
        """The table or figure under whose name it is flown: figures may show the flights of a table."""
        return self.label if self.flights_of is None else f"table {self.flights_of}"


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
        if sum(number is not None for number in (exhibit.table, exhibit.figure, exhibit.study)) != 1:
            wrong = "this is neither a table nor a figure, or both"
            raise _wrong(path, key, wrong, "give one of table and figure; of an experiment of ours, study")
        if exhibit.label in seen:
            raise _wrong(path, key, f"{exhibit.label} stands twice", "put all its cases in one place")
        seen.add(exhibit.label)
        for listed in ("measures", "not_compared"):
            unknown = [name for name in getattr(exhibit, listed) if name not in _FIGURES]
            if unknown:
                wrong, right = f"no such figure: {unknown[0]}", f"there are {', '.join(_FIGURES)}"
                raise _wrong(path, f"{key}.{listed}", wrong, right)
        names = [case.name for case in exhibit.cases]
        if len(set(names)) < len(names):
            raise _wrong(path, key, f"{exhibit.label} has two cases of one name", "give each its own name")
        cases = tuple(_resolved(path, f"{key}.cases.{place}", case) for place, case in enumerate(exhibit.cases))
        exhibits.append(dataclasses.replace(exhibit, cases=cases))
    shown = [_with_flights(path, index, exhibit, exhibits) for index, exhibit in enumerate(exhibits)]
    return dataclasses.replace(paper, exhibits=tuple(shown))


def _with_flights(path: str | os.PathLike[str], index: int, exhibit: Exhibit, all_: Sequence[Exhibit]) -> Exhibit:
    """Give an exhibit that shows a table's flights that table's cases; their figures as printed stay there."""
    key = f"exhibits.{index}"
    if exhibit.flights_of is None:
        if not exhibit.cases:
            raise _wrong(path, f"{key}.cases", "there is none", "give a case, or flights_of: a table of this file")
        return exhibit
    table = next((each for each in all_ if each.table == exhibit.flights_of), None)
    if table is None or exhibit.cases:
        wrong = "there are cases of its own besides" if exhibit.cases else "there is no such table"
        raise _wrong(path, f"{key}.flights_of", wrong, "name a table of this file, and leave cases out")
    cases = tuple(dataclasses.replace(case, published=Published()) for case in table.cases)
    return dataclasses.replace(exhibit, cases=cases, runs=table.runs, paired=table.paired)


def _resolved(path: str | os.PathLike[str], key: str, case: PaperCase) -> PaperCase:
    if case.mission is None:
        return case
    if case.trials is Trials.HARDWARE:
        raise _wrong(path, key, "a case of the paper's hardware has a mission", "leave mission out")
    mission = Path(os.path.normpath(Path(path).parent / case.mission))
    if not mission.is_file():
        raise _wrong(path, f"{key}.mission", f"there is no file {mission}", "paths count from this file's folder")
    if case.policy_table is None:
        return dataclasses.replace(case, mission=mission)
    table = Path(os.path.normpath(Path(path).parent / case.policy_table))
    if not table.is_file():
        raise _wrong(
            path, f"{key}.policy_table", f"there is no file {table}", "`companion study policy --out` makes it"
        )
    overrides = (*case.overrides, f"policy_table={table.absolute()}")
    return dataclasses.replace(case, mission=mission, policy_table=table, overrides=overrides)


def _wrong(path: str | os.PathLike[str], key: str, wrong: str, right: str) -> InputError:
    return InputError.single(source=os.fspath(path), key=key, wrong=wrong, right=right)
