"""On the pad until the autopilot reports it: a vehicle that is seen to stand there is not lifted off soon."""

from dataclasses import replace

import pytest
from guidance_views import GEAR, track, view

from companion.guidance.checks import CHECKS, check_always
from companion.guidance.flying import _descent_rate
from companion.guidance.memory import Context, Memory
from companion.guidance.modes import Event, next_mode
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan
from companion.guidance.view import View, relative_state
from companion.messages.decision import Mode
from companion.messages.ownship import LandedState

P = GuidanceParameters()


def context(mode: Mode) -> Context:
    return Context(plan=FlightPlan(), parameters=P, memory=Memory(mode=mode, t_entered=0.0))


def seen(t: float, *, height: float, aside: float = 0.0, turned: float = 0.0, age: float = 0.05, **more) -> View:
    """A view of the pad from above.

    `height` of the feet, `aside` of the vehicle [m]; `turned`: heading error [rad]; `age` of the last sight [s].
    """
    return view(t, track=track(t, x=aside, z=GEAR + height, heading=turned, age=age), **more)


def disarmed(now: View) -> View:
    return replace(now, status=replace(now.status, armed=False))


def check(c: Context, now: View):
    relative = None if now.track is None else relative_state(now, now.track, P.descent)
    return CHECKS[c.memory.mode](c, now, relative)


@pytest.mark.parametrize(
    ("now", "patience"),
    [
        (lambda t: seen(t, height=0.02), P.descent.standing_timeout_s),
        (lambda t: seen(t, height=0.2), P.descent.contact_timeout_s),  # it does not stand
        (lambda t: seen(t, height=0.02, age=1.0), P.descent.contact_timeout_s),  # nobody sees whether it stands
        (view, P.descent.contact_timeout_s),
    ],
)
def test_no_landing_reported_leads_to_another_attempt_in_the_end(now, patience: float) -> None:
    c = context(Mode.TOUCHDOWN)
    assert check(c, now(patience - 0.1)) is None
    verdict = check(c, now(patience + 0.1))
    assert verdict is not None
    assert verdict[0] is Event.OUTSIDE_CONE
    assert f"{patience:.0f} s" in verdict[1]


@pytest.mark.parametrize("landed", list(LandedState))
def test_disarmed_on_the_pad_as_another_attempt_begins_is_a_landing(landed: LandedState) -> None:
    verdict = check_always(context(Mode.GO_AROUND), disarmed(seen(61.0, height=0.02, landed=landed)))
    assert verdict is not None
    assert verdict[0] is Event.LANDED
    assert next_mode(Mode.GO_AROUND, verdict[0]) is Mode.DONE


@pytest.mark.parametrize(
    ("mode", "now"),
    [
        (Mode.GO_AROUND, seen(61.0, height=0.5)),
        (Mode.GO_AROUND, seen(61.0, height=0.02, age=1.0)),
        (Mode.GO_AROUND, view(61.0)),
        (Mode.FOLLOW, seen(61.0, height=0.02)),
    ],
)
def test_disarmed_anywhere_else_is_disarmed_in_flight(mode: Mode, now: View) -> None:
    verdict = check_always(context(mode), disarmed(now))
    assert verdict is not None
    assert verdict[0] is Event.DISARMED
    assert next_mode(mode, verdict[0]) is Mode.ABORT


@pytest.mark.parametrize(
    ("aside", "turned", "age", "goes"),
    [
        (0.01, 0.0, 0.05, True),
        (0.04, 0.0, 0.05, False),  # seen, and not yet good enough
        (0.04, 0.0, 0.5, True),  # out of sight it will not get better
        (0.10, 0.0, 0.5, False),
        (0.01, 0.06, 0.05, False),
        (0.01, 0.06, 0.5, True),
    ],
)
def test_the_wait_at_the_gate_ends_when_the_pad_leaves_the_picture(
    aside: float, turned: float, age: float, goes: bool
) -> None:
    c = context(Mode.LAND)
    c.memory.height_reference = P.descent.gate_height_m
    now = seen(10.0, height=0.05, aside=aside, turned=turned, age=age)
    assert now.track is not None
    rate = _descent_rate(c, now, relative_state(now, now.track, P.descent))
    assert c.memory.gate_passed is goes
    assert rate == (P.descent.touchdown_speed_mps if goes else 0.0)
