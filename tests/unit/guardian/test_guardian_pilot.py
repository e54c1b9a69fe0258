"""Whoever has the sticks, the switches or the autopilot's failsafe has the vehicle."""

from dataclasses import replace

import numpy as np
import pytest
from guardian_bench import Bench, status

from companion.guardian.machine import TABLE, Event
from companion.guardian.pilot import PilotWatch, Signs
from companion.messages.guardian import GuardianState
from companion.messages.ownship import FlightMode, LandedState

S = GuardianState
QUIET = Signs(False, False, False)


def silent(outputs):
    return all(out.setpoint is None and out.request is None for out in outputs)


def in_state(state):
    """A bench whose guardian is in a state that the pilot may interrupt."""
    bench = Bench()
    bench.status = replace(bench.status, sticks=(0.0, 0.1, -0.8, 0.0, None, None, None, None))
    if state in (S.PRESTREAM, S.REQUESTING):
        bench.obeys = False
        bench.guardian.engage(bench.t)
        bench.run(0.5 if state is S.PRESTREAM else 1.2)
    elif state is S.HOLDING:
        bench.engaged()
    else:
        bench.following()
    if state is S.BLIND:
        bench.odometry = False
        bench.run(0.16)
    elif state is S.GAP:
        bench.odometry = False
        bench.run(0.4)
    elif state is S.HANDOVER:
        bench.obeys = False
        bench.guardian.disengage(bench.t)
        bench.tick()
    elif state is S.LEAVING:
        bench.obeys = False
        bench.status = replace(bench.status, armed=False)
        bench.run(0.1)
    assert bench.out.state is state, bench.out
    return bench


SIGNS = {
    "roll": lambda s: replace(s, sticks=(0.2, *s.sticks[1:])),
    "throttle": lambda s: replace(s, sticks=(*s.sticks[:2], -0.6, *s.sticks[3:])),
    "event": lambda s: replace(s, takeover_events=s.takeover_events + 1),
}


@pytest.mark.parametrize("sign", SIGNS)
@pytest.mark.parametrize("state", [s for s in S if s is not S.MUTED], ids=lambda s: s.value)
def test_sticks_and_alarms_mute_in_the_same_tick_from_every_state_for_good(state, sign):
    bench = in_state(state)
    before = bench.status
    bench.requests.clear()
    bench.status = SIGNS[sign](before)
    out = bench.tick()
    assert out.state is S.MUTED
    assert silent([out])
    bench.status = replace(before, takeover_events=bench.status.takeover_events)  # the stick goes back
    bench.odometry = True
    assert silent(bench.run(5.0))
    assert bench.requests == []


def test_the_table_lets_the_sticks_mute_every_state():
    assert {state for (state, event) in TABLE if event is Event.STICKS} == set(S) - {S.MUTED}


@pytest.mark.parametrize("state", [S.FOLLOWING, S.HOLDING])
def test_a_mode_that_came_and_went_between_two_ticks_mutes(state):
    bench = in_state(state)
    bench.status = replace(bench.status, mode_changes=bench.status.mode_changes + 2)  # in OFFBOARD again
    assert bench.tick().state is S.MUTED


def test_our_own_change_to_offboard_is_no_takeover():
    bench = Bench()
    bench.obeys = False
    bench.guardian.engage(bench.t)
    bench.run(1.1)
    bench.status = replace(bench.status, mode=FlightMode.OFFBOARD, mode_changes=1)
    assert bench.tick().state is S.HOLDING
    assert bench.run(1.0)[-1].state is S.HOLDING


def test_a_trembling_stick_is_no_hand():
    bench = in_state(S.FOLLOWING)
    for place in (0.1, -0.1, 0.14, -0.14):
        bench.status = replace(bench.status, sticks=(place, *bench.status.sticks[1:]))
        assert bench.tick().state is S.FOLLOWING


def test_engaging_again_counts_from_where_the_sticks_are_then():
    bench = in_state(S.FOLLOWING)
    bench.status = replace(bench.status, sticks=(1.0,) * 8, takeover_events=3)
    bench.tick()
    bench.obeys = True
    bench.guardian.engage(bench.t)
    bench.run(1.5)
    assert bench.out.state in (S.HOLDING, S.FOLLOWING)
    bench.status = replace(bench.status, sticks=(0.8,) * 8)
    assert bench.tick().state is S.MUTED


def test_an_axis_that_is_heard_later_counts_from_there():
    watch = PilotWatch(0.15)
    watch.begin(status(sticks=(None, 0.0)))
    assert watch.look(status(sticks=(-1.0, 0.0))) == QUIET
    assert watch.look(status(sticks=(None, None))) == QUIET
    assert watch.look(status(sticks=(-1.0, 0.1))) == QUIET
    assert watch.look(status(sticks=(-0.8, 0.1))) == Signs(True, False, False)


def test_counts_from_before_the_engagement_are_no_signs():
    watch = PilotWatch(0.15)
    watch.begin(status(mode_changes=7, takeover_events=2))
    assert watch.look(status(mode_changes=7, takeover_events=2)) == QUIET
    assert watch.look(status(mode_changes=8, takeover_events=2)) == QUIET
    assert watch.look(status(mode_changes=10, takeover_events=3)) == Signs(False, True, True)
    assert watch.look(status(mode_changes=10, takeover_events=3)) == QUIET


@pytest.mark.parametrize(
    ("change", "velocity", "words"),
    [
        ({}, 0.0, ""),
        ({}, 0.9, ""),
        ({}, 1.2, "moves at 1.2 m/s"),
        ({"armed": False, "landed": LandedState.ON_GROUND}, 1.2, ""),
        ({"landed": LandedState.ON_GROUND}, 0.0, "landed state is ON_GROUND"),
        ({"landed": LandedState.UNDEFINED}, 0.0, "landed state is UNDEFINED"),
        ({"landed": LandedState.LANDING}, 0.0, "landed state is LANDING"),
        ({"armed": False, "mode": FlightMode.MANUAL, "landed": LandedState.ON_GROUND}, 0.0, ""),
        ({"mode": FlightMode.OFFBOARD}, 0.0, ""),
        *(
            ({"mode": mode}, 0.0, f"flies in mode {mode.value}")
            for mode in (
                FlightMode.MANUAL,
                FlightMode.ACRO,
                FlightMode.STABILIZED,
                FlightMode.AUTO_LAND,
                FlightMode.AUTO_PRECLAND,
                FlightMode.AUTO_RTL,
                FlightMode.UNKNOWN,
                FlightMode.OTHER,
            )
        ),
    ],
)
def test_the_vehicles_state_must_allow_it(change, velocity, words):
    bench = Bench()
    bench.status = status(**change)
    bench.velocity = np.array([velocity, 0.0, 0.0])
    bench.tick()
    assert (words in bench.guardian.obstacle()) if words else bench.guardian.obstacle() == ""
    bench.guardian.engage(bench.t)
    out = bench.tick()
    assert out.state is (S.MUTED if words else S.PRESTREAM)
    assert (words in out.reason) if words else "cannot" not in out.reason


def test_before_the_first_status_the_heartbeat_is_missing():
    assert "heartbeat" in Bench().guardian.obstacle()
