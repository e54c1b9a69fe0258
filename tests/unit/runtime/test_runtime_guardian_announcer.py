from __future__ import annotations

from dataclasses import replace

import pytest

from companion.link.events import ArmingRefused, CommandFinished
from companion.messages.decision import Mode
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.news import End, MissionNews
from companion.messages.ownship import FlightMode, LandedState, SystemStatus, VehicleStatus
from companion.messages.pilot import PilotText, Severity, Stand
from companion.runtime.guardian_announcer import GuardianAnnouncer, GuardianGlance

VEHICLE = VehicleStatus(
    t=0.0,
    connected=True,
    armed=True,
    mode=FlightMode.OFFBOARD,
    landed=LandedState.IN_AIR,
    system_status=SystemStatus.ACTIVE,
    estimate_valid=True,
    battery_remaining=None,
)


def guardian(state: GuardianState, reason: str = "") -> GuardianOutput:
    return GuardianOutput(t=0.0, state=state, setpoint=None, request=None, clips=(), reason=reason)


class Tick:
    def __init__(self) -> None:
        self.announcer = GuardianAnnouncer(gear_height=0.2)
        self.glance = GuardianGlance(
            vehicle=VEHICLE,
            guardian=guardian(GuardianState.FOLLOWING),
            mission=MissionNews(mode=Mode.SEARCH),
            events=(),
        )
        self.tell()

    def tell(self, **changed) -> list[PilotText]:
        self.glance = replace(self.glance, **({"events": ()} | changed))
        return self.announcer.news(self.glance)


@pytest.mark.parametrize("state", [GuardianState.MUTED, GuardianState.HANDOVER, GuardianState.BLIND, GuardianState.GAP])
def test_losing_control_is_told_with_its_reason(state: GuardianState) -> None:
    (text,) = Tick().tell(guardian=guardian(state, "the autopilot is in a mode that we did not ask for"))
    assert "a mode that we did not ask for" in text.text


def test_a_refusal_to_engage_is_told_once() -> None:
    tick = Tick()
    tick.tell(guardian=guardian(GuardianState.MUTED, "waiting"))
    refused = guardian(GuardianState.MUTED, "cannot engage: the vehicle is outside of the fence")
    (text,) = tick.tell(guardian=refused)
    assert (text.severity, text.text) == (Severity.ERROR, refused.reason)
    assert tick.tell() == []


def test_refused_commands_and_arming_are_told() -> None:
    arming = ArmingRefused(t=1.0, result="denied", unhealthy=("gyroscope",), autopilot_events=(), status_texts=())
    mode = CommandFinished(t=1.0, command="mode OFFBOARD", accepted=False, result=1, text="no answer after 3 attempts")
    done = CommandFinished(t=1.0, command="arm", accepted=True, result=0, text="done")
    texts = [text.text for text in Tick().tell(events=(arming, mode, done))]
    assert texts == ["arming refused: unhealthy: gyroscope", "mode OFFBOARD: no answer after 3 attempts"]


@pytest.mark.parametrize(
    ("end", "mode", "guarding", "stand"),
    [
        (None, Mode.SEARCH, GuardianState.FOLLOWING, Stand.ENGAGED),
        (None, Mode.SEARCH, GuardianState.MUTED, Stand.MUTED),
        (None, Mode.AUTOPILOT_LAND, GuardianState.MUTED, Stand.GUIDING),
        (End.AS_ASKED, Mode.DONE, GuardianState.MUTED, Stand.ENDED),
        (End.OTHERWISE, Mode.ABORT, GuardianState.MUTED, Stand.FAILED),
    ],
)
def test_the_stand_tells_who_flies(end: End | None, mode: Mode, guarding: GuardianState, stand: Stand) -> None:
    tick = Tick()
    tick.tell(mission=MissionNews(mode=mode, end=end), guardian=guardian(guarding))
    assert tick.announcer.stand(tick.glance) is stand


@pytest.mark.parametrize("mission", [None, MissionNews()])
def test_before_anything_is_engaged_it_waits(mission: MissionNews | None) -> None:
    glance = replace(Tick().glance, guardian=guardian(GuardianState.MUTED), mission=mission)
    assert GuardianAnnouncer(gear_height=0.2).stand(glance) is Stand.WAITING
