"""Early signs that somebody else takes the vehicle, besides the mode that the autopilot is in now."""

from __future__ import annotations

from typing import NamedTuple

from companion.messages.ownship import VehicleStatus


class Signs(NamedTuple):
    """What has been seen since the last look."""

    sticks_moved: bool  # away from where they were when the operator engaged
    mode_flickered: bool  # a mode has come and gone
    alarmed: bool  # the autopilot has told of a pilot's override, a kill or a failsafe


NO_SIGNS = Signs(False, False, False)


class PilotWatch:
    """Remembers where the sticks were when the operator engaged, and what the last look has counted.

    Sticks are compared with a place, not with the centre: a throttle rests anywhere. An axis that is first heard of
    later counts from there.

    Args:
        travel: of a stick, as a share of its way from centre to end, that counts as a pilot's hand.
    """

    def __init__(self, travel: float) -> None:
        self._travel = travel
        self._rest: dict[int, float] = {}
        self._mode_changes = 0
        self._takeover_events = 0

    def begin(self, status: VehicleStatus) -> None:
        """Start anew: what has been so far is no sign."""
        self._rest = {}
        self._mode_changes, self._takeover_events = status.mode_changes, status.takeover_events
        self._sticks_moved(status)

    def look(self, status: VehicleStatus) -> Signs:
        """Give the signs since the last look."""
        changes = status.mode_changes - self._mode_changes
        alarmed = status.takeover_events != self._takeover_events
        self._mode_changes, self._takeover_events = status.mode_changes, status.takeover_events
        return Signs(self._sticks_moved(status), changes > 1, alarmed)

    def _sticks_moved(self, status: VehicleStatus) -> bool:
        moved = False
        for axis, place in enumerate(status.sticks):
            if place is not None:
                moved |= abs(place - self._rest.setdefault(axis, place)) > self._travel
        return moved
