"""The numbers of Algorithm 1 behave as probabilities and move the way the paper says."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.guidance.markov import keep_approaching, reorient_probabilities
from companion.guidance.parameters import MarkovParameters
from companion.guidance.switching_chain import steady_state_align

P = MarkovParameters()
ranges = st.floats(0.0, 50.0)
positive = st.floats(0.0, 20.0)
angles = st.floats(-math.pi, math.pi)


@given(r=ranges, d=positive, angle=angles, std=positive, r2=st.floats(0.1, 50.0))
def test_every_number_is_a_probability(r: float, d: float, angle: float, std: float, r2: float) -> None:
    a11 = keep_approaching(range_m=r, inconsistency=d, heading_error=angle, parameters=P)
    a22, a32 = reorient_probabilities(range_m=r, reorient_range_m=r2, inconsistency=d, position_std=std, parameters=P)
    for number in (a11, a22, a32, steady_state_align(a22, a32)):
        assert 0.0 <= number <= 1.0


@given(r=st.floats(0.1, 10.0), d=positive, angle=st.floats(0.1, math.pi))
def test_approaching_pays_less_when_nearer_less_consistent_or_more_misaligned(r: float, d: float, angle: float) -> None:
    def a11(range_m: float, inconsistency: float, heading_error: float) -> float:
        return keep_approaching(range_m=range_m, inconsistency=inconsistency, heading_error=heading_error, parameters=P)

    here = a11(r, d, angle)
    assert a11(0.5 * r, d, angle) <= here
    assert a11(r, d + 1.0, angle) <= here
    assert a11(r, d, 0.5 * angle) >= here


def test_the_steady_state_is_that_of_the_chain() -> None:
    a22, a32 = 0.7, 0.2
    chain = np.array([[a22, 1 - a22], [a32, 1 - a32]])
    state = np.linalg.matrix_power(chain, 400)[0]
    assert steady_state_align(a22, a32) == pytest.approx(state[1], abs=1e-9)


def test_a_good_estimate_goes_straight_on_and_a_poor_one_aligns_first() -> None:
    def align(std: float) -> float:
        a22, a32 = reorient_probabilities(
            range_m=1.2, reorient_range_m=3.0, inconsistency=0.0, position_std=std, parameters=P
        )
        return steady_state_align(a22, a32)

    assert align(0.02) > P.align_threshold
    assert align(0.30) <= P.align_threshold
