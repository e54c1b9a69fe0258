"""From a picture to the pose of the pad: predicted window first, whole picture when that fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Interval

from companion.geometry.arrays import Image
from companion.geometry.transform import RigidTransform
from companion.messages.perception import CameraFrame, PadObservation, TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.detector import (
    AprilTagFinder,
    ArucoFinder,
    FoundTag,
    TagFinder,
    refined_detections,
    without_repeats,
)
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.pad import Pad
from companion.perception.pad_pose import PadPose, solve_pad_pose
from companion.perception.pose_parameters import PoseParameters
from companion.perception.window import Window, WindowParameters, predict_window


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceptionParameters:
    """Tuning of everything between the picture and the pad's pose."""

    window: WindowParameters = field(default_factory=WindowParameters)
    edges: EdgeParameters = field(default_factory=EdgeParameters)
    pose: PoseParameters = field(default_factory=PoseParameters)
    frame_finder: Literal["apriltag", "aruco"] = "apriltag"  # which detector searches whole pictures
    frame_threads: Annotated[int, Interval(ge=1, le=8)] = 1  # of the search of whole pictures


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchDiagnostics:
    """How an observation came about."""

    window: Window | None  # the predicted window, None where there was none
    window_failed: bool  # a window was searched in vain
    tags_found: int  # tags of the pad before any was rejected
    rejected_ids: tuple[int, ...]  # tags that disagree with the others
    reason: str  # why there is no pose, "" where there is one


class PadDetector:
    """Sees one pad with one camera. Holds the detectors between frames, no other state.

    Args:
        pad: the pad.
        camera: the calibrated camera.
        parameters: tuning.
    """

    def __init__(self, pad: Pad, camera: CameraModel, parameters: PerceptionParameters) -> None:
        self.pad = pad
        self.camera = camera
        self.parameters = parameters
        self._window_finder = ArucoFinder(pad.ids)
        self._frame_finder: TagFinder = (
            AprilTagFinder(pad.ids, threads=parameters.frame_threads)
            if parameters.frame_finder == "apriltag"
            else ArucoFinder(pad.ids)
        )

    def __reduce__(self) -> tuple[type[PadDetector], tuple[Pad, CameraModel, PerceptionParameters]]:
        """Travel to a worker process as what it was built from: the detectors' own memory cannot."""
        return PadDetector, (self.pad, self.camera, self.parameters)

    def observe(
        self, frame: CameraFrame, predicted: RigidTransform | None, *, position_sigma: float | None = None
    ) -> PadObservation:
        """See the pad in a picture.

        Args:
            frame: the picture, of the calibrated size.
            predicted: `cam_from_pad` expected at the frame's capture; None searches the whole picture.
            position_sigma: standard deviation [m] of the prediction; None takes the parameters'.

        Raises:
            InputError: the picture is not of the calibrated size.
        """
        return self.examine(frame, predicted, position_sigma=position_sigma)[0]

    def examine(
        self, frame: CameraFrame, predicted: RigidTransform | None, *, position_sigma: float | None = None
    ) -> tuple[PadObservation, SearchDiagnostics]:
        """See the pad in a picture and say how; arguments as for `observe`."""
        self.camera.check_image(frame.image.shape, f"frame {frame.sequence}")
        window = None
        if predicted is not None:
            window = predict_window(
                self.pad, self.camera, predicted, self.parameters.window, position_sigma=position_sigma
            )
        if window is not None:
            tags = self._detect(frame.image, find_in_window(frame.image, window, self._window_finder))
            pose = self._solve(tags)
            if pose.hypotheses:
                return self._report(frame.t, frame.sequence, tags, pose, "window", window, window_failed=False)
        tags = self._detect(frame.image, self._frame_finder.find(frame.image, smallest_side=0.0), self._frame_finder)
        pose = self._solve(tags)
        return self._report(frame.t, frame.sequence, tags, pose, "frame", window, window_failed=window is not None)

    def observe_corners(self, t: float, sequence: int, detections: Sequence[TagDetection]) -> PadObservation:
        """See the pad in tag corners that another detector, or a simulated one, has found.

        Args:
            t: instant of capture [s].
            sequence: of the frame.
            detections: every tag seen; those of other pads are dropped.
        """
        tags = tuple(tag for tag in detections if tag.id in self.pad.corners)
        return self._report(t, sequence, tags, self._solve(tags), "frame", None, window_failed=False)[0]

    def _detect(
        self, image: Image, found: Sequence[FoundTag], finder: TagFinder | None = None
    ) -> tuple[TagDetection, ...]:
        return refined_detections(
            image,
            without_repeats(found),
            finder or self._window_finder,
            camera=self.camera,
            parameters=self.parameters.edges,
        )

    def _solve(self, tags: Sequence[TagDetection]) -> PadPose:
        return solve_pad_pose(self.pad, tags, self.camera, self.parameters.pose)

    def _report(
        self,
        t: float,
        sequence: int,
        tags: Sequence[TagDetection],
        pose: PadPose,
        search: str,
        window: Window | None,
        *,
        window_failed: bool,
    ) -> tuple[PadObservation, SearchDiagnostics]:
        observation = PadObservation(
            t=t,
            sequence=sequence,
            detections=pose.used if pose.hypotheses else tuple(tags),
            hypotheses=pose.hypotheses,
            search=search,
        )
        diagnostics = SearchDiagnostics(
            window=window,
            window_failed=window_failed,
            tags_found=len(tags),
            rejected_ids=tuple(tag.id for tag in pose.rejected),
            reason=pose.reason,
        )
        return observation, diagnostics


def find_in_window(image: Image, window: Window, finder: TagFinder) -> list[FoundTag]:
    """Search a window, made smaller where the tags in it are large."""
    part = np.ascontiguousarray(image[window.top : window.bottom, window.left : window.right])
    factor = window.reduction
    if factor > 1:
        height, width = part.shape[0] // factor * factor, part.shape[1] // factor * factor
        part = cv2.resize(
            part[:height, :width], (width // factor, height // factor), interpolation=cv2.INTER_AREA
        ).astype(np.uint8, copy=False)
    origin = (window.left, window.top)
    return [
        FoundTag(
            id=tag.id,
            corners=(tag.corners + 0.5) * factor - 0.5 + origin,
            quality=tag.quality,
        )
        for tag in finder.find(part, smallest_side=window.smallest_side / factor)
    ]
