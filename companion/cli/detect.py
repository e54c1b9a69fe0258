"""`companion detect`: what does the tag detector see in pictures, or in a camera?"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from companion.cli.detect_report import Picture, Seen, Setup, as_json, as_text
from companion.clock import MonotonicClock
from companion.errors import CameraError, InputError, Problem
from companion.perception.annotate import draw_pose, draw_tags
from companion.perception.calibration_file import load_calibration
from companion.perception.detector import AprilTagFinder, detect_tags
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.pad import single_tag_pad
from companion.perception.pad_file import load_pad
from companion.perception.pad_pose import PadPose, solve_pad_pose
from companion.perception.pose_parameters import PoseParameters

T = TypeVar("T")

_SETTLING_FRAMES = 5  # a camera's first pictures are dark or old
_CAMERA_TIMEOUT_MS = 5000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion detect`."""
    parser.add_argument("images", metavar="IMAGE", nargs="*", help="pictures: PNG, JPEG and what else OpenCV reads")
    parser.add_argument("--camera", metavar="INDEX_OR_URL", help="take one picture from a camera")
    parser.add_argument("--calibration", metavar="FILE", help="OpenCV or ROS calibration: gives poses and covariances")
    parser.add_argument("--pad", metavar="FILE", help="look for the tags of this pad only, and solve its pose jointly")
    parser.add_argument(
        "--tag-size", metavar="METRES", type=float, help="side of the tags' black frame: gives each tag's pose"
    )
    parser.add_argument(
        "--annotate",
        metavar="DIR",
        nargs="?",
        const="detections",
        help="write annotated copies there (DIR left out: detections)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Look and report; 0 where every picture could be searched."""
    setup, pictures = _prepare(args)
    finder = AprilTagFinder(None if setup.pad is None else setup.pad.ids)
    results = [_look(picture, finder, setup) for picture in pictures]
    copies = _write_copies(results, setup, Path(args.annotate)) if args.annotate is not None else [None] * len(results)
    for seen, copy in zip(results, copies, strict=True):
        print(as_text(seen, setup, copy))
    if args.json:
        described = [as_json(seen, copy) for seen, copy in zip(results, copies, strict=True)]
        print(json.dumps({"images": described}, allow_nan=False))
    return 0


def _prepare(args: argparse.Namespace) -> tuple[Setup, list[Picture]]:
    """Read every input.

    Raises:
        InputError: names everything that is wrong with any of them.
        CameraError: the camera gives no picture.
    """
    problems = _option_problems(args)
    camera = _attempt(problems, load_calibration, args.calibration)
    pad = _attempt(problems, load_pad, args.pad)
    read = [_attempt(problems, _read, name) for name in args.images]
    pictures = [picture for picture in read if picture is not None]
    if not problems and args.camera is not None:
        pictures.append(_grab(args.camera))
    if camera is not None:
        for picture in pictures:
            _attempt(problems, lambda p: camera.check_image(p.image.shape, p.source), picture)
    if problems:
        raise InputError(problems)
    return Setup(camera=camera, pad=pad, tag_size=args.tag_size), pictures


def _attempt(problems: list[Problem], read: Callable[[Any], T], argument: Any) -> T | None:
    """Read one input, where there is one; collect what is wrong with it."""
    try:
        return None if argument is None else read(argument)
    except InputError as error:
        problems.extend(error.problems)
        return None


def _option_problems(args: argparse.Namespace) -> list[Problem]:
    problems = []
    if not args.images and args.camera is None:
        problems.append(_problem("companion detect", "there is nothing to look at", "name a picture, or use --camera"))
    if args.tag_size is not None:
        if not (math.isfinite(args.tag_size) and args.tag_size > 0.0):
            problems.append(_problem("--tag-size", f"is {args.tag_size}", "give the side in metres, such as 0.16"))
        if args.pad is not None:
            problems.append(
                _problem("--tag-size", "is given beside --pad", "the pad file has the sizes: leave one out")
            )
        if args.calibration is None:
            problems.append(_problem("--tag-size", "is given without --calibration", "a pose needs the calibration"))
    if args.annotate is not None and Path(args.annotate).exists() and not Path(args.annotate).is_dir():
        problems.append(_problem("--annotate", f"{args.annotate} is not a folder", "name a folder, or a new one"))
    return problems


def _problem(source: str, wrong: str, right: str) -> Problem:
    return Problem(source=source, line=None, column=None, key="", wrong=wrong, right=right)


def _read(name: str) -> Picture:
    path = Path(name)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = "does not exist" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
        raise InputError.single(source=name, wrong=f"the picture {reason}", right="name a picture file") from None
    image = None
    if data:
        try:
            image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
        except cv2.error:  # larger than OpenCV allows
            image = None
    if image is None:
        raise InputError.single(source=name, wrong="is not a picture that can be read", right="use PNG or JPEG")
    return Picture(source=name, stem=path.stem, image=np.asarray(image, dtype=np.uint8))


def _grab(source: str) -> Picture:
    """Take one picture from a camera or stream."""
    # OpenCV's own words about a missing camera say less than ours
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    if source.isdecimal():
        capture = cv2.VideoCapture(int(source))
    elif "://" in source:
        limits = [
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
            _CAMERA_TIMEOUT_MS,
            cv2.CAP_PROP_READ_TIMEOUT_MSEC,
            _CAMERA_TIMEOUT_MS,
        ]
        capture = cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
    else:
        capture = cv2.VideoCapture(source)
    try:
        picture = None
        for _ in range(_SETTLING_FRAMES):
            good, newest = capture.read()
            if not good:
                break
            picture = newest
    finally:
        capture.release()
    if picture is None:
        raise CameraError(f"camera {source}: gives no picture; name a camera's number, such as 0, or a stream's URL")
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
    return Picture(source=f"camera {source}", stem="camera", image=np.asarray(grey, dtype=np.uint8))


def _look(picture: Picture, finder: AprilTagFinder, setup: Setup) -> Seen:
    clock = MonotonicClock()
    start = clock.now()
    tags = detect_tags(picture.image, finder, camera=setup.camera, parameters=EdgeParameters())
    pad_pose = None
    tag_poses: list[PadPose | None] = [None] * len(tags)
    if setup.camera is not None:
        if setup.pad is not None:
            pad_pose = solve_pad_pose(setup.pad, tags, setup.camera, PoseParameters())
        elif setup.tag_size is not None:
            tag_poses = [
                solve_pad_pose(single_tag_pad(tag.id, setup.tag_size), [tag], setup.camera, PoseParameters())
                for tag in tags
            ]
    return Seen(picture=picture, tags=tags, tag_poses=tuple(tag_poses), pad_pose=pad_pose, seconds=clock.now() - start)


def _write_copies(results: Sequence[Seen], setup: Setup, folder: Path) -> list[str | None]:
    """Write annotated copies, none over another; give their paths."""
    taken: set[str] = set()
    written: list[str | None] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError.single(
            source="--annotate", wrong=f"{folder} cannot be made ({error.strerror})", right="name a writable folder"
        ) from None
    for seen in results:
        name, number = seen.picture.stem, 2
        while name in taken:
            name, number = f"{seen.picture.stem}_{number}", number + 1
        taken.add(name)
        path = folder / f"{name}_tags.png"
        drawn = draw_tags(seen.picture.image, seen.tags)
        if setup.camera is not None:
            for poses, length in _poses_to_draw(seen, setup):
                draw_pose(drawn, poses.hypotheses[0], setup.camera, length)
        good, data = cv2.imencode(".png", drawn)
        try:
            if good:
                path.write_bytes(data.tobytes())
        except OSError as error:
            raise InputError.single(
                source="--annotate",
                wrong=f"{path} cannot be written ({error.strerror})",
                right="name a writable folder",
            ) from None
        written.append(str(path))
    return written


def _poses_to_draw(seen: Seen, setup: Setup) -> list[tuple[PadPose, float]]:
    poses = [(pose, 0.5 * (setup.tag_size or 0.1)) for pose in seen.tag_poses if pose is not None and pose.hypotheses]
    if seen.pad_pose is not None and seen.pad_pose.hypotheses and setup.pad is not None:
        poses.append((seen.pad_pose, 0.25 * min(setup.pad.size)))
    return poses
