"""Algorithm 1 as printed, the fixed distances, and the table of modes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.guidance.docking.modes import TRANSITIONS, DockingEvent, next_mode
from companion.guidance.docking.parameters import MarkovSwitchingParameters
from companion.guidance.docking.policies import FixedDistances, MarkovSwitching
from companion.guidance.markov import transition_probabilities
from companion.guidance.modes import IllegalTransitionError
from companion.guidance.parameters import MarkovParameters
from companion.messages.docking import DockingMode, SwitchingSituation

M = DockingMode
TURN = math.sin(math.radians(60.0))  # the scenario's 120 deg


def situation(mode: DockingMode, range_: float, **changed) -> SwitchingSituation:
    values = {
        "misalignment": TURN, "mahalanobis": 1.0, "position_std": 0.008, "vision": False, "reorient_range": None,
    }  # fmt: skip
    return SwitchingSituation(mode=mode, range=range_, **{**values, **changed})


def first_switch(policy, mode: DockingMode, **changed) -> float:
    """The range at which a chaser that comes nearer is switched."""
    ranges = np.arange(1.6, 0.0, -0.001)
    return next(float(r) for r in ranges if policy.decide(situation(mode, float(r), **changed)).switch)


def test_fixed_distances_switch_at_them() -> None:
    policy = FixedDistances(reorient_range=0.8, align_range=0.3)
    assert first_switch(policy, M.APPROACH) == pytest.approx(0.8, abs=0.002)
    assert first_switch(policy, M.REORIENT) == pytest.approx(0.3, abs=0.002)


@pytest.mark.parametrize("policy", [FixedDistances(), MarkovSwitching()])
def test_the_papers_policies_fly_to_the_docked_place_along_the_line_of_sight(policy) -> None:
    verdicts = [policy.decide(situation(mode, r)) for mode in M for r in np.arange(0.02, 1.8, 0.01)]
    assert not any(verdict.ahead or verdict.near for verdict in verdicts)


def test_a11_asks_for_the_turn_where_the_printed_equation_says() -> None:
    # 0.4 = (r / 1.0) (1 / (1 + 1)) (1 / sin 60 deg)
    assert first_switch(MarkovSwitching(), M.APPROACH) == pytest.approx(0.4 * 2.0 * TURN, abs=0.002)
    assert first_switch(MarkovSwitching(), M.APPROACH, mahalanobis=0.5) == pytest.approx(0.6 * TURN, abs=0.002)


def test_the_first_distances_hold_whatever_the_probabilities() -> None:
    assert first_switch(MarkovSwitching(), M.APPROACH, misalignment=0.01) == pytest.approx(0.3, abs=0.002)
    still = first_switch(MarkovSwitching(), M.REORIENT, reorient_range=0.7, position_std=0.001)
    assert still == pytest.approx(0.1, abs=0.002)


def test_nothing_is_asked_beyond_the_activation_range() -> None:
    verdict = MarkovSwitching().decide(situation(M.APPROACH, 1.01, mahalanobis=50.0))
    assert not verdict.switch
    assert verdict.probabilities is None
    assert MarkovSwitching().decide(situation(M.APPROACH, 0.99, mahalanobis=50.0)).switch


def test_a_poorly_known_position_aligns_farther_out() -> None:
    ranges = [
        first_switch(MarkovSwitching(), M.REORIENT, reorient_range=0.7, position_std=std) for std in (0.01, 0.02, 0.04)
    ]
    assert ranges == sorted(ranges)
    assert ranges[-1] > 0.3


@given(
    r=st.floats(0.001, 1.0), r2=st.floats(0.3, 1.0), d=st.floats(0.0, 30.0), std=st.floats(0.0, 1.0),
    turn=st.floats(0.0, 1.0), mode=st.sampled_from([M.APPROACH, M.REORIENT]),
)  # fmt: skip
def test_the_steady_state_is_that_of_the_printed_chain(r, r2, d, std, turn, mode) -> None:
    p = MarkovSwitchingParameters()
    s = situation(mode, r, misalignment=turn, mahalanobis=d, position_std=std, reorient_range=r2)
    numbers = MarkovSwitching().decide(s).probabilities
    assert numbers is not None
    a22 = min(1.0, r / r2 / (1.0 + d))
    a32 = min(1.0, max(0.0, std / p.coarse_std * (r2 - r) / (r2 - p.docked_range)))
    assert (numbers.a22, numbers.a32) == pytest.approx((a22, a32), abs=1e-12)
    assert 0.0 <= numbers.a11 <= 1.0
    chain = np.array([[a22, 1.0 - a22], [a32, 1.0 - a32]])
    steady = np.array([1.0 - numbers.steady_align, numbers.steady_align])
    np.testing.assert_allclose(steady @ chain, steady, atol=1e-9)


@given(r=st.floats(0.01, 6.0), d=st.floats(0.0, 9.0), angle=st.floats(0.01, 3.1), std=st.floats(0.0, 1.0))
def test_the_multirotor_uses_the_same_equations(r: float, d: float, angle: float, std: float) -> None:
    air = MarkovParameters()
    same = MarkovSwitchingParameters(
        activation_range=air.activation_range_m, docked_range=air.touchdown_range_m, align_floor=1e-6,
        reorient_floor=1e-6, coarse_std=air.coarse_position_std_m,
    )  # fmt: skip
    s = situation(
        M.REORIENT, r, misalignment=abs(math.sin(0.5 * angle)), mahalanobis=d, position_std=std, reorient_range=4.0
    )
    numbers = transition_probabilities(
        range_m=r, reorient_range_m=4.0, inconsistency=d, heading_error=angle, position_std=std, parameters=air
    )
    assert MarkovSwitching(parameters=same).decide(s).probabilities == numbers


def test_every_pair_of_mode_and_event_is_known_or_refused() -> None:
    for mode in DockingMode:
        for event in DockingEvent:
            if (mode, event) in TRANSITIONS:
                assert isinstance(next_mode(mode, event), DockingMode)
            else:
                with pytest.raises(IllegalTransitionError, match=mode.value):
                    next_mode(mode, event)


def test_the_port_is_entered_only_from_in_front_of_it_and_the_end_is_an_end() -> None:
    assert {mode for (mode, _), after in TRANSITIONS.items() if after is M.DOCK} == {M.REORIENT, M.ALIGN}
    assert not [pair for pair in TRANSITIONS if pair[0] is M.DOCKED]
    reached = {M.WAIT}
    while more := {after for (before, _), after in TRANSITIONS.items() if before in reached} - reached:
        reached |= more
    assert reached == set(DockingMode)
