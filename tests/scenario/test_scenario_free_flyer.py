"""The free-flyer keeps station at moving targets: the companion's planner and controller, the simulator, MAVLink bytes.

The measured figures are in docs/components/control_free_flyer.md; here they only must not be far off.
"""

import math

import numpy as np
import pytest
from free_flyer_station import TABLE_5, Trial, fly

SEED = 4
STEADY, TURNING = TABLE_5[0], TABLE_5[3]


@pytest.fixture(scope="module")
def turning() -> Trial:
    return fly(TURNING, SEED, seconds=20.0)


def test_it_comes_and_keeps_station_at_a_target_that_jerks_and_turns(turning):
    """Speed 0 to 0.1 m/s and turn rate -1 to 1 rad/s, drawn ten times a second (Patel et al., table 5, case 4)."""
    assert turning.arrived < 20.0
    assert turning.position_errors.mean() < 0.02
    assert turning.position_errors.max() < 0.06
    assert turning.heading_errors.mean() < 0.15
    assert turning.final_position_error < 0.015
    assert turning.final_heading_error < 0.02


def test_it_keeps_the_speed_limit_and_its_thrusters_suffice(turning):
    assert turning.shares.min() == 1.0
    assert turning.speeds.max() < TURNING.speed_max * 1.1


def test_at_a_target_as_fast_as_itself_it_keeps_its_distance():
    """Table 5, case 1: what is lost when the target sets off cannot be made up, but no more is lost."""
    trial = fly(STEADY, SEED, seconds=25.0)
    assert trial.position_errors.mean() < 0.09
    late, early = trial.position_errors[-250:].mean(), trial.position_errors[100:350].mean()
    assert late < early + 0.03
    assert trial.speeds.max() < STEADY.speed_max * 1.15
    assert trial.final_position_error < 0.015


def test_the_same_seed_is_the_same_flight():
    first, second = (fly(TURNING, 1, seconds=2.0, crossing=True) for _ in range(2))
    assert math.isfinite(first.final_position_error)
    assert first.final_position_error == second.final_position_error
    assert np.array_equal(first.shares, second.shares)
