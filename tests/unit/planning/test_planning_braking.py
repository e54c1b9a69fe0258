"""Brake first, where the direct way would stray from a moving goal."""

import math

import numpy as np
import pytest

from companion.messages.motion import MotionState
from companion.planning.braking import plan_without_straying
from companion.planning.minimum_snap import PlanParameters, PlanRequest, plan_to_moving_goal
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits
PLANNERS = (plan_to_moving_goal, plan_without_straying)


def state(position, velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 0.0)) -> MotionState:
    return MotionState(
        position_ned=np.array(position, float),
        velocity_ned=np.array(velocity, float),
        acceleration_ned=np.array(acceleration, float),
        yaw=0.0,
        yaw_rate=0.0,
    )


def drifting(speed: float, down: float):
    return lambda t: state((0.0, speed * t, down), (0.0, speed, 0.0))


def plan(planner, start, goal, t):
    request = PlanRequest(
        start=start,
        t_start=t,
        goal=goal,
        t_goal_hint=t + 3.0,
        limits=LIMITS,
        t_expiry=t + 100.0,
        reset_counter=0,
        parameters=PlanParameters(),
    )
    return planner(request).trajectory


def flown(planner, start: MotionState, goal, duration: float = 20.0) -> tuple[float, float]:
    """Fly the plans, a new one every 0.1 s: greatest and last horizontal distance [m] to the goal."""
    worst, t = 0.0, 0.0
    while t < duration:
        trajectory = plan(planner, start, goal, t)
        t += 0.1
        start = trajectory.at(t)
        gap = start.position_ned - goal(t).position_ned
        worst = max(worst, math.hypot(gap[0], gap[1]))
    return worst, math.hypot(gap[0], gap[1])


@pytest.mark.parametrize("planner", PLANNERS)
def test_arrives(planner) -> None:
    _, last = flown(planner, state((-1.0, -1.0, -5.0), (-0.2, -0.7, 0.0), (-0.3, -1.8, 0.0)), drifting(0.5, -1.5))
    assert last < 0.1


def test_strays_little_from_a_start_that_moves_away() -> None:
    start, goal = state((-1.0, -1.0, -5.0), (-0.2, -0.7, 0.0), (-0.3, -1.8, 0.0)), drifting(0.5, -1.5)
    direct, braking = (flown(planner, start, goal)[0] for planner in PLANNERS)
    assert direct > 3.5  # what it is for
    assert braking < 2.9


@pytest.mark.parametrize("start", [state((3.0, -2.0, -5.0)), state((3.0, -2.0, -5.0), (-1.0, 0.7, 0.0))])
def test_takes_the_direct_way_where_that_does_not_stray(start: MotionState) -> None:
    goal = drifting(0.0, -1.5)
    direct, braking = (plan(planner, start, goal, 0.0) for planner in PLANNERS)
    assert direct.t_end == braking.t_end
    np.testing.assert_array_equal(direct.at(1.0).position_ned, braking.at(1.0).position_ned)


def test_begins_at_the_start_and_keeps_the_limits() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        start = state(rng.uniform(-4, 4, 3), (*rng.uniform(-1.2, 1.2, 2), 0.0), (*rng.uniform(-1.0, 1.0, 2), 0.0))
        trajectory = plan(plan_without_straying, start, drifting(0.4, -2.0), 0.0)
        np.testing.assert_allclose(trajectory.at(0.0).position_ned, start.position_ned, atol=1e-9)
        np.testing.assert_allclose(trajectory.at(0.0).velocity_ned, start.velocity_ned, atol=1e-9)
        for t in np.linspace(0.0, trajectory.t_end, 40):
            moment = trajectory.at(float(t))
            assert np.hypot(*moment.velocity_ned[:2]) < 1.1 * LIMITS.speed_horizontal
            assert np.hypot(*moment.acceleration_ned[:2]) < 1.1 * LIMITS.acceleration_horizontal
