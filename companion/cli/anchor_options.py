"""The options of `companion study anchors`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from companion.errors import InputError
from companion.placement.mounting import FEWEST, MOST
from companion.placement.search import Objective
from companion.ranging.survey_file import check_new_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion study anchors`."""
    add = parser.add_argument
    add("world", metavar="WORLD.yaml", help="a docking mission, a docking world (or its name), or an anchor survey")
    add(
        "--region",
        type=float,
        nargs=4,
        metavar=("X0", "X1", "Y0", "Y1"),
        help="where starts may be [m] (left out: round anchors, start and port)",
    )
    add(
        "--slice",
        type=float,
        nargs="+",
        metavar="Z",
        help="planes of starts [m] (left out: heights of start, port and between)",
    )
    add("--grid", type=int, default=21, metavar="N", help="places along the longer side of the region (default 21)")
    add("--start", type=float, nargs=3, metavar=("X", "Y", "Z"), help="where the chaser starts [m]")
    add("--port", metavar="FILE", help="a docking port, for a survey of anchors")
    add("--lever-arm", type=float, nargs=3, metavar=("X", "Y", "Z"), help="of the vehicle's radio [m]")
    add(
        "--range-std",
        type=float,
        metavar="M",
        help="noise of a range [m] (left out: as the mission's configuration has it, else 0.02)",
    )
    add(
        "--range-rate",
        type=float,
        default=50.0,
        metavar="HZ",
        help="ranges a second, of all anchors together (default 50)",
    )
    add("--acceleration-noise", type=float, metavar="A", help="unknown acceleration [m/s^2/sqrt(Hz)]")
    add("--no-search", action="store_true", help="propose no other places")
    add(
        "--count",
        type=int,
        metavar="N",
        help=f"anchors to propose, {FEWEST} to {MOST} (left out: as many as there are)",
    )
    add(
        "--box",
        type=float,
        nargs=6,
        metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"),
        help="on whose faces anchors may stand [m] (left out: smallest round the given ones)",
    )
    add(
        "--faces",
        metavar="LIST",
        help="faces of the box that are allowed, such as x-,x+,y- (left out: all; round a pad those at the sides)",
    )
    add("--spacing", type=float, default=0.2, metavar="M", help="least distance of two anchors [m] (default 0.2)")
    add(
        "--objective",
        choices=[o.value for o in Objective],
        default=Objective.RMS.value,
        help="what is to be small: the root mean square error over all places (default), the standard deviation in the"
        " worst direction at the worst place, or its mean",
    )
    add("--seed", type=int, default=1, help="of the search (default 1)")
    add("--survey", type=Path, metavar="OUT.yaml", help="write the proposed anchors as a survey")
    add("--out", type=Path, metavar="DIR", help="write map.csv, study.json and anchors.png there")
    add("--force", action="store_true", help="replace existing files")
    add("--json", action="store_true", help="print one JSON object instead")


def check_options(args: argparse.Namespace) -> None:
    """Refuse options that cannot be, before anything is computed."""
    for name in (
        "region",
        "slice",
        "start",
        "lever_arm",
        "range_std",
        "range_rate",
        "acceleration_noise",
        "box",
        "spacing",
    ):
        value = getattr(args, name)
        numbers = value if isinstance(value, list) else [value]
        if not all(number is None or math.isfinite(number) for number in numbers):
            said = " ".join(f"{number:g}" for number in numbers)
            raise InputError.single(
                source=f"--{name.replace('_', '-')} {said}", wrong="not a finite number", right="SI units, finite"
            )
    for option, wrong, right in (
        ("--grid", not 3 <= args.grid <= 201, "3 to 201 places"),
        ("--seed", args.seed < 0, "a whole number from 0 on"),
        ("--range-rate", not args.range_rate > 0.0, "a positive number"),
        ("--range-std", args.range_std is not None and not args.range_std > 0.0, "a positive number"),
        (
            "--acceleration-noise",
            args.acceleration_noise is not None and not args.acceleration_noise > 0.0,
            "a positive number",
        ),
        (
            "--count",
            args.count is not None and not FEWEST <= args.count <= MOST,
            f"{FEWEST} to {MOST}: fewer fix no position, and the pose estimator fuses no more",
        ),
        (
            "--region",
            args.region is not None and not (args.region[0] < args.region[1] and args.region[2] < args.region[3]),
            "X0 < X1 and Y0 < Y1",
        ),
    ):
        if wrong:
            value = getattr(args, option[2:].replace("-", "_"))
            raise InputError.single(source=f"{option} {value}", wrong="out of range", right=right)
    if args.survey is not None and args.no_search:
        raise InputError.single(
            source="--survey", wrong="--no-search proposes nothing to write", right="leave one of them out"
        )
    if args.survey is not None:
        check_new_file(args.survey, replace=args.force)
    if args.out is not None:
        if args.out.is_file():
            raise InputError.single(source=str(args.out), wrong="this is a file", right="give a folder, or a new name")
        if args.out.is_dir():
            check_new_file(args.out / "study.json", replace=args.force)
