from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.link.events import ArmingRefused, CommandFinished
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.ownship import FlightMode, LandedState, SystemStatus, VehicleStatus
from companion.messages.pilot import PilotText, Severity, Stand
from companion.messages.target import TargetTrack
from companion.runtime.announcer import Announcer, Glance
from companion.runtime.ports import MissionState, MissionStatus

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


def mission(state: MissionState = MissionState.RUNNING, mode: Mode = Mode.SEARCH, reason: str = "") -> MissionStatus:
    return MissionStatus(state=state, mode=mode, reason=reason, t=0.0)


def track(age: float = 0.0) -> TargetTrack:
    return TargetTrack(
        t=10.0,
        t_measured=10.0 - age,
        state=np.array([3.0, 4.0, 2.2, 0.0, 0.0, 0.0, 0.0, 0.0]),
        covariance=0.01 * np.eye(8),
        position_ned=np.zeros(3),
        velocity_ned=np.zeros(3),
        yaw_ned=0.0,
        reset_counter=0,
        nis=1.0,
        nis_mean=1.0,
        fused=9,
    )


class Step:
    def __init__(self) -> None:
        self.announcer = Announcer(unseen_s=1.0, gear_height=0.2)
        self.glance = Glance(
            t=10.0,
            vehicle=VEHICLE,
            mission=mission(),
            decision=None,
            guardian=guardian(GuardianState.FOLLOWING),
            track=None,
            intercept=None,
            t_frame=10.0,
            events=(),
        )
        self.tell()

    def tell(self, **changed) -> list[PilotText]:
        self.glance = replace(self.glance, **({"events": ()} | changed))
        return self.announcer.news(self.glance)


@pytest.mark.parametrize("mode", list(Mode))
def test_every_switch_is_told_once_with_its_reason(mode: Mode) -> None:
    step = Step()
    decision = Decision(t=10.0, mode=mode, switched=Switch(t=10.0, mode=mode, reason="so"), probabilities=None)
    texts = step.tell(decision=decision)
    assert [text.text for text in texts if text.text.startswith(mode.value)] == [f"{mode.value}: so"]
    assert step.tell() == []


@pytest.mark.parametrize("state", [GuardianState.MUTED, GuardianState.HANDOVER, GuardianState.BLIND, GuardianState.GAP])
def test_losing_control_is_told_with_its_reason(state: GuardianState) -> None:
    (text,) = Step().tell(guardian=guardian(state, "the autopilot is in a mode that we did not ask for"))
    assert "a mode that we did not ask for" in text.text


def test_a_refusal_to_engage_is_told_once() -> None:
    step = Step()
    step.tell(guardian=guardian(GuardianState.MUTED, "waiting"))
    refused = guardian(GuardianState.MUTED, "cannot engage: the vehicle is outside of the fence")
    (text,) = step.tell(guardian=refused)
    assert (text.severity, text.text) == (Severity.ERROR, refused.reason)
    assert step.tell() == []


def test_refused_commands_and_arming_are_told() -> None:
    arming = ArmingRefused(t=1.0, result="denied", unhealthy=("gyroscope",), autopilot_events=(), status_texts=())
    mode = CommandFinished(t=1.0, command="mode OFFBOARD", accepted=False, result=1, text="no answer after 3 attempts")
    done = CommandFinished(t=1.0, command="arm", accepted=True, result=0, text="done")
    texts = [text.text for text in Step().tell(events=(arming, mode, done))]
    assert texts == ["arming refused: unhealthy: gyroscope", "mode OFFBOARD: no answer after 3 attempts"]


@pytest.mark.parametrize("state", [state for state in MissionState if state.value not in ("waiting", "running")])
def test_every_end_is_told(state: MissionState) -> None:
    (text,) = Step().tell(mission=mission(state, reason="why it ended"))
    assert state.value in text.text
    assert "why it ended" in text.text
    assert (text.severity is Severity.NOTICE) is (state in (MissionState.LANDED, MissionState.HELD))


def test_pad_and_camera_are_told_when_lost_and_when_back() -> None:
    step = Step()
    step.tell(mission=mission(mode=Mode.ALIGN), track=track())
    (lost,) = step.tell(track=track(1.2))
    assert (lost.severity, lost.text) == (Severity.WARNING, "pad not seen for 1.0 s")
    assert step.tell(track=None) == []
    (dead,) = step.tell(t=11.5)
    assert (dead.severity, dead.text) == (Severity.ERROR, "camera: no pictures for 1.5 s")
    (back,) = step.tell(t_frame=11.5)
    assert back.text == "camera: pictures again"
    (seen,) = step.tell(track=track())
    assert seen.text == "pad in sight again"


def test_a_pad_lost_while_the_autopilot_lands_is_critical() -> None:
    step = Step()
    step.tell(mission=mission(mode=Mode.AUTOPILOT_LAND), track=track())
    (text,) = step.tell(track=track(1.2))
    assert text.severity is Severity.CRITICAL


@pytest.mark.parametrize(
    ("state", "mode", "guarding", "stand"),
    [
        (MissionState.RUNNING, Mode.SEARCH, GuardianState.FOLLOWING, Stand.ENGAGED),
        (MissionState.RUNNING, Mode.SEARCH, GuardianState.MUTED, Stand.MUTED),
        (MissionState.RUNNING, Mode.AUTOPILOT_LAND, GuardianState.MUTED, Stand.GUIDING),
        (MissionState.LANDED, Mode.DONE, GuardianState.MUTED, Stand.ENDED),
        (MissionState.ABORTED, Mode.ABORT, GuardianState.MUTED, Stand.FAILED),
    ],
)
def test_the_stand_tells_who_flies(state: MissionState, mode: Mode, guarding: GuardianState, stand: Stand) -> None:
    step = Step()
    step.tell(mission=mission(state, mode), guardian=guardian(guarding))
    assert step.announcer.stand(step.glance) is stand


def test_before_anything_is_engaged_it_waits() -> None:
    glance = replace(Step().glance, guardian=guardian(GuardianState.MUTED), mission=mission(MissionState.WAITING))
    assert Announcer(unseen_s=1.0, gear_height=0.2).stand(glance) is Stand.WAITING


def test_the_numbers_are_of_the_pad() -> None:
    step = Step()
    assert step.announcer.values(step.glance) == {}
    step.tell(track=track(0.5))
    values = step.announcer.values(step.glance)
    assert values["pad_dist"] == pytest.approx(5.0)
    assert values["pad_hgt"] == pytest.approx(2.0)
    assert values["pad_std"] == pytest.approx(0.1)
    assert values["pad_age"] == pytest.approx(0.5)
    assert all(len(name) <= 9 and math.isfinite(value) for name, value in values.items())
