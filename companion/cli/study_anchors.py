"""`companion study anchors`: how well anchors let a chaser know its place, and better places for them."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from companion.cli.anchor_options import add_arguments, check_options
from companion.cli.anchor_scene import Given, read_given, with_options
from companion.cli.anchor_study_text import Study, as_json, lines_of, write_table
from companion.errors import InputError
from companion.geometry.arrays import Array
from companion.placement.area import Area, AreaMap, assess_area, clear_of_target
from companion.placement.assessment import Corridor, Foreseen, corridor, foresee
from companion.placement.mounting import FACES, Box, Mounting, box_round
from companion.placement.search import Objective, Proposal, propose
from companion.ranging.survey import Anchor, AnchorSurvey, SurveyFrame
from companion.ranging.survey_file import write_survey
from companion.recording import write_json

__all__ = ["add_arguments", "run"]

_MARGIN = 0.5  # [m] of the region round anchors, start and port
_PAD_HEIGHTS = (0.5, 2.0, 5.0)  # [m] of the planes above a pad
_STARTS = 40  # about so many starts in each plane count in the search
_ON_THE_WAY = 5  # places from each of them to the port, both included


def run(args: argparse.Namespace) -> int:
    """Study the set-up; 0, or 1 where a survey is asked for and nothing better was found."""
    check_options(args)
    given = _given(args)
    area = _area(args, given)
    mounting = None if args.no_search else _mounting(args, given)
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as progress:
        study = _study(args, given, area, mounting, progress)
    better = study.proposal is not None and not study.proposal.kept
    written = [] if args.out is None else [args.out]
    if args.out is not None:
        _write(args.out, study)
    if args.survey is not None and study.proposal is not None and better:
        write_survey(args.survey, _survey(given.survey, study.proposal), remarks=_head(study), replace=args.force)
        written.append(args.survey)
    if args.json:
        print(json.dumps(as_json(study), allow_nan=False))
    else:
        print("\n".join([*lines_of(study), *(f"written: {path}" for path in written)]))
    return 0 if better or args.survey is None else 1


def _given(args: argparse.Namespace) -> Given:
    given = with_options(
        read_given(args.world),
        start=args.start,
        port=args.port,
        lever_arm=args.lever_arm,
        range_std=args.range_std,
        acceleration_noise=args.acceleration_noise,
        range_rate=args.range_rate,
    )
    if given.start is not None and not clear_of_target(given.scene, given.start):
        port = given.scene.port
        side = 0.0 if port is None else port.side
        raise InputError.single(
            source="the start" if args.start is None else f"--start {args.start}",
            wrong="it lies inside or beside the target",
            right=f"leave {2.0 * side:g} m between the centres",
        )
    return given


def _area(args: argparse.Namespace, given: Given) -> Area:
    marks = [given.survey.positions]
    if given.start is not None:
        marks.append(given.start[None])
    port = given.scene.port
    if port is not None:
        marks.append(port.docked_position[None])
    whole = box_round(np.vstack(marks))
    x0, x1, y0, y1 = args.region or (
        whole.low[0] - _MARGIN,
        whole.high[0] + _MARGIN,
        whole.low[1] - _MARGIN,
        whole.high[1] + _MARGIN,
    )
    longer = max(x1 - x0, y1 - y0)
    count = [max(3, round((args.grid - 1) * side / longer) + 1) for side in (x1 - x0, y1 - y0)]
    body = box_round(given.survey.positions) if given.survey.frame is SurveyFrame.MOTHERSHIP else None
    area = Area(
        x=np.linspace(x0, x1, count[0]),
        y=np.linspace(y0, y1, count[1]),
        z=np.array(_planes(args.slice, given, whole)),
        kept_out=body,
    )
    if given.start is not None and not area.open_to(given.scene, given.start):
        raise InputError.single(
            source=given.source if args.start is None else "--start",
            wrong="the start lies inside the box round the anchors, or has it between itself and the port",
            right="start outside of the mother-ship, in sight of the port",
        )
    return area


def _planes(chosen: list[float] | None, given: Given, whole: Box) -> list[float]:
    """Give the heights [m] of the planes of starts."""
    if chosen is not None:
        return sorted(set(chosen))
    port = given.scene.port
    if given.start is not None and port is not None:
        one, other = float(given.start[2]), float(port.docked_position[2])
        return sorted({one, 0.5 * (one + other), other})
    if given.survey.frame is SurveyFrame.MOTHERSHIP:
        return sorted({float(whole.low[2]), float(0.5 * (whole.low[2] + whole.high[2])), float(whole.high[2])})
    return sorted(-height for height in _PAD_HEIGHTS)


def _mounting(args: argparse.Namespace, given: Given) -> Mounting:
    box = box_round(given.survey.positions)
    if args.box is not None:
        low, high = np.array(args.box[::2]), np.array(args.box[1::2])
        box = Box(low=low, high=high)
    at_sides = tuple(face for face in FACES if face[0] != "z")
    faces = FACES if given.survey.frame is SurveyFrame.MOTHERSHIP else at_sides
    if args.faces is not None:
        faces = tuple(word.strip() for word in args.faces.split(","))
    count = len(given.survey.anchors) if args.count is None else args.count
    try:
        return Mounting(box=box, faces=faces, count=count, spacing=args.spacing)
    except ValueError as error:
        wrong, _, right = str(error).partition("; ")
        raise InputError.single(
            source="where anchors may stand (--box, --faces, --count, --spacing)", wrong=wrong, right=right
        ) from None


def _study(args: argparse.Namespace, given: Given, area: Area, mounting: Mounting | None, progress: Progress) -> Study:
    scene = given.scene
    try:
        task = progress.add_task("map", total=1)
        found = assess_area(scene, area)
        progress.update(task, completed=1)
        proposal = None
        if mounting is not None:
            task = progress.add_task("search", total=None)
            proposal = propose(
                scene,
                mounting,
                _places(given, area),
                np.random.default_rng(args.seed),
                objective=Objective(args.objective),
                report=lambda done, parts: progress.update(task, completed=done, total=parts),
            )
    except ValueError as error:
        wrong, _, right = str(error).partition("; ")
        raise InputError.single(source="companion study anchors", wrong=wrong, right=right) from None
    after = None if proposal is None or proposal.kept else assess_area(scene.with_anchors(proposal.anchors), area)
    return Study(
        given=given,
        map=found,
        ways=_ways(given, found),
        foreseen=_foreseen(given, found),
        proposal=proposal,
        objective=Objective(args.objective),
        map_proposed=after,
    )


def _ways(given: Given, found: AreaMap) -> dict[str, Corridor]:
    port = given.scene.port
    if port is None:
        return {}
    starts = {"start": given.start, "best": found.best.position, "worst": found.worst.position}
    return {name: corridor(given.scene, port, start) for name, start in starts.items() if start is not None}


def _foreseen(given: Given, found: AreaMap) -> dict[str, Foreseen]:
    port = given.scene.port
    if port is None:
        return {}
    extremes = {"best": found.best, "worst": found.worst}
    return {name: foresee(given.scene, port, float(place.axis_std.max())) for name, place in extremes.items()}


def _places(given: Given, area: Area) -> Array:
    """Give the places (P, 3) [m] that count in the search: starts, and the ways from them to the port."""
    step = max(1, round((len(area.x) * len(area.y) / _STARTS) ** 0.5))
    starts = area.positions(given.scene, step=step)
    if given.start is not None:
        starts = np.vstack([starts, given.start])
    port = given.scene.port
    if port is None:
        return starts
    return np.concatenate([np.linspace(start, port.docked_position, _ON_THE_WAY) for start in starts])


def _survey(before: AnchorSurvey, proposal: Proposal) -> AnchorSurvey:
    """Name the proposed anchors as the given ones, as far as there are any; new ones count on."""
    ids = [anchor.id for anchor in before.anchors]
    while len(ids) < len(proposal.anchors):
        ids.append(max(ids) + 1)
    anchors = []
    for number, place in zip(ids, proposal.anchors, strict=False):
        x, y, z = (float(value) for value in place)
        anchors.append(Anchor(id=number, position=(x, y, z)))
    return AnchorSurvey(name=f"proposed: {before.name}"[:80], frame=before.frame, anchors=tuple(anchors))


def _head(study: Study) -> list[str]:
    return ["Proposed by `companion study anchors`, to be measured once they stand.", *lines_of(study)[-1:]]


def _write(folder: Path, study: Study) -> None:
    from companion.report.anchor_maps import draw_anchor_study

    write_json(folder / "study.json", as_json(study))
    write_table(folder / "map.csv", study)
    draw_anchor_study(
        folder / "anchors.png",
        title=study.given.survey.name,
        scene=study.given.scene,
        start=study.given.start,
        given=study.map,
        proposed=study.map_proposed,
        anchors_proposed=None if study.proposal is None else study.proposal.anchors,
    )
