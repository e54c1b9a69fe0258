"""`companion calibrate`: from a recorded flight, where the ranging anchors stand."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from companion.documents import parse_document, plain
from companion.errors import InputError, RecordingError
from companion.estimation.anchor_calibration import AnchorCalibration, calibrate_anchors
from companion.estimation.anchor_problem import AnchorCalibrationParameters, AnchorEstimate
from companion.ranging.flight import CHANNELS, PadPlace, pad_place, recorded_flight
from companion.ranging.survey import MOST_ANCHORS, Anchor, AnchorSurvey, SurveyFrame, geometry_remarks, id_text
from companion.ranging.survey_file import check_new_file, load_survey, write_survey
from companion.recording import RECORDING_NAME, Recording, read_recording

_FLIGHTS_NAMED = 4  # at most, where a folder of flights is given instead of one


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion calibrate`."""
    parser.add_argument("what", choices=["anchors"], help="what is calibrated")
    parser.add_argument("recording", metavar="RECORDING", type=Path, help="a flight's folder, or its flight.mcap")
    parser.add_argument("--survey", metavar="OUT.yaml", type=Path, required=True, help="where the survey is written")
    parser.add_argument(
        "--flown-with",
        metavar="FILE",
        type=Path,
        help="the survey that the flight used, for ids and delays (left out: the one that the recording names)",
    )
    parser.add_argument(
        "--lever-arm",
        metavar=("X", "Y", "Z"),
        type=float,
        nargs=3,
        help="antenna of the vehicle's radio, forward, right and down [m] (left out: what the recording says)",
    )
    parser.add_argument(
        "--frame",
        choices=["pad", "ned"],
        help="of the positions written (left out: pad where the flight saw the pad, else ned)",
    )
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead")


def run(args: argparse.Namespace) -> int:
    """Calibrate and write the survey; 0 where it is written, 1 where the flight says too little."""
    check_new_file(args.survey, replace=args.force)
    if args.lever_arm is not None and not all(map(math.isfinite, args.lever_arm)):
        raise InputError.single(
            source="--lever-arm", wrong="not three finite numbers", right="metres forward, right and down"
        )
    chosen = None if args.flown_with is None else load_survey(args.flown_with)
    recording = _read(args.recording)
    section = _ranging_section(recording)
    lever_arm = args.lever_arm or section.get("tag_lever_arm_m", (0.0, 0.0, 0.0))
    try:
        flight = recorded_flight(recording, tuple(lever_arm))
    except RecordingError as error:
        raise RecordingError(f"{args.recording}: {error}") from None
    std = float(section.get("std_m", AnchorCalibrationParameters().range_std))
    result = calibrate_anchors(flight.path, flight.ranges, AnchorCalibrationParameters(range_std=std))
    if result.refusal is not None:
        print(json.dumps({"ok": False, "refusal": result.refusal}) if args.json else f"refused: {result.refusal}")
        return 1
    pad = None if args.frame == "ned" else pad_place(flight, result)
    if args.frame == "pad" and pad is None:
        raise InputError.single(
            source="--frame pad",
            wrong="the flight saw the pad hardly, or it moved",
            right="fly over the pad with the camera on it, or use --frame ned",
        )
    survey = _survey(result, chosen or _flown_with(section), pad, args.survey.stem)
    remarks = _remarks(survey, flight.resets)
    write_survey(args.survey, survey, remarks=_head(args.recording, result, survey), replace=args.force)
    if args.json:
        print(json.dumps(_as_json(args.survey, result, survey, remarks), allow_nan=False))
    else:
        print("\n".join([*_table(result, survey), *remarks, f"written: {args.survey}"]))
    return 0


def _read(path: Path) -> Recording:
    """Read the recording at a path: the file, or the folder that a flight has left."""
    file = path / RECORDING_NAME if path.is_dir() else path
    if file.exists():
        return read_recording(file, CHANNELS)
    right = f"give the folder that `--record` of companion fly or sim has left, or the {RECORDING_NAME} in it"
    if not path.is_dir():
        raise InputError.single(source=str(path), wrong="no such file or folder", right=right)
    below = sorted(str(found.parent) for found in path.glob(f"*/{RECORDING_NAME}"))
    if below:
        right = f"give one of its flights: {', '.join(below[:_FLIGHTS_NAMED])}{', ...' * (len(below) > _FLIGHTS_NAMED)}"
    raise InputError.single(source=str(path), wrong=f"this folder holds no {RECORDING_NAME}", right=right)


def _ranging_section(recording: Recording) -> Mapping[str, Any]:
    """Give the section `ranging` of the configuration that the recording keeps; empty where it keeps none."""
    text = recording.metadata.get("configuration", {}).get("yaml")
    whole = None if text is None else plain(parse_document(text, source="the recording's configuration").root)
    section = whole.get("ranging") if isinstance(whole, dict) else None
    return section if isinstance(section, dict) else {}


def _flown_with(section: Mapping[str, Any]) -> AnchorSurvey | None:
    """Give the survey that the recording names; None where it names none that is still there."""
    named = section.get("survey")
    return load_survey(named) if isinstance(named, str) and Path(named).is_file() else None


def _survey(
    result: AnchorCalibration, flown_with: AnchorSurvey | None, pad: PadPlace | None, name: str
) -> AnchorSurvey:
    """Name the anchors as the flight's survey does, and add its delays, which its ranges had been freed of."""
    known = () if flown_with is None else flown_with.anchors
    most = MOST_ANCHORS if flown_with is None else len(known)
    if any(not 0 <= found.anchor < most for found in result.anchors):
        raise InputError.single(
            source="--flown-with",
            wrong=f"the recording has ranges to anchor {max(found.anchor for found in result.anchors)}, "
            f"that survey has {most} anchors, from 0 on",
            right="give the survey with which the flight was flown",
        )
    anchors = []
    for found in result.anchors:
        place = found.position if pad is None else pad.from_ned(found.position)
        before = known[found.anchor] if known else Anchor(id=found.anchor, position=(0.0, 0.0, 0.0))
        x, y, z = (float(value) for value in place)
        anchors.append(Anchor(id=before.id, position=(x, y, z), delay=before.delay + found.delay))
    return AnchorSurvey(
        name=name[:80] if flown_with is None else flown_with.name,
        frame=SurveyFrame.NED if pad is None else SurveyFrame.PAD,
        anchors=tuple(anchors),
    )


def _head(recording: Path, result: AnchorCalibration, survey: AnchorSurvey) -> list[str]:
    """Give the comment at the head of the file."""
    return [
        f"Calibrated from the flight {recording.name} by `companion calibrate anchors`.",
        "Standard deviation of each anchor's position [m]: "
        + ", ".join(
            f"{id_text(anchor.id)} {_position_std(found):.3f}"
            for anchor, found in zip(survey.anchors, result.anchors, strict=True)
        ),
    ]


def _remarks(survey: AnchorSurvey, resets: int) -> list[str]:
    remarks = [f"remark: {text}" for text in geometry_remarks(survey)]
    if survey.frame is SurveyFrame.NED:
        remarks.append(
            "remark: the positions are in ned, which the autopilot begins anew with each start; see the pad in flight "
            "to have them in its frame"
        )
    if resets:
        remarks.append(
            f"remark: the autopilot's estimate jumped once or more ({resets}); the longest part without was used"
        )
    return remarks


def _position_std(found: AnchorEstimate) -> float:
    """Give the largest standard deviation [m] of an anchor's position, along any direction."""
    return math.sqrt(float(np.linalg.eigvalsh(found.covariance[:3, :3])[-1]))


def _table(result: AnchorCalibration, survey: AnchorSurvey) -> list[str]:
    lines = [
        f"{'anchor':<10}{'position [m], ' + survey.frame.value:<28}{'+-':>7}{'delay [m]':>11}{'ranges':>8}  outliers"
    ]
    for anchor, found in zip(survey.anchors, result.anchors, strict=True):
        place = ", ".join(f"{value:.3f}" for value in anchor.position)
        lines.append(
            f"{id_text(anchor.id):<10}{place:<28}{_position_std(found):>7.3f}{anchor.delay:>11.3f}{found.readings:>8}  "
            f"{found.outliers} ({100.0 * found.outliers / found.readings:.1f} %), others {found.residual_rms:.3f} m rms"
        )
    return lines


def _as_json(path: Path, result: AnchorCalibration, survey: AnchorSurvey, remarks: Sequence[str]) -> dict[str, Any]:
    return {
        "ok": True,
        "survey": str(path),
        "frame": survey.frame.value,
        "anchors": [
            {
                "id": id_text(anchor.id),
                "position_m": list(anchor.position),
                "position_std_m": _position_std(found),
                "delay_m": anchor.delay,
                "delay_std_m": math.sqrt(float(found.covariance[3, 3])),
                "readings": found.readings,
                "outliers": found.outliers,
                "residual_rms_m": found.residual_rms,
            }
            for anchor, found in zip(survey.anchors, result.anchors, strict=True)
        ],
        "unused_readings": result.unused,
        "remarks": list(remarks),
    }
