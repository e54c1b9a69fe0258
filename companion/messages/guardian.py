"""What the guardian did in a tick, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from companion.messages.motion import AnySetpoint
from companion.messages.ownship import FlightMode


class GuardianState(Enum):
    """Who flies, and on what. "Our mode" is that of the vehicle's setpoints: OFFBOARD, or for a rover ACRO."""

    MUTED = "muted"  # silent until the operator engages
    PRESTREAM = "prestream"  # streaming "hold here" before asking for our mode
    REQUESTING = "requesting"  # still streaming it, our mode asked for
    FOLLOWING = "following"  # in our mode, on the planner's trajectory
    HOLDING = "holding"  # in our mode, braking to a hover or standstill and staying there
    BLIND = "blind"  # in our mode, the own position is old: braking by velocity alone
    GAP = "gap"  # silent for a moment: the own position, or this program, was away too long
    HANDOVER = "handover"  # braking, Hold asked for
    LEAVING = "leaving"  # silent after disarming, asking to leave our mode


class ModeRequest(Enum):
    """A mode that the autopilot is to be asked for, once for each output that carries it."""

    OFFBOARD = FlightMode.OFFBOARD
    ACRO = FlightMode.ACRO
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
    setpoint: AnySetpoint | None  # to be sent at once, once; None: send nothing
    request: ModeRequest | None  # to be sent at once, once
    clips: tuple[str, ...]  # limits that changed the planner's reference in this tick
    reason: str  # one plain sentence: why this state
