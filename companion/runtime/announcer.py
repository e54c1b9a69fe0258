"""What the pilot and the ground station are told of a flight: every change that matters, once, in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.link import events as link_events
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.ownship import VehicleStatus
from companion.messages.pilot import PilotText, Severity, Stand
from companion.messages.target import POSITION, Intercept, TargetTrack
from companion.runtime.landing_targets import position_std
from companion.runtime.ports import MissionState, MissionStatus

NEAR_GROUND_PARAMETER = "PLD_FAPPR_ALT"
_NEAR_GROUND_MARGIN = 0.3  # [m] above the gear, below which a camera does not see a pad any more
_S = GuardianState
_GOOD_ENDS = frozenset({MissionState.LANDED, MissionState.HELD})
_BAD_ENDS = frozenset({MissionState.REFUSED, MissionState.WRONG_VEHICLE, MissionState.NO_VEHICLE, MissionState.LOST})
_LOOKING = frozenset({Mode.APPROACH, Mode.REORIENT, Mode.FOLLOW, Mode.ALIGN, Mode.LAND, Mode.AUTOPILOT_LAND})
_GUARDIAN_WORDS = {
    _S.MUTED: (Severity.WARNING, "silent, not in control"),
    _S.HANDOVER: (Severity.NOTICE, "giving the vehicle back"),
    _S.BLIND: (Severity.WARNING, "braking blind"),
    _S.GAP: (Severity.WARNING, "silent for a moment"),
}
_SWITCHES = {
    Mode.ABORT: Severity.ERROR,
    Mode.GO_AROUND: Severity.WARNING,
    Mode.HOLD: Severity.NOTICE,
    Mode.AUTOPILOT_LAND: Severity.NOTICE,
    Mode.DONE: Severity.NOTICE,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Glance:
    """What one step offers to be told."""

    t: float  # [s]
    vehicle: VehicleStatus
    mission: MissionStatus
    decision: Decision | None  # of this step
    guardian: GuardianOutput
    track: TargetTrack | None
    intercept: Intercept | None
    t_frame: float  # [s] capture time of the newest picture, -inf before the first
    events: Sequence[link_events.LinkEvent]


class Announcer:
    """Compares each step with the one before; tells what is new.

    Args:
        unseen_s: time [s] without the pad, or without pictures, until that is told.
        gear_height: the body origin above the feet [m].
    """

    def __init__(self, *, unseen_s: float, gear_height: float) -> None:
        self._unseen = unseen_s
        self._gear_height = gear_height
        self._switch: Switch | None = None
        self._state = MissionState.WAITING
        self._guardian = _S.MUTED
        self._guardian_reason = ""
        self._engaged = False
        self._pad_lost = self._camera_lost = False
        self._t_running: float | None = None

    def news(self, g: Glance) -> list[PilotText]:
        """Give what is to be told of this step, in the order of its happening."""
        texts = [text for event in g.events if (text := self._of_event(event)) is not None]
        texts += self._of_guardian(g)
        texts += self._of_switch(g)
        texts += self._of_mission(g)
        texts += self._of_sight(g)
        return texts

    def stand(self, g: Glance) -> Stand:
        """Give who flies and how the mission stands."""
        state = g.mission.state
        if state in _GOOD_ENDS:
            return Stand.ENDED
        if g.mission.ended:
            return Stand.FAILED
        if g.mission.mode is Mode.AUTOPILOT_LAND and g.guardian.state is _S.MUTED:
            return Stand.GUIDING
        if g.guardian.state is not _S.MUTED:
            return Stand.ENGAGED
        return Stand.MUTED if self._engaged else Stand.WAITING

    def values(self, g: Glance) -> dict[str, float]:
        """Give the numbers for the pilot: all of the pad, so none without a track."""
        track = g.track
        if track is None:
            return {}
        forward, right, down = (float(value) for value in track.state[POSITION])
        values = {
            "pad_dist": math.hypot(forward, right),
            "pad_hgt": down - self._gear_height,
            "pad_std": position_std(track),
            "pad_age": track.age,
        }
        if g.intercept is not None and g.intercept.feasible:
            values["pad_tgo"] = max(0.0, g.intercept.t - g.t)
        return values

    def _of_guardian(self, g: Glance) -> list[PilotText]:
        before, now = self._guardian, g.guardian.state
        reason, said = g.guardian.reason, self._guardian_reason
        self._guardian, self._guardian_reason = now, reason
        if now is before:
            refused = now is _S.MUTED and reason != said and reason.startswith("cannot engage")
            return [PilotText(severity=Severity.ERROR, text=reason)] if refused else []
        if before is _S.MUTED:
            self._engaged = True
            return [PilotText(severity=Severity.NOTICE, text="engaged: streaming setpoints")]
        if now is _S.MUTED and (g.mission.mode is Mode.AUTOPILOT_LAND or before in (_S.LEAVING, _S.HANDOVER)):
            return [PilotText(severity=Severity.INFO, text=f"setpoints stopped: {reason}")]
        if now in _GUARDIAN_WORDS:
            severity, words = _GUARDIAN_WORDS[now]
            mode = f" ({g.vehicle.mode.value})" if now is _S.MUTED else ""
            return [PilotText(severity=severity, text=f"{words}: {reason}{mode}")]
        return []

    def _of_switch(self, g: Glance) -> list[PilotText]:
        switch = None if g.decision is None else g.decision.switched
        if switch is None or switch is self._switch:
            return []
        self._switch = switch
        severity = _SWITCHES.get(switch.mode, Severity.INFO)
        return [PilotText(severity=severity, text=f"{switch.mode.value}: {switch.reason}")]

    def _of_mission(self, g: Glance) -> list[PilotText]:
        mission = g.mission
        if mission.state is self._state:
            return []
        self._state = mission.state
        if mission.state is MissionState.RUNNING:
            self._t_running = g.t
            return [PilotText(severity=Severity.INFO, text=f"mission begins: {mission.reason}")]
        if mission.state in _BAD_ENDS:
            return [PilotText(severity=Severity.ERROR, text=f"mission {mission.state.value}: {mission.reason}")]
        severity = Severity.NOTICE if mission.state in _GOOD_ENDS else Severity.ERROR
        said = mission.reason == (self._switch.reason if self._switch is not None else None)
        words = "" if said else f": {mission.reason}"
        return [PilotText(severity=severity, text=f"mission over, {mission.state.value}{words}")]

    def _of_sight(self, g: Glance) -> list[PilotText]:
        if self._t_running is None or g.mission.ended:
            return []
        silent = g.t - max(g.t_frame, self._t_running)
        if (silent > self._unseen) != self._camera_lost:
            self._camera_lost = not self._camera_lost
            if not self._camera_lost:
                return [PilotText(severity=Severity.NOTICE, text="camera: pictures again")]
            return [PilotText(severity=Severity.ERROR, text=f"camera: no pictures for {silent:.1f} s")]
        return [] if self._camera_lost else self._of_pad(g)

    def _of_pad(self, g: Glance) -> list[PilotText]:
        mode = g.mission.mode
        if g.track is not None and g.track.age <= self._unseen:
            lost, self._pad_lost = self._pad_lost, False
            return [PilotText(severity=Severity.NOTICE, text="pad in sight again")] if lost else []
        if self._pad_lost or mode not in _LOOKING:
            return []
        self._pad_lost = True
        if mode is Mode.AUTOPILOT_LAND:
            text = "pad lost: the autopilot may search, then land where it is"
            return [PilotText(severity=Severity.CRITICAL, text=text)]
        return [PilotText(severity=Severity.WARNING, text=f"pad not seen for {self._unseen:.1f} s")]

    def _of_event(self, event: link_events.LinkEvent) -> PilotText | None:
        if isinstance(event, link_events.ParameterRead) and event.name == NEAR_GROUND_PARAMETER:
            wanted = self._gear_height + _NEAR_GROUND_MARGIN
            if event.value is None or event.value >= wanted:
                return None
            text = f"{event.name} is {event.value:.2f}: below {wanted:.2f} the autopilot may climb again from the pad"
            return PilotText(severity=Severity.WARNING, text=text)
        return _of_event(event)


def _of_event(event: link_events.LinkEvent) -> PilotText | None:
    match event:
        case link_events.ArmingRefused():
            return PilotText(severity=Severity.ERROR, text=f"arming refused: {event.reasons[0]}")
        case link_events.CommandFinished() if not event.accepted:
            return PilotText(severity=Severity.WARNING, text=f"{event.command}: {event.text}")
        case link_events.EstimatorReset():
            return PilotText(severity=Severity.NOTICE, text="the autopilot's position estimate has jumped")
        case link_events.AutopilotRestarted():
            return PilotText(severity=Severity.ERROR, text="the autopilot has restarted")
        case link_events.Lost():
            return PilotText(severity=Severity.ERROR, text=f"no heartbeat of the autopilot for {event.silence:.1f} s")
        case link_events.RateShort():
            text = f"{event.message} at {event.measured:.0f} Hz only, {event.asked:.0f} asked"
            return PilotText(severity=Severity.NOTICE, text=text)
    return None
