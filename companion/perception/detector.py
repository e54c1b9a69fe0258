"""Finds AprilTags of the family 36h11 in a picture: one interface, two detectors behind it.

`ArucoFinder` (OpenCV, dictionary trimmed to the ids in use) is fast in a predicted window. `AprilTagFinder` (the
AprilTag library without decimation) finds small and far tags best and searches whole pictures. Which is used when, and
what was measured, stands in docs/components/perception.md.

Both give corners in the project's conventions: pixel centres at integers, top left of the tag as printed first, then
clockwise. "As printed" means the official AprilTag pictures; OpenCV before version 5 draws and names the corners of
this family half a turn away from them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import apriltag
import cv2
import numpy as np

from companion.geometry.arrays import Array, Image
from companion.messages.perception import TagDetection
from companion.perception.camera_model import CameraModel
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.edge_refinement import refine_corners
from companion.perception.pad import TAG_COUNT

_CELLS = 6  # data cells along a side
_CORRECTED_BITS = 5  # that the family's distance of 11 can correct
# tag 0 of the official pictures, row by row (AprilTag 2, tag36h11.c)
_OFFICIAL_TAG_0 = 0xD5D628584


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundTag:
    """A tag as a detector gives it, not yet refined."""

    id: int
    corners: Array  # (4, 2) [px], in the project's conventions
    quality: float  # larger is surer; comparable within one detector


class TagFinder(Protocol):
    """A detector."""

    @property
    def name(self) -> str:
        """What it is called in `TagDetection.method`."""

    @property
    def coarse_sigma(self) -> float:
        """Standard deviation [px] of its corner coordinates before refinement."""

    def find(self, image: Image, *, smallest_side: float) -> list[FoundTag]:
        """Find tags.

        Args:
            image: (height, width) grey.
            smallest_side: [px] smaller tags need not be found; 0 asks for all.
        """


class ArucoFinder:
    """OpenCV's detector with the dictionary trimmed to the wanted ids.

    Raises:
        ValueError: an id is not of the family, or none is given.
    """

    name = "aruco"
    coarse_sigma = 0.7

    def __init__(self, ids: Collection[int]) -> None:
        self._ids: list[int] = sorted(set(ids))
        if len(self._ids) == 0 or self._ids[0] < 0 or self._ids[-1] >= TAG_COUNT:
            raise ValueError(f"expected ids from 0 to {TAG_COUNT - 1}, got {self._ids}")
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self._quarter_turns = _quarter_turns_from_official(family)
        trimmed = cv2.aruco.Dictionary(family.bytesList[self._ids], _CELLS, _CORRECTED_BITS)
        self._parameters = cv2.aruco.DetectorParameters()
        self._parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        self._default_rate = float(self._parameters.minMarkerPerimeterRate)
        self._rate = self._default_rate
        self._detector = cv2.aruco.ArucoDetector(trimmed, self._parameters)

    def find(self, image: Image, *, smallest_side: float) -> list[FoundTag]:
        """Find tags; see `TagFinder`."""
        rate = max(self._default_rate, 4.0 * smallest_side / max(image.shape))
        if abs(rate - self._rate) > 0.05 * self._rate:
            self._parameters.minMarkerPerimeterRate = rate
            self._detector.setDetectorParameters(self._parameters)
            self._rate = rate
        quads, indices, _ = self._detector.detectMarkers(image)
        if len(quads) == 0:
            return []
        found = []
        for index, quad in zip(np.asarray(indices).ravel().tolist(), quads, strict=True):
            corners = np.roll(np.asarray(quad, dtype=np.float64).reshape(4, 2), self._quarter_turns, axis=0)
            found.append(FoundTag(id=self._ids[int(index)], corners=corners, quality=_area(corners)))
        return found


class AprilTagFinder:
    """The AprilTag library at full resolution.

    Args:
        ids: the wanted ids; None takes every id of the family.
        threads: threads of the search.
    """

    name = "apriltag"
    coarse_sigma = 0.35

    def __init__(self, ids: Collection[int] | None = None, *, threads: int = 1) -> None:
        self._ids = None if ids is None else frozenset(ids)
        # decimation must be named: left out, the library halves the picture and finds 27 of 37 tags instead of 36
        self._detector: Any = apriltag.apriltag("tag36h11", threads=threads, maxhamming=1, decimate=1.0)

    def find(self, image: Image, *, smallest_side: float) -> list[FoundTag]:  # noqa: ARG002
        """Find tags of any size; see `TagFinder`."""
        found = []
        for tag in self._detector.detect(np.ascontiguousarray(image)):
            if self._ids is not None and tag["id"] not in self._ids:
                continue
            # left bottom first, anticlockwise, pixel centres at +0.5: turn round and shift
            corners = np.asarray(tag["lb-rb-rt-lt"], dtype=np.float64)[::-1] - 0.5
            found.append(FoundTag(id=int(tag["id"]), corners=corners, quality=float(tag["margin"])))
        return found


def detect_tags(
    image: Image,
    finder: TagFinder,
    *,
    camera: CameraModel | None,
    parameters: EdgeParameters,
    smallest_side: float = 0.0,
) -> tuple[TagDetection, ...]:
    """Find the tags of a picture, none twice, with refined corners.

    Args:
        image: (height, width) grey.
        finder: the detector.
        camera: for the bending of the sides by the lens; None takes them as straight.
        parameters: of the edge fit.
        smallest_side: [px] smaller tags need not be found.
    """
    found = without_repeats(finder.find(image, smallest_side=smallest_side))
    return refined_detections(image, found, finder, camera=camera, parameters=parameters)


def refined_detections(
    image: Image,
    found: Sequence[FoundTag],
    finder: TagFinder,
    *,
    camera: CameraModel | None,
    parameters: EdgeParameters,
) -> tuple[TagDetection, ...]:
    """Refine what a finder found; a tag whose edges cannot be fitted keeps its corners and the finder's sigma."""
    if not found:
        return ()
    result = refine_corners(image, np.stack([tag.corners for tag in found]), camera=camera, parameters=parameters)
    return tuple(
        TagDetection(
            id=tag.id,
            corners=result.corners[k],
            corner_sigma=float(result.sigma[k]) if result.refined[k] else finder.coarse_sigma,
            method=f"{finder.name}+edges" if result.refined[k] else finder.name,
        )
        for k, tag in enumerate(found)
    )


def without_repeats(found: Sequence[FoundTag]) -> list[FoundTag]:
    """Keep the surest of tags with one id that lie on one another; equal ids in different places all stay."""
    kept: list[FoundTag] = []
    for tag in sorted(found, key=lambda tag: (-tag.quality, tag.id, *tag.corners.mean(axis=0).tolist())):
        centre, reach = tag.corners.mean(axis=0), 0.5 * float(np.sqrt(max(_area(tag.corners), 0.0)))
        if all(
            other.id != tag.id or float(np.linalg.norm(other.corners.mean(axis=0) - centre)) > reach for other in kept
        ):
            kept.append(tag)
    kept.sort(key=lambda tag: (tag.id, *tag.corners[0].tolist()))
    return kept


def _area(corners: Array) -> float:
    """Area [px^2] of a quad (4, 2), positive where it runs clockwise in the picture."""
    across, down = corners[2] - corners[0], corners[3] - corners[1]
    return 0.5 * float(across[0] * down[1] - across[1] * down[0])


def _quarter_turns_from_official(family: cv2.aruco.Dictionary) -> int:
    """Give by how many corners OpenCV's first corner precedes the official one: 2 before OpenCV 5."""
    cells = cv2.aruco.Dictionary.getBitsFromByteList(family.bytesList[0:1], _CELLS)
    official = np.array([int(bit) for bit in f"{_OFFICIAL_TAG_0:036b}"]).reshape(_CELLS, _CELLS)
    for turns in range(4):
        # the official picture turned clockwise moves its top left corner one corner on
        if np.array_equal(np.rot90(official, -turns), cells):
            return -turns
    raise RuntimeError("OpenCV's dictionary 36h11 does not hold the AprilTag family")
