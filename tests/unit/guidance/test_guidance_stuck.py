"""A target that cannot be reached: behind the fence, or for no known reason. The mission does not hover for ever."""

import pytest
from guidance_views import view

from companion.guidance.checks import check_always
from companion.guidance.machine import Guidance
from companion.guidance.memory import Context, Memory
from companion.guidance.modes import CHASING, Event, next_mode
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan
from companion.messages.decision import Mode

P = GuidanceParameters()


def context(mode: Mode) -> Context:
    return Context(plan=FlightPlan(), parameters=P, memory=Memory(mode=mode, t_entered=0.0))


def look(c: Context, t: float, *, at_fence: bool):
    return check_always(c, view(t, at_fence=at_fence))


@pytest.mark.parametrize("mode", CHASING)
def test_a_target_that_stays_beyond_the_fence_ends_the_mission(mode: Mode) -> None:
    c = context(mode)
    assert look(c, 10.0, at_fence=True) is None
    assert look(c, 10.0 + P.fence_patience_s - 0.1, at_fence=True) is None
    verdict = look(c, 10.0 + P.fence_patience_s + 0.1, at_fence=True)
    assert verdict is not None
    assert verdict[0] is Event.BEYOND_FENCE
    assert "out of the fence" in verdict[1]
    assert next_mode(mode, verdict[0]) is Mode.ABORT


def test_a_target_that_comes_back_is_followed_on() -> None:
    c = context(Mode.FOLLOW)
    for t in range(20):
        assert look(c, float(t), at_fence=t % 5 != 4) is None


@pytest.mark.parametrize("mode", [Mode.TAKEOFF, Mode.SEARCH, Mode.HOLD, Mode.LAND])
def test_elsewhere_the_fence_is_no_reason_to_end(mode: Mode) -> None:
    c = context(mode)
    assert look(c, 0.0, at_fence=True) is None
    assert look(c, 60.0, at_fence=True) is None


def test_a_point_that_is_not_reached_counts_as_an_attempt_that_failed() -> None:
    guidance = Guidance(FlightPlan(), P)
    guidance._c.memory.mode = Mode.REORIENT
    guidance._enter(view(0.0), None, Event.NO_PROGRESS, "after 60 s")
    assert guidance._c.memory.mode is Mode.GO_AROUND
    assert guidance.attempts == 1
