"""The table of states: every state meets every event."""

import itertools

import pytest

from companion.guardian.machine import TABLE, Event, IllegalEventError, update
from companion.messages.guardian import GuardianState

S, E = GuardianState, Event
STREAMING = {S.PRESTREAM, S.REQUESTING, S.FOLLOWING, S.HOLDING, S.BLIND, S.HANDOVER}
FLYING = {S.FOLLOWING, S.HOLDING, S.BLIND, S.GAP}


@pytest.mark.parametrize(("state", "event"), list(itertools.product(GuardianState, Event)), ids=str)
def test_every_pair_is_in_the_table_or_refused(state, event):
    if (state, event) in TABLE:
        assert update(state, event) is TABLE[state, event]
    else:
        with pytest.raises(IllegalEventError, match=state.value):
            update(state, event)


def test_only_the_operator_ends_the_silence():
    assert {event for (state, event), after in TABLE.items() if state is S.MUTED and after is not S.MUTED} == {E.ENGAGE}


@pytest.mark.parametrize("event", [E.LINK_LOST, E.DISTRESS])
@pytest.mark.parametrize("state", [s for s in S if s is not S.MUTED])
def test_a_lost_link_or_a_failsafe_mutes_at_once(state, event):
    assert update(state, event) is S.MUTED


@pytest.mark.parametrize("event", [E.MODE_TAKEN, E.ESTIMATE_INVALID])
@pytest.mark.parametrize("state", sorted(STREAMING - {S.HANDOVER} | {S.GAP}, key=str))
def test_somebody_elses_mode_mutes_at_once(state, event):
    assert update(state, event) is S.MUTED


@pytest.mark.parametrize("state", sorted(FLYING, key=str))
def test_flying_ends_by_handover_disarming_or_silence(state):
    assert update(state, E.DISENGAGE) is S.HANDOVER
    assert update(state, E.DISARMED) is S.LEAVING
    assert update(state, E.FINISH) is S.LEAVING
    assert update(state, E.OVERDUE) is S.MUTED
    assert update(state, E.LOST) is S.GAP


def test_a_gap_ends_in_holding_never_in_following():
    assert update(S.GAP, E.NOTHING_TO_FOLLOW) is S.HOLDING
    assert (S.GAP, E.FOLLOW) not in TABLE


def test_offboard_is_asked_for_only_after_the_prestream():
    ways = {(state, event) for (state, event), after in TABLE.items() if after is S.REQUESTING and state is not after}
    assert ways == {(S.PRESTREAM, E.PRESTREAMED)}


def test_handover_and_leaving_end_muted():
    for state in (S.HANDOVER, S.LEAVING):
        for event in (E.LEFT_OWN_MODE, E.UNANSWERED):
            assert update(state, event) is S.MUTED
