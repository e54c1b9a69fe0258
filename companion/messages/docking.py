"""What the docking guidance decides, on what grounds, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.messages.decision import TransitionProbabilities


class DockingMode(Enum):
    """Mode of the docking guidance."""

    WAIT = "wait"  # at rest where it is, until the position is known well enough
    APPROACH = "approach"  # along the line of sight, in the attitude of the start
    REORIENT = "reorient"  # still closing along the line of sight, turning to the docking attitude
    ALIGN = "align"  # to the point straight in front of the docking face, and at rest there
    DOCK = "dock"  # straight in along the docking face's normal
    RETREAT = "retreat"  # away from the docking face: to try again, or for good
    DOCKED = "docked"  # in contact
    HOLD = "hold"  # given up: at rest, clear of the target


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchingSituation:
    """What a switching policy looks at. Range: distance between the chaser's centre of mass and its docked position."""

    # APPROACH (switch: begin to turn), REORIENT (switch: move in front of the docking face), or ALIGN, once the chaser
    # may go in from where it is (switch: do so; keep: come to rest in front of the docking face first)
    mode: DockingMode
    range: float  # [m]
    misalignment: float  # norm of the vector part of the quaternion from the attitude to the docking attitude, 0..1
    mahalanobis: float  # root mean square Mahalanobis distance per degree of freedom, about 1 when consistent
    position_std: float  # [m] largest standard deviation of the position, over all directions along the axes of c
    vision: bool  # pictures are being fused
    reorient_range: float | None  # [m] range at which the turn was begun, None before
    ahead: bool = False  # the chaser aims ahead, at a point in front of the docking face, not at the docked place


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchingVerdict:
    """A policy's answer: keep the mode or leave it for the next one."""

    switch: bool
    reason: str  # one plain sentence with the numbers that decided
    ahead: bool = False  # in APPROACH: from now on aim ahead, at a point in front of the docking face (for good)
    near: bool = False  # out of REORIENT: align as near as a curved way in allows, not as far out as the range is
    probabilities: TransitionProbabilities | None = None  # None where no Markov chain was asked
    fallback: bool = False  # the policy did not know this situation and another one answered


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingSwitch:
    """One change of mode."""

    t: float  # [s]
    mode: DockingMode  # the mode entered
    reason: str  # one plain sentence with the numbers that decided


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingDecision:
    """The docking guidance's state after one step."""

    t: float  # [s]
    mode: DockingMode
    switched: DockingSwitch | None  # set in the step that changed the mode
    situation: SwitchingSituation | None  # what the policy was asked about in this step, None where it was not asked
    verdict: SwitchingVerdict | None  # what came of it: the policy's answer, or the guidance's own limit
    reorient_range: float | None  # [m] r2: range at which the turn was begun, None before
    align_range: float | None  # [m] r1: distance of the alignment point, None before
    failed_attempts: int  # runs at the docking face that ended in a retreat
