"""Reads and writes anchor surveys, such as config/anchors/pad_four.yaml."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, Len

from companion.documents import Document, json_schema, load_document, validate
from companion.errors import InputError, Problem
from companion.ranging.survey import LARGEST_ID, MOST_ANCHORS, Anchor, AnchorSurvey, SurveyFrame, id_text

_HEXADECIMAL = re.compile(r"(0x)?[0-9a-fA-F]{1,16}")
_APART_M = 0.02  # nearer anchors cannot be two: their housings are larger

Coordinate = Annotated[float, Interval(ge=-1000.0, le=1000.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorEntry:
    """One anchor of a survey file."""

    # that its hardware reports: 0x022E; text is hexadecimal in any case ("022E"), a bare number decimal (558)
    id: Annotated[int, Interval(ge=0, le=LARGEST_ID)] | Annotated[str, Len(1, 18)]
    position_m: tuple[Coordinate, Coordinate, Coordinate]  # of its antenna
    delay_m: Annotated[float, Interval(ge=-10.0, le=10.0)] = 0.0  # its ranges are too long by this


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyFile:
    """A survey file."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people: where these anchors stand
    frame: SurveyFrame  # of the positions
    anchors: Annotated[tuple[AnchorEntry, ...], Len(1, MOST_ANCHORS)]  # their order is their number in recordings


def load_survey(path: str | os.PathLike[str]) -> AnchorSurvey:
    """Read a survey file.

    Raises:
        InputError: it cannot be read or is wrong; names every problem with its line.
    """
    return survey_from_document(load_document(path))


def survey_from_document(document: Document) -> AnchorSurvey:
    """Build the survey of a parsed survey file.

    Raises:
        InputError: the file is wrong; names every problem with its line.
    """
    file = validate(document, SurveyFile)
    ids = [_number_of(entry.id) for entry in file.anchors]
    problems = [*_id_problems(document, ids), *_place_problems(document, file.anchors)]
    if problems:
        raise InputError(problems)
    anchors = tuple(
        Anchor(id=number, position=entry.position_m, delay=entry.delay_m)
        for number, entry in zip(ids, file.anchors, strict=True)
        if number is not None
    )
    return AnchorSurvey(name=file.name, frame=file.frame, anchors=anchors)


def survey_text(survey: AnchorSurvey, *, remarks: Sequence[str] = ()) -> str:
    """Write a survey as a file that `load_survey` reads: positions and delays to a tenth of a millimetre.

    Args:
        survey: the anchors.
        remarks: lines of comment for its head.
    """
    lines = [*(f"# {remark}".rstrip() for remark in remarks), "version: 1"]
    lines += [f'name: "{_escaped(survey.name)}"', f"frame: {survey.frame.value}", "anchors:"]
    for anchor in survey.anchors:
        place = ", ".join(f"{value:.4f}" for value in anchor.position)
        lines.append(f"  - {{id: {id_text(anchor.id)}, position_m: [{place}], delay_m: {anchor.delay:.4f}}}")
    return "\n".join(lines) + "\n"


def write_survey(path: Path, survey: AnchorSurvey, *, remarks: Sequence[str] = (), replace: bool = False) -> None:
    """Write a survey file.

    Args:
        path: the file.
        survey: the anchors.
        remarks: lines of comment for its head.
        replace: an existing file may be replaced.

    Raises:
        InputError: it exists, or cannot be written.
    """
    try:
        with path.open("w" if replace else "x", encoding="utf-8") as file:
            file.write(survey_text(survey, remarks=remarks))
    except FileExistsError:
        raise InputError.single(
            source=str(path), wrong="the file exists", right="choose another name, or replace it with --force"
        ) from None
    except OSError as error:
        raise InputError.single(
            source=str(path),
            wrong=f"the file cannot be written: {error.strerror}",
            right="give a file in a folder that may be written to",
        ) from None


def check_new_file(path: Path, *, replace: bool) -> None:
    """Refuse a file that could not be written, before the work whose result it is to hold.

    Args:
        path: the file.
        replace: it may exist.

    Raises:
        InputError: it exists, or there is no folder for it.
    """
    if path.is_dir():
        raise InputError.single(source=str(path), wrong="this is a directory", right="give the path of a file")
    if path.exists() and not replace:
        raise InputError.single(
            source=str(path), wrong="the file exists", right="choose another name, or replace it with --force"
        )
    if not path.parent.is_dir():
        raise InputError.single(
            source=str(path), wrong=f"there is no folder {path.parent}", right="make it, or choose another"
        )


def survey_schema() -> dict[str, Any]:
    """Build the JSON Schema of survey files."""
    return json_schema(SurveyFile, title="Anchor survey")


def _number_of(written: int | str) -> int | None:
    if isinstance(written, int):
        return written
    return int(written, 16) if _HEXADECIMAL.fullmatch(written) else None


def _id_problems(document: Document, ids: Sequence[int | None]) -> Iterator[Problem]:
    first: dict[int, int] = {}
    for index, number in enumerate(ids):
        key = ("anchors", index, "id")
        if number is None:
            right = "write the id that its hardware reports, for example 0x022E"
            yield document.problem(key, wrong="this is no hexadecimal number", right=right)
        elif number in first:
            wrong = f"anchor {first[number] + 1} has the id {id_text(number)} too"
            yield document.problem(key, wrong=wrong, right="each anchor has an id of its own")
        else:
            first[number] = index


def _place_problems(document: Document, anchors: Sequence[AnchorEntry]) -> Iterator[Problem]:
    for (i, one), (j, other) in combinations(enumerate(anchors), 2):
        if all(abs(a - b) < _APART_M for a, b in zip(one.position_m, other.position_m, strict=True)):
            key = ("anchors", j, "position_m")
            yield document.problem(
                key, wrong=f"anchor {i + 1} stands in the same place", right="measure where each anchor stands"
            )


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
