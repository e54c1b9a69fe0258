"""What the guardian's side tells the pilot and the ground station: who flies, what was refused. It needs no planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from companion.link import events as link_events
from companion.messages.decision import Mode
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.news import End, MissionNews
from companion.messages.ownship import VehicleStatus
from companion.messages.pilot import PilotText, Severity, Stand

NEAR_GROUND_PARAMETER = "PLD_FAPPR_ALT"
_NEAR_GROUND_MARGIN = 0.3  # [m] above the gear, below which a camera does not see a pad any more
_S = GuardianState
_GUARDIAN_WORDS = {
    _S.MUTED: (Severity.WARNING, "silent, not in control"),
    _S.HANDOVER: (Severity.NOTICE, "giving the vehicle back"),
    _S.BLIND: (Severity.WARNING, "braking blind"),
    _S.GAP: (Severity.WARNING, "silent for a moment"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardianGlance:
    """What one tick offers to be told."""

    vehicle: VehicleStatus
    guardian: GuardianOutput
    mission: MissionNews | None  # the planner's last word; None before its first
    events: Sequence[link_events.LinkEvent]

    @property
    def autopilot_lands(self) -> bool:
        """Whether the mission is at the autopilot's own landing."""
        return self.mission is not None and self.mission.mode is Mode.AUTOPILOT_LAND


class GuardianAnnouncer:
    """Compares each tick with the one before; tells what is new.

    Args:
        gear_height: the body origin above the feet [m].
    """

    def __init__(self, *, gear_height: float) -> None:
        self._gear_height = gear_height
        self._guardian = _S.MUTED
        self._guardian_reason = ""
        self._engaged = False

    def news(self, g: GuardianGlance) -> list[PilotText]:
        """Give what is to be told of this tick, in the order of its happening."""
        texts = [text for event in g.events if (text := self._of_event(event)) is not None]
        return texts + self._of_guardian(g)

    def stand(self, g: GuardianGlance) -> Stand:
        """Give who flies and how the mission stands."""
        if g.mission is not None and g.mission.end is not None:
            return Stand.ENDED if g.mission.end is End.AS_ASKED else Stand.FAILED
        if g.guardian.state is not _S.MUTED:
            return Stand.ENGAGED
        if g.autopilot_lands:
            return Stand.GUIDING
        return Stand.MUTED if self._engaged else Stand.WAITING

    def _of_guardian(self, g: GuardianGlance) -> list[PilotText]:
        before, now = self._guardian, g.guardian.state
        reason, said = g.guardian.reason, self._guardian_reason
        self._guardian, self._guardian_reason = now, reason
        if now is before:
            refused = now is _S.MUTED and reason != said and reason.startswith("cannot engage")
            return [PilotText(severity=Severity.ERROR, text=reason)] if refused else []
        if before is _S.MUTED:
            self._engaged = True
            return [PilotText(severity=Severity.NOTICE, text="engaged: streaming setpoints")]
        if now is _S.MUTED and (g.autopilot_lands or before in (_S.LEAVING, _S.HANDOVER)):
            return [PilotText(severity=Severity.INFO, text=f"setpoints stopped: {reason}")]
        if now in _GUARDIAN_WORDS:
            severity, words = _GUARDIAN_WORDS[now]
            mode = f" ({g.vehicle.mode.value})" if now is _S.MUTED else ""
            return [PilotText(severity=severity, text=f"{words}: {reason}{mode}")]
        return []

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
