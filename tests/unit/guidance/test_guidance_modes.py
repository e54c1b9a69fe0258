"""The table of modes: every pair is either listed or refused, and every mode can be reached and left."""

import itertools

import pytest

from companion.guidance.modes import FINAL_MODES, TRANSITIONS, Event, IllegalTransitionError, next_mode
from companion.messages.decision import Mode


@pytest.mark.parametrize(("mode", "event"), list(itertools.product(Mode, Event)))
def test_every_pair_is_listed_or_refused(mode: Mode, event: Event) -> None:
    if (mode, event) in TRANSITIONS:
        assert next_mode(mode, event) is TRANSITIONS[(mode, event)]
    else:
        with pytest.raises(IllegalTransitionError, match=mode.value):
            next_mode(mode, event)


def test_nothing_leads_out_of_the_end() -> None:
    assert not [pair for pair in TRANSITIONS if pair[0] in FINAL_MODES]


@pytest.mark.parametrize("mode", [mode for mode in Mode if mode not in FINAL_MODES])
def test_a_takeover_ends_the_mission_from_every_mode(mode: Mode) -> None:
    assert next_mode(mode, Event.TAKEN_OVER) is Mode.ABORT


def test_every_mode_is_reachable_from_the_start() -> None:
    reached = {Mode.PREFLIGHT}
    while True:
        more = {after for (before, _), after in TRANSITIONS.items() if before in reached} - reached
        if not more:
            break
        reached |= more
    assert reached == set(Mode)


def test_a_descent_is_entered_only_from_above_the_pad() -> None:
    before = {mode for (mode, _), after in TRANSITIONS.items() if after is Mode.LAND}
    assert before == {Mode.REORIENT, Mode.ALIGN}
