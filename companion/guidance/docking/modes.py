"""The table of modes of a docking: which event leads from which mode to which."""

from __future__ import annotations

from enum import Enum

from companion.guidance.modes import leads_to
from companion.messages.docking import DockingMode


class DockingEvent(Enum):
    """What can happen to a docking."""

    POSITION_KNOWN = "the position is known well enough to set off"
    REORIENT_DUE = "time to turn to the docking attitude"
    ALIGN_DUE = "time to move in front of the docking face"
    DIRECT = "in front of the docking face already, with vision"
    SETTLED = "at rest in front of the docking face"
    ATTEMPT_FAILED = "off the corridor, blind, or no contact"
    BACKED_OFF = "clear of the docking face again"
    GIVEN_UP = "no attempts or no time left"
    CLEAR = "clear of the target, for good"
    CONTACT = "in contact"


_E, _M = DockingEvent, DockingMode

TRANSITIONS: dict[tuple[DockingMode, DockingEvent], DockingMode] = {
    (_M.WAIT, _E.POSITION_KNOWN): _M.APPROACH,
    (_M.APPROACH, _E.REORIENT_DUE): _M.REORIENT,
    (_M.REORIENT, _E.ALIGN_DUE): _M.ALIGN,
    (_M.REORIENT, _E.DIRECT): _M.DOCK,
    (_M.ALIGN, _E.SETTLED): _M.DOCK,
    (_M.ALIGN, _E.DIRECT): _M.DOCK,
    (_M.ALIGN, _E.ATTEMPT_FAILED): _M.RETREAT,
    (_M.DOCK, _E.ATTEMPT_FAILED): _M.RETREAT,
    (_M.RETREAT, _E.BACKED_OFF): _M.ALIGN,
    (_M.RETREAT, _E.CLEAR): _M.HOLD,
    # Far from the docking face the chaser stops where it is; near it, it moves out in front of it first.
    (_M.WAIT, _E.GIVEN_UP): _M.HOLD,
    (_M.APPROACH, _E.GIVEN_UP): _M.HOLD,
    (_M.REORIENT, _E.GIVEN_UP): _M.RETREAT,
    (_M.ALIGN, _E.GIVEN_UP): _M.RETREAT,
    (_M.DOCK, _E.GIVEN_UP): _M.RETREAT,
    (_M.RETREAT, _E.GIVEN_UP): _M.RETREAT,
}
for _mode in DockingMode:
    if _mode is not DockingMode.DOCKED:
        TRANSITIONS[(_mode, _E.CONTACT)] = _M.DOCKED


def next_mode(mode: DockingMode, event: DockingEvent) -> DockingMode:
    """Give the mode that `event` leads to from `mode`; see `leads_to`."""
    return leads_to(TRANSITIONS, mode, event)
