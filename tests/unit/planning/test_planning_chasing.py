"""To a goal that flees: as near as the limits allow, everything else put right at once."""

import dataclasses
import math

import numpy as np
import pytest

from companion.messages.motion import MotionState
from companion.planning.braking import plan_without_straying
from companion.planning.chasing import plan_in_pursuit
from companion.planning.minimum_snap import PlanParameters, PlanRequest
from companion.vehicles.multicopter import Multicopter

LIMITS = dataclasses.replace(Multicopter().limits, speed_horizontal=1.0)


def state(position, velocity=(0.0, 0.0, 0.0), yaw: float = 0.0) -> MotionState:
    return MotionState(
        position_ned=np.array(position, float),
        velocity_ned=np.array(velocity, float),
        acceleration_ned=np.zeros(3),
        yaw=yaw,
        yaw_rate=0.0,
    )


def fleeing(speed: float):
    """A goal 3 m up that goes north."""
    return lambda t: state((speed * t, 0.0, -3.0), (speed, 0.0, 0.0))


def plan(planner, start: MotionState, goal, t: float):
    request = PlanRequest(
        start=start,
        t_start=t,
        goal=goal,
        t_goal_hint=t + 0.8,
        limits=LIMITS,
        t_expiry=t + 0.5,
        reset_counter=0,
        parameters=PlanParameters(),
    )
    return planner(request).trajectory


def flown(planner, start: MotionState, speed: float, duration: float) -> np.ndarray:
    """Fly the plans, a new one every 0.1 s: behind, aside, above [m] and speed [m/s], one row each."""
    rows, goal = [], fleeing(speed)
    for t in np.arange(0.0, duration, 0.1):
        start = plan(planner, start, goal, float(t)).at(float(t) + 0.1)
        gap = goal(float(t) + 0.1).position_ned - start.position_ned
        rows.append((*gap.tolist(), math.hypot(start.velocity_ned[0], start.velocity_ned[1])))
    return np.array(rows)


BEHIND = state((-1.2, 0.4, -4.0), (0.9, 0.1, 0.0), yaw=0.3)  # a metre too high, and aside


@pytest.mark.parametrize("speed", [1.0, 1.05])
def test_behind_a_goal_as_fast_as_the_vehicle_the_rest_is_put_right(speed: float) -> None:
    rows = flown(plan_in_pursuit, BEHIND, speed, 10.0)
    assert np.abs(rows[50:, 1]).max() < 0.05  # aside
    assert np.abs(rows[50:, 2]).max() < 0.1  # above
    assert rows[:, 3].max() < 1.04 * speed
    grown = rows[-1, 0] - 1.2
    assert grown < 0.5 + 10.0 * (speed - 1.0)
    direct = flown(plan_without_straying, BEHIND, speed, 10.0)
    assert np.abs(direct[50:, 2]).max() > 0.3  # what it is for


@pytest.mark.parametrize("below", [0.0, 1.5, -2.5])
def test_from_rest_little_more_is_lost_than_the_acceleration_costs(below: float) -> None:
    rows = flown(plan_in_pursuit, state((0.0, 0.1, -3.0 + below), (-0.1, 0.2, 0.0)), 1.0, 4.0)
    least = 0.5 * 1.1**2 / LIMITS.acceleration_horizontal  # at the limit's acceleration, taken up at once
    assert rows[-1, 0] < least + 0.5
    assert rows[:, 3].max() < 1.04
    assert np.abs(rows[-1, 1]) < 0.1
    assert np.abs(rows[-1, 2]) < max(0.1, abs(below) - 1.0)  # the height is put right meanwhile


def test_a_slower_goal_is_caught_up_with_about_as_fast_as_the_limit_allows() -> None:
    rows = flown(plan_in_pursuit, BEHIND, 0.7, 12.0)
    assert np.hypot(rows[-1, 0], rows[-1, 1]) < 0.05
    assert rows[:, 3].max() <= 1.03
    direct = flown(plan_without_straying, BEHIND, 0.7, 12.0)
    assert rows[:, 0].sum() < 1.1 * direct[:, 0].sum()


@pytest.mark.parametrize("goal", [lambda t: state((3.0, -2.0, -1.5)), fleeing(0.3)])
def test_a_goal_within_reach_is_flown_to_directly(goal) -> None:
    ours, direct = (
        plan(planner, state((0.0, 0.0, -5.0)), goal, 0.0) for planner in (plan_in_pursuit, plan_without_straying)
    )
    assert ours.t_end == direct.t_end
    np.testing.assert_array_equal(ours.at(1.0).position_ned, direct.at(1.0).position_ned)


def test_a_state_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        plan(plan_in_pursuit, state((math.nan, 0.0, 0.0)), fleeing(1.0), 0.0)
