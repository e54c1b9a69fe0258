"""The table of modes: which event leads from which mode to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import TypeVar

from companion.messages.decision import Mode

ModeT = TypeVar("ModeT", bound=Enum)
EventT = TypeVar("EventT", bound=Enum)


class Event(Enum):
    """What can happen to a mission."""

    ENGAGED = "armed and in our mode"
    RESUMED = "engaged in flight"
    HEIGHT_REACHED = "take-off height reached"
    TRANSIT_DUE = "the target was surveyed: flying there"
    ARRIVED_UNSEEN = "where the target should be, but it is not seen"
    WAY_UNKNOWN = "far from the target, and where it is is not known well enough"
    FAR_FROM_TARGET = "lost far from the target: back to the way there"
    TARGET_ACQUIRED = "target acquired"
    REORIENT_DUE = "time to turn to the pad's heading"
    STATION_REACHED = "on station above the target"
    FOLLOW_COMPLETE = "following is complete"
    ALIGN_DUE = "time to align above the pad"
    CONFIDENT = "inside the cone with a confident estimate"
    ARRIVED = "at its place by the target"
    SETTLED = "settled above the pad"
    HAND_OVER = "settled above a pad at rest: the autopilot lands"
    PRECLAND = "somebody has asked for the autopilot's precision landing"
    LANDED_ELSEWHERE = "landed, but not on the pad"
    NOT_TAKEN_UP = "the autopilot does not land precisely"
    TARGET_MOVES = "the target does not stand still"
    CONTACT = "feet on the pad"
    LANDED = "landed and disarmed"
    OUTSIDE_CONE = "outside the cone"
    TARGET_LOST = "target lost"
    HOLD_EXPIRED = "held long enough"
    CLIMBED = "climbed away"
    ATTEMPTS_USED = "no attempts left"
    SEARCH_EXPIRED = "search time used up"
    CAMERA_SILENT = "no camera frames"
    CAMERA_EXPIRED = "no camera frames for long"
    STEP_COMPLETE = "mission step complete"
    BEYOND_FENCE = "the target leads out of the fence"
    NO_PROGRESS = "the point above the target is not reached"
    TAKEN_OVER = "somebody else controls the vehicle"
    DISARMED = "disarmed"


_E = Event
_M = Mode

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    (_M.PREFLIGHT, _E.ENGAGED): _M.TAKEOFF,
    (_M.PREFLIGHT, _E.RESUMED): _M.SEARCH,
    (_M.TAKEOFF, _E.HEIGHT_REACHED): _M.SEARCH,
    (_M.PREFLIGHT, _E.TRANSIT_DUE): _M.TRANSIT,
    (_M.TAKEOFF, _E.TRANSIT_DUE): _M.TRANSIT,
    (_M.TRANSIT, _E.REORIENT_DUE): _M.REORIENT,
    (_M.TRANSIT, _E.ARRIVED_UNSEEN): _M.SEARCH,
    (_M.TRANSIT, _E.TARGET_LOST): _M.HOLD,
    (_M.HOLD, _E.FAR_FROM_TARGET): _M.TRANSIT,
    (_M.SEARCH, _E.TARGET_ACQUIRED): _M.APPROACH,
    (_M.SEARCH, _E.SEARCH_EXPIRED): _M.ABORT,
    (_M.SEARCH, _E.STEP_COMPLETE): _M.HOLD,
    (_M.SEARCH, _E.CAMERA_SILENT): _M.HOLD,
    (_M.APPROACH, _E.REORIENT_DUE): _M.REORIENT,
    (_M.APPROACH, _E.TARGET_LOST): _M.HOLD,
    (_M.REORIENT, _E.STATION_REACHED): _M.FOLLOW,
    (_M.REORIENT, _E.ALIGN_DUE): _M.ALIGN,
    (_M.REORIENT, _E.CONFIDENT): _M.LAND,
    (_M.REORIENT, _E.NO_PROGRESS): _M.GO_AROUND,
    (_M.REORIENT, _E.TARGET_LOST): _M.HOLD,
    (_M.FOLLOW, _E.FOLLOW_COMPLETE): _M.REORIENT,
    (_M.FOLLOW, _E.STEP_COMPLETE): _M.HOLD,
    (_M.FOLLOW, _E.TARGET_LOST): _M.HOLD,
    (_M.ALIGN, _E.SETTLED): _M.LAND,
    (_M.ALIGN, _E.HAND_OVER): _M.AUTOPILOT_LAND,
    (_M.ALIGN, _E.TARGET_MOVES): _M.ABORT,
    (_M.ALIGN, _E.TARGET_LOST): _M.GO_AROUND,
    (_M.LAND, _E.CONTACT): _M.TOUCHDOWN,
    (_M.LAND, _E.OUTSIDE_CONE): _M.GO_AROUND,
    (_M.LAND, _E.TARGET_LOST): _M.GO_AROUND,
    (_M.TOUCHDOWN, _E.LANDED): _M.DONE,
    (_M.TOUCHDOWN, _E.OUTSIDE_CONE): _M.GO_AROUND,
    (_M.AUTOPILOT_LAND, _E.LANDED): _M.DONE,
    (_M.AUTOPILOT_LAND, _E.LANDED_ELSEWHERE): _M.ABORT,
    (_M.AUTOPILOT_LAND, _E.NOT_TAKEN_UP): _M.ABORT,
    (_M.GO_AROUND, _E.CLIMBED): _M.APPROACH,
    (_M.GO_AROUND, _E.LANDED): _M.DONE,
    (_M.GO_AROUND, _E.TARGET_LOST): _M.HOLD,
    (_M.GO_AROUND, _E.ATTEMPTS_USED): _M.ABORT,
    (_M.HOLD, _E.TARGET_ACQUIRED): _M.APPROACH,
    (_M.HOLD, _E.HOLD_EXPIRED): _M.SEARCH,
    (_M.HOLD, _E.STEP_COMPLETE): _M.DONE,
    (_M.HOLD, _E.CAMERA_EXPIRED): _M.ABORT,
    (_M.HOLD, _E.WAY_UNKNOWN): _M.ABORT,
}
CHASING = (_M.TRANSIT, _M.APPROACH, _M.REORIENT, _M.FOLLOW, _M.ALIGN)
for _mode in CHASING:
    TRANSITIONS[(_mode, Event.BEYOND_FENCE)] = Mode.ABORT
# Whoever flies, and whatever happens on the way: these end the mission from every mode that is not already an end.
for _mode in Mode:
    if _mode not in (Mode.DONE, Mode.ABORT):
        TRANSITIONS[(_mode, Event.TAKEN_OVER)] = Mode.ABORT
    if _mode not in (Mode.DONE, Mode.ABORT, Mode.PREFLIGHT, Mode.TOUCHDOWN, Mode.AUTOPILOT_LAND):
        TRANSITIONS[(_mode, Event.DISARMED)] = Mode.ABORT
        TRANSITIONS[(_mode, Event.PRECLAND)] = Mode.AUTOPILOT_LAND

FINAL_MODES = frozenset({Mode.DONE, Mode.ABORT})


class IllegalTransitionError(RuntimeError):
    """An event that the mode does not know: a mistake in the program, never in the flight."""


def leads_to(transitions: Mapping[tuple[ModeT, EventT], ModeT], mode: ModeT, event: EventT) -> ModeT:
    """Give the mode that `event` leads to from `mode` by a table of transitions.

    Raises:
        IllegalTransitionError: the table has no such pair.
    """
    try:
        return transitions[(mode, event)]
    except KeyError:
        raise IllegalTransitionError(f"mode {mode.value} does not know the event {event.name}") from None


def next_mode(mode: Mode, event: Event) -> Mode:
    """Give the mode that `event` leads to from `mode`; see `leads_to`."""
    return leads_to(TRANSITIONS, mode, event)
