"""Early signs that somebody else takes the vehicle, besides the mode that the autopilot is in now."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from companion.messages.motion import SticksSetpoint
from companion.messages.ownship import VehicleStatus

_CHANNELS = 4  # of the transmitter; behind them the four sticks that the autopilot obeys
_ROLL, _THROTTLE = 5, 6  # of these, those that a rover is driven by
_ECHO_S = 1.0  # [s] after which the autopilot must have stopped telling of sticks that we have sent


class Signs(NamedTuple):
    """What has been seen since the last look."""

    sticks_moved: bool  # away from where they were when the operator engaged
    mode_flickered: bool  # a mode has come and gone
    alarmed: bool  # the autopilot has told of a pilot's override, a kill or a failsafe


NO_SIGNS = Signs(False, False, False)


class PilotWatch:
    """Remembers where the sticks were when the operator engaged, and what the last look has counted.

    Sticks are compared with a place, not with the centre: a throttle rests anywhere. An axis that is first heard of
    later counts from there. Where this program itself drives by sticks, the autopilot tells of those that it obeys:
    ours, so they are compared with what we have sent of late; anything else is somebody else's hand.

    Args:
        travel: of a stick, as a share of its way from centre to end, that counts as a pilot's hand.
    """

    def __init__(self, travel: float) -> None:
        self._travel = travel
        self._rest: dict[int, float] = {}
        self._own: deque[tuple[float, float, float]] = deque()  # t [s], steering and throttle that we have sent
        self._mode_changes = 0
        self._takeover_events = 0

    def own_sticks(self, t: float, sticks: SticksSetpoint) -> None:
        """Take note of sticks that are sent at `t` [s]."""
        self._own.append((t, sticks.steering, sticks.throttle))
        while self._own[0][0] < t - _ECHO_S:
            self._own.popleft()

    def begin(self, status: VehicleStatus) -> None:
        """Start anew: what has been so far is no sign."""
        self._rest = {}
        self._own.clear()
        self._mode_changes, self._takeover_events = status.mode_changes, status.takeover_events
        self._sticks_moved(status)

    def look(self, status: VehicleStatus) -> Signs:
        """Give the signs since the last look."""
        changes = status.mode_changes - self._mode_changes
        alarmed = status.takeover_events != self._takeover_events
        self._mode_changes, self._takeover_events = status.mode_changes, status.takeover_events
        return Signs(self._sticks_moved(status), changes > 1, alarmed)

    def _sticks_moved(self, status: VehicleStatus) -> bool:
        moved = bool(self._own) and self._is_anothers(status.sticks)
        for axis, place in enumerate(status.sticks[:_CHANNELS] if self._own else status.sticks):
            if place is not None:
                moved |= abs(place - self._rest.setdefault(axis, place)) > self._travel
        return moved

    def _is_anothers(self, sticks: tuple[float | None, ...]) -> bool:
        """Say whether the autopilot obeys sticks that we have not sent of late."""
        if len(sticks) <= _THROTTLE:
            return False
        told = (sticks[_ROLL], sticks[_THROTTLE])
        return not any(
            all(heard is None or abs(heard - sent) <= self._travel for heard, sent in zip(told, own, strict=True))
            for own in ((0.0, 0.0), *((steering, throttle) for _, steering, throttle in self._own))
        )
