"""What the guardian did in a tick, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.messages.motion import Setpoint
from companion.messages.ownship import FlightMode


class GuardianState(Enum):
    """Who flies, and on what."""

    MUTED = "muted"  # silent until the operator engages
    PRESTREAM = "prestream"  # streaming "hold here" before asking for OFFBOARD
    REQUESTING = "requesting"  # still streaming it, OFFBOARD asked for
    FOLLOWING = "following"  # in OFFBOARD, on the planner's trajectory
    HOLDING = "holding"  # in OFFBOARD, braking to a hover and staying there
    BLIND = "blind"  # in OFFBOARD, the own position is old: braking by velocity alone
    GAP = "gap"  # silent for a moment: the own position, or this program, was away too long
    HANDOVER = "handover"  # braking, Hold asked for
    LEAVING = "leaving"  # silent after disarming, asking to leave OFFBOARD


class ModeRequest(Enum):
    """A mode that the autopilot is to be asked for, once for each output that carries it."""

    OFFBOARD = FlightMode.OFFBOARD
    HOLD = FlightMode.AUTO_LOITER

    @property
    def mode(self) -> FlightMode:
        """The mode."""
        return self.value


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardianOutput:
    """One tick of the guardian."""

    t: float  # [s]
    state: GuardianState
    setpoint: Setpoint | None  # to be sent at once, once; None: send nothing
    request: ModeRequest | None  # to be sent at once, once
    clips: tuple[str, ...]  # limits that changed the planner's reference in this tick
    reason: str  # one plain sentence: why this state
