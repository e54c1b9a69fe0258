"""Which tables and figures are to be flown, and as which campaign."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from companion.campaign.spec import Camera, Campaign, Case
from companion.errors import InputError
from companion.papers.metrics import METRICS
from companion.papers.spec import Exhibit, Paper, PaperCase, Trials


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """One table or figure, with those of its cases that were asked for."""

    exhibit: Exhibit

    @property
    def cases(self) -> tuple[PaperCase, ...]:
        """Those that are flown: trials on the paper's hardware are only quoted, and a computer needs no flight."""
        return tuple(case for case in self.exhibit.cases if case.trials is Trials.SIMULATED)

    def campaign_name(self, paper: Paper, case: PaperCase) -> str:
        """Give the name under which a case is flown; seeds are drawn by it."""
        return f"{paper.name} {self.exhibit.flown_as} {case.name}"


def choose(
    paper: Paper,
    *,
    tables: Sequence[int] = (),
    figures: Sequence[int] = (),
    studies: Sequence[str] = (),
    cases: Sequence[str] = (),
) -> tuple[Chosen, ...]:
    """Choose by number or name, and by name of the case; nothing given: all tables and figures of the paper.

    Raises:
        InputError: there is no such table, figure, study or case, or a simulated case among them cannot be flown here.
    """
    everything = not (tables or figures or studies)
    exhibits = [
        e
        for e in paper.exhibits
        if (everything and e.study is None) or e.table in tables or e.figure in figures or e.study in studies
    ]
    known = [(e.table, e.figure) for e in paper.exhibits]
    _check_known("--table", tables, [table for table, _ in known if table is not None])
    _check_known("--figure", figures, [figure for _, figure in known if figure is not None])
    _check_known("--study", studies, [e.study for e in paper.exhibits if e.study is not None])
    _check_known("--case", cases, list(dict.fromkeys(case.name for e in exhibits for case in e.cases)))
    chosen = []
    for exhibit in exhibits:
        wanted = tuple(case for case in exhibit.cases if not cases or case.name in cases)
        if wanted:
            chosen.append(Chosen(exhibit=dataclasses.replace(exhibit, cases=wanted)))
    if any(_why_not(part.exhibit, case) for part in chosen for case in part.exhibit.cases):
        raise _cannot_fly(paper, [part.exhibit for part in chosen])
    return tuple(chosen)


def campaign_of(paper: Paper, chosen: Sequence[Chosen], *, camera: Camera, runs: int | None) -> Campaign:
    """Give the flights as a campaign.

    Args:
        paper: the paper.
        chosen: what is flown.
        camera: pictures, or tag corners directly.
        runs: for each case; None: as many as the paper made.
    """
    cases: dict[str, Case] = {}  # a table and a figure of its flights share them
    for part in chosen:
        for case in part.cases:
            if case.mission is None:
                raise ValueError(f"{part.exhibit.label}, {case.name}: no mission; `choose` refuses such cases")
            name = part.campaign_name(paper, case)
            cases[name] = Case(
                name=name,
                missions=(case.mission,),
                seeds=runs or part.exhibit.runs,
                seeds_of=f"{paper.name} {part.exhibit.flown_as}" if part.exhibit.paired else None,
                camera=camera,
                overrides=case.overrides,
            )
    title = f"{paper.name}: {', '.join(part.exhibit.label for part in chosen)}"
    return Campaign(version=1, name=title, cases=tuple(cases.values()))


def _why_not(exhibit: Exhibit, case: PaperCase) -> str | None:
    """Say why a case cannot be flown here; None where it can, and where nothing is to be flown."""
    if case.trials is not Trials.SIMULATED:
        return None
    if case.mission is None:
        return "there is no vehicle, world and mission for it yet"
    for name, metric in METRICS.items():
        if metric.of_flight is None and exhibit.measured(case, name):
            return f"no flight measures its {metric.words} yet"
    return None


def _check_known(option: str, wanted: Sequence[int | str], known: Sequence[int | str]) -> None:
    unknown = [each for each in wanted if each not in known]
    if unknown:
        raise InputError.single(
            source=f"{option} {unknown[0]}",
            wrong="the paper has no such experiment",
            right=f"there are {', '.join(map(str, known))}" if known else f"leave {option} out: there is none",
        )


def _cannot_fly(paper: Paper, wanted: Sequence[Exhibit]) -> InputError:
    reasons = []
    for exhibit in wanted:
        grouped: dict[str, list[str]] = {}
        for case in exhibit.cases:
            why = _why_not(exhibit, case)
            if why is not None:
                grouped.setdefault(why, []).append(case.name)
        reasons += [f"{exhibit.label} ({exhibit.vehicle.value}), {_listed(n)}: {why}" for why, n in grouped.items()]
    ready = [f"--{e.label}" for e in paper.exhibits if not any(_why_not(e, case) for case in e.cases)]
    return InputError.single(
        source=f"companion papers {paper.name}",
        wrong="not everything that was asked for can be flown: " + "; ".join(reasons),
        right=f"this can be flown: {' '.join(ready)}" if ready else "nothing of this paper can be flown yet",
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"
