"""Where the ranging anchors are."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from companion.geometry.arrays import Array

MOST_ANCHORS = 8  # what the pose estimator fuses
LARGEST_ID = 2**64 - 1  # the serial number of a DW1000 has 64 bits, its short address 16

# Anchors that leave a line or a plane by less than this share of their extent count as lying in it: at that share the
# ranges of a vehicle one extent away differ from those of its mirror image by less than the noise of one reading.
FLAT = 0.05
_COUNTED = ("no anchor", "one anchor", "two anchors")


class SurveyFrame(Enum):
    """What the positions of a survey are given in (docs/frames-and-units.md)."""

    PAD = "pad"  # x along the landing heading, y right, z down into the pad
    MOTHERSHIP = "mothership"  # fixed to the mother-ship, `c`
    NED = "ned"  # north, east, down of where the autopilot's estimator started: holds until its next start


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """One anchor."""

    id: int  # that its hardware reports
    position: tuple[float, float, float]  # [m] of its antenna, in the survey's frame
    delay: float = 0.0  # [m] that its ranges are too long by, for its antenna's delay


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorSurvey:
    """All anchors of one place. The number of an anchor, as in `RangeReading`, is its index here."""

    name: str
    frame: SurveyFrame
    anchors: tuple[Anchor, ...]

    @property
    def positions(self) -> Array:
        """Positions (N, 3) [m] in the survey's frame."""
        return np.array([anchor.position for anchor in self.anchors])


def id_text(anchor_id: int) -> str:
    """Write a hardware id as the tools of the makers do: `0x022E`."""
    return f"0x{anchor_id:04X}"


def geometry_remarks(survey: AnchorSurvey) -> tuple[str, ...]:
    """Say in plain words what the ranges of these anchors cannot tell, and what would be right; empty: nothing."""
    count = len(survey.anchors)
    if count < 3:
        return (
            f"{_COUNTED[count]}: ranges bound where the vehicle is but do not fix it; "
            "set up four anchors or more, not all in one plane",
        )
    offsets = survey.positions - survey.positions.mean(axis=0)
    extents = np.linalg.svd(offsets, compute_uv=False)
    if extents[1] < FLAT * extents[0]:
        return (
            "all anchors lie on one line: ranges do not tell on which side of it the vehicle is; "
            "move at least two anchors off the line, to different sides and heights",
        )
    if count == 3 or extents[2] < FLAT * extents[0]:
        return (
            "all anchors lie in one plane: each place has a mirror image behind it with the same ranges; begin on a "
            f"known side and do not cross the plane, or {'add an anchor' if count == 3 else 'move one anchor'} "
            f"at least {max(0.1, 0.2 * _width(survey)):.1f} m out of it",
        )
    return ()


def _width(survey: AnchorSurvey) -> float:
    """Give the largest extent [m] along an axis."""
    return float(np.ptp(survey.positions, axis=0).max())
