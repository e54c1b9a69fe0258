"""The guardian's states as a table."""

from __future__ import annotations

from enum import Enum

from companion.errors import CompanionError
from companion.messages.guardian import GuardianState


class Event(Enum):
    """What a tick found; one for each tick, the most urgent."""

    STAY = "nothing new"
    ENGAGE = "the operator engages, and nothing speaks against it"
    DISENGAGE = "the operator, or the mission, gives the vehicle back"
    FINISH = "the mission is over and the vehicle disarmed"
    LINK_LOST = "no heartbeat from the autopilot"
    MODE_TAKEN = "the autopilot is in a mode that we did not ask for"
    DISTRESS = "the autopilot reports a failsafe, a kill, a pilot's override or a reboot"
    STICKS = "the pilot has moved the sticks"
    ESTIMATE_INVALID = "the autopilot's own position estimate is not usable"
    DISARMED = "the vehicle has been armed and is not any more"
    STALE = "the own position is older than it may be for a position setpoint"
    LOST = "the own position, or this program, was away too long"
    OVERDUE = "the guardian was silent for too long: only the operator resumes"
    PRESTREAMED = "'hold here' has been streamed long enough"
    UNANSWERED = "asked for a mode as often as allowed"
    IN_OWN_MODE = "the autopilot is in our mode"
    FOLLOW = "there is a trajectory to follow"
    NOTHING_TO_FOLLOW = "there is none, or it has expired or belongs to another estimate"
    SILENT = "no trajectory for too long"
    LEFT_OWN_MODE = "the autopilot has left our mode, as asked"


class IllegalEventError(CompanionError):
    """An event that cannot happen in this state."""


_S, _E = GuardianState, Event
_IN_CONTROL = (_S.FOLLOWING, _S.HOLDING, _S.BLIND, _S.GAP)
_ALL = tuple(GuardianState)


def _build() -> dict[tuple[GuardianState, Event], GuardianState]:
    table: dict[tuple[GuardianState, Event], GuardianState] = {(state, _E.STAY): state for state in _ALL}
    for state in _ALL:
        if state is not _S.MUTED:
            for event in (_E.LINK_LOST, _E.DISTRESS, _E.STICKS):
                table[state, event] = _S.MUTED
    for state in (*_IN_CONTROL, _S.PRESTREAM, _S.REQUESTING):
        for event in (_E.MODE_TAKEN, _E.ESTIMATE_INVALID):
            table[state, event] = _S.MUTED
        table[state, _E.FINISH] = _S.LEAVING
    for state in _IN_CONTROL:
        table[state, _E.DISENGAGE] = _S.HANDOVER
        table[state, _E.DISARMED] = _S.LEAVING
        table[state, _E.LOST] = _S.GAP
        table[state, _E.OVERDUE] = _S.MUTED
        table[state, _E.NOTHING_TO_FOLLOW] = _S.HOLDING
    for state in (_S.FOLLOWING, _S.HOLDING, _S.BLIND):
        table[state, _E.STALE] = _S.BLIND
        table[state, _E.FOLLOW] = _S.FOLLOWING
    table |= {
        (_S.MUTED, _E.ENGAGE): _S.PRESTREAM,
        (_S.PRESTREAM, _E.DISENGAGE): _S.MUTED,
        (_S.PRESTREAM, _E.LOST): _S.MUTED,
        (_S.PRESTREAM, _E.IN_OWN_MODE): _S.HOLDING,
        (_S.PRESTREAM, _E.PRESTREAMED): _S.REQUESTING,
        (_S.REQUESTING, _E.DISENGAGE): _S.HANDOVER,
        (_S.REQUESTING, _E.LOST): _S.MUTED,
        (_S.REQUESTING, _E.IN_OWN_MODE): _S.HOLDING,
        (_S.REQUESTING, _E.UNANSWERED): _S.MUTED,
        (_S.GAP, _E.STALE): _S.GAP,
        (_S.HOLDING, _E.SILENT): _S.HANDOVER,
        (_S.HANDOVER, _E.ESTIMATE_INVALID): _S.MUTED,
        (_S.HANDOVER, _E.LOST): _S.MUTED,
        (_S.HANDOVER, _E.DISARMED): _S.LEAVING,
        (_S.HANDOVER, _E.FINISH): _S.LEAVING,
        (_S.HANDOVER, _E.LEFT_OWN_MODE): _S.MUTED,
        (_S.HANDOVER, _E.UNANSWERED): _S.MUTED,
        (_S.LEAVING, _E.LEFT_OWN_MODE): _S.MUTED,
        (_S.LEAVING, _E.UNANSWERED): _S.MUTED,
    }
    return table


TABLE = _build()


def update(state: GuardianState, event: Event) -> GuardianState:
    """Give the next state.

    Raises:
        IllegalEventError: the event cannot happen in this state.
    """
    try:
        return TABLE[state, event]
    except KeyError:
        raise IllegalEventError(f"the guardian cannot meet '{event.value}' in state {state.value}") from None
