"""What guidance decides, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Mode(Enum):
    """Mode of the guidance."""

    PREFLIGHT = "preflight"  # waiting for telemetry, stream and permission
    TAKEOFF = "takeoff"
    TRANSIT = "transit"  # flying to where the pad should be, before it is seen
    SEARCH = "search"  # looking for the target; on the ground it stands still
    APPROACH = "approach"  # flying to the predicted intercept
    REORIENT = "reorient"  # near: turning to the pad's heading while closing
    FOLLOW = "follow"  # keeping station above the target, or behind it
    ALIGN = "align"  # settling above the pad, inside the cone;
    # on the ground: at its place, it looks whether the target stands
    LAND = "land"  # descending inside the cone, to touchdown
    TOUCHDOWN = "touchdown"  # on the pad: pressing down until the autopilot says landed and disarms
    AUTOPILOT_LAND = "autopilot_land"  # the autopilot lands by itself, and is told where the pad is
    HOLD = "hold"  # standing still
    GO_AROUND = "go_around"  # climbing away from a bad descent, keeping the pad's speed
    ABORT = "abort"  # mission over without success: Hold handed to the autopilot
    DONE = "done"  # landed and disarmed, or held as the mission asked


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """One change of mode."""

    t: float  # [s]
    mode: Mode  # the mode entered
    reason: str  # one plain sentence with the numbers that decided


@dataclass(frozen=True, slots=True, kw_only=True)
class TransitionProbabilities:
    """The Markov model's numbers at one instant (Parikh et al., Algorithm 1)."""

    a11: float  # keep approaching
    a22: float  # keep reorienting
    a32: float  # align back to reorient
    steady_align: float  # steady-state probability of "align"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The guidance's state after one step."""

    t: float  # [s]
    mode: Mode
    switched: Switch | None  # set in the step that changed the mode
    probabilities: TransitionProbabilities | None  # None where the Markov model was not asked
