from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.messages.decision import Decision, Mode, Switch
from companion.messages.news import TEXTS_MAX, End
from companion.messages.pilot import PilotText, Severity
from companion.messages.target import TargetTrack
from companion.runtime.mission_announcer import MissionAnnouncer, MissionGlance
from companion.runtime.ports import MissionState, MissionStatus


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
        t_began=0.0,
    )


class Step:
    def __init__(self) -> None:
        self.announcer = MissionAnnouncer(unseen_s=1.0, gear_height=0.2)
        self.glance = MissionGlance(
            t=10.0,
            mission=mission(),
            decision=None,
            track=None,
            intercept=None,
            t_frame=10.0,
        )
        self.tell()

    def tell(self, **changed) -> list[PilotText]:
        self.glance = replace(self.glance, **changed)
        return self.announcer.news(self.glance)


@pytest.mark.parametrize("mode", list(Mode))
def test_every_switch_is_told_once_with_its_reason(mode: Mode) -> None:
    step = Step()
    decision = Decision(t=10.0, mode=mode, switched=Switch(t=10.0, mode=mode, reason="so"), probabilities=None)
    texts = step.tell(decision=decision)
    assert [text.text for text in texts if text.text.startswith(mode.value)] == [f"{mode.value}: so"]
    assert step.tell() == []


@pytest.mark.parametrize(
    "state", [state for state in MissionState if state.value not in ("waiting", "standby", "running")]
)
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


def test_each_wait_for_the_operator_is_told() -> None:
    step = Step()
    (ready,) = step.tell(mission=mission(MissionState.STANDBY, reason="ready"))
    assert (ready.severity, ready.text) == (Severity.NOTICE, "ready")
    assert step.tell() == []
    (refused,) = step.tell(mission=mission(MissionState.STANDBY, reason="arming was refused"))
    assert refused.text == "arming was refused"
    assert step.tell(t=99.0, track=None) == []  # no word of camera and pad while nothing flies


def test_a_text_is_handed_over_for_a_while_and_counted_once() -> None:
    step = Step()
    before = step.announcer.report(step.glance, None).said
    step.glance = replace(step.glance, mission=mission(MissionState.ABORTED, reason="why"))
    first = step.announcer.report(step.glance, None)
    again = step.announcer.report(replace(step.glance, t=10.4), None)
    late = step.announcer.report(replace(step.glance, t=10.6), None)
    assert [len(news.texts) for news in (first, again, late)] == [1, 1, 0]
    assert [news.said - before for news in (first, again, late)] == [1, 1, 1]
    assert first.end is End.OTHERWISE


def test_of_many_texts_the_newest_are_handed_over() -> None:
    step = Step()
    for k in range(2 * TEXTS_MAX):
        step.glance = replace(step.glance, t=10.0 + 0.01 * k, mission=mission(MissionState.STANDBY, reason=f"{k}"))
        news = step.announcer.report(step.glance, None)
    assert [text.text for text in news.texts] == [f"{k}" for k in range(TEXTS_MAX, 2 * TEXTS_MAX)]
