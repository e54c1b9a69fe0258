"""What a tick finds, and which event it is."""

from __future__ import annotations

from dataclasses import dataclass

from companion.guardian.machine import Event
from companion.guardian.parameters import GuardianParameters
from companion.guardian.pilot import Signs
from companion.messages.guardian import GuardianState
from companion.messages.ownship import FlightMode, SystemStatus, VehicleStatus

_FAILED = frozenset(
    {SystemStatus.CRITICAL, SystemStatus.EMERGENCY, SystemStatus.POWEROFF, SystemStatus.FLIGHT_TERMINATION}
)
_BOOTING = frozenset({SystemStatus.UNINIT, SystemStatus.BOOT, SystemStatus.CALIBRATING})
_BEFORE = frozenset({GuardianState.PRESTREAM, GuardianState.REQUESTING})
_AFTER = frozenset({GuardianState.HANDOVER, GuardianState.LEAVING})


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """Everything that decides the event of a tick."""

    state: GuardianState
    status: VehicleStatus | None
    own_mode: FlightMode  # in which the autopilot takes our setpoints
    mode_before: FlightMode  # when the operator engaged
    signs: Signs  # of somebody else, since the tick before
    was_armed: bool  # since the operator engaged
    ownship_age: float  # [s] infinite where there is none
    pause: float  # [s] since the tick before
    silent_for: float  # [s] since the last setpoint
    in_state_for: float  # [s]
    unfollowed_for: float  # [s] in the air without a trajectory to follow
    followable: bool  # there is a trajectory to follow
    unanswered: bool  # all requests for a mode have been made and waited for
    engage: bool  # the operator has just engaged, and nothing speaks against it
    disengage: bool
    finish: bool


def distressed(status: VehicleStatus, was_armed: bool) -> bool:
    """Say whether the autopilot reports a failsafe, a kill, or, after arming, a reboot."""
    if status.mode is FlightMode.TERMINATION or status.system_status in _FAILED:
        return True
    return was_armed and status.system_status in _BOOTING


def classify(s: Situation, parameters: GuardianParameters) -> Event:
    """Name the most urgent thing that a tick found; pure."""
    if s.state is GuardianState.MUTED:
        return Event.ENGAGE if s.engage else Event.STAY
    if s.status is None or not s.status.connected:
        return Event.LINK_LOST
    if distressed(s.status, s.was_armed) or s.signs.alarmed:
        return Event.DISTRESS
    if s.signs.sticks_moved:
        return Event.STICKS
    event = _mode_event(s, s.status)
    if event is Event.STAY and s.state is not GuardianState.LEAVING:
        event = _own_event(s, s.status, parameters)
    if event is Event.STAY:
        event = _progress_event(s, s.status, parameters)
    return event


def _mode_event(s: Situation, status: VehicleStatus) -> Event:
    """Look at the autopilot's mode: is it ours?"""
    in_own_mode = status.mode is s.own_mode
    if s.state in _AFTER:
        # The tick that asked for the mode is over: whatever is not our mode now is not ours.
        return Event.STAY if in_own_mode else Event.LEFT_OWN_MODE
    if s.state in _BEFORE:
        taken_off = s.mode_before is FlightMode.AUTO_TAKEOFF and status.mode is FlightMode.AUTO_LOITER
        # PX4, disarmed and never told a mode, goes to Position by itself when sticks arrive: ours do
        by_sticks = s.own_mode is FlightMode.ACRO and status.mode is FlightMode.POSCTL and not status.armed
        ours = in_own_mode or status.mode is s.mode_before or taken_off or by_sticks
    else:
        ours = in_own_mode and not s.signs.mode_flickered
    return Event.STAY if ours else Event.MODE_TAKEN


def _own_event(s: Situation, status: VehicleStatus, parameters: GuardianParameters) -> Event:
    """Look at what must hold to stream at all."""
    if not status.estimate_valid:
        return Event.ESTIMATE_INVALID
    if s.was_armed and not status.armed:
        return Event.DISARMED
    if s.finish and not status.armed:
        return Event.FINISH
    resumable = s.state not in _BEFORE and s.state is not GuardianState.HANDOVER
    if resumable and s.silent_for > parameters.resume_within:
        return Event.OVERDUE
    if max(s.ownship_age, s.pause) > parameters.ownship_lost:
        return Event.LOST
    if s.disengage and s.state is not GuardianState.HANDOVER:
        return Event.DISENGAGE
    return Event.STAY


def _progress_event(s: Situation, status: VehicleStatus, parameters: GuardianParameters) -> Event:
    """Look at what comes next when all is well."""
    if s.state in _AFTER or s.state is GuardianState.REQUESTING:
        if status.mode is s.own_mode and s.state is GuardianState.REQUESTING:
            return Event.IN_OWN_MODE
        return Event.UNANSWERED if s.unanswered else Event.STAY
    if s.state is GuardianState.PRESTREAM:
        if status.mode is s.own_mode:
            return Event.IN_OWN_MODE
        return Event.PRESTREAMED if s.in_state_for >= parameters.prestream else Event.STAY
    if s.ownship_age > parameters.ownship_stale:
        return Event.STALE
    if s.state is GuardianState.GAP:
        return Event.NOTHING_TO_FOLLOW  # after a gap the first setpoint is "hold here"
    if s.followable:
        return Event.FOLLOW
    if s.state is GuardianState.HOLDING and s.unfollowed_for > parameters.silence_to_handover:
        return Event.SILENT
    return Event.NOTHING_TO_FOLLOW
