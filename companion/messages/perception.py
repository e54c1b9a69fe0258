"""From pixels to a measurement of the pad."""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.arrays import Array, Image, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraFrame:
    """One grey picture."""

    t: float  # [s] middle of the exposure, companion clock
    t_arrival: float  # [s] when the companion received it
    sequence: int  # counts the frames of this camera
    image: Image  # (height, width) grey


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagDetection:
    """One AprilTag seen in one frame."""

    id: int
    # (4, 2) [px] top left, top right, bottom right, bottom left of the tag as printed; pixel centres at integers
    corners: Array
    corner_sigma: float  # [px] standard deviation of each corner coordinate
    method: str  # which detector and refinement found it

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen(self.corners, (4, 2)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseHypothesis:
    """One of the (at most two) poses of the pad that explain the corners."""

    rotation: Array  # (3, 3) cam_from_pad
    translation: Array  # (3,) [m] the pad's landing point, in cam
    covariance: Array  # (6, 6): [m] translation, then [rad] rotation vector applied on the left, in cam
    reprojection_rms: float  # [px]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(self.rotation, (3, 3)))
        object.__setattr__(self, "translation", frozen(self.translation, (3,)))
        object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PadObservation:
    """Everything that one frame says of the pad."""

    t: float  # [s] capture
    sequence: int  # of the frame
    detections: tuple[TagDetection, ...]  # tags of this pad only
    hypotheses: tuple[PoseHypothesis, ...]  # best reprojection first; empty where the pad was not seen
    search: str  # "window" (predicted) or "frame" (whole picture)

    @property
    def seen(self) -> bool:
        """Whether the pad's pose was found in the frame."""
        return bool(self.hypotheses)
