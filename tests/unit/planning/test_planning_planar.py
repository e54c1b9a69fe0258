"""Minimum snap in the plane: level, within the free-flyer's limits, and the same motion as in space."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.messages.motion import MotionState
from companion.planning.minimum_snap import PlanParameters, PlanRequest, plan_to_moving_goal
from companion.planning.planar import plan_in_plane
from companion.vehicles.free_flyer import FreeFlyer, FreeFlyerParameters

LIMITS = FreeFlyer().limits


def state(position, velocity=(0.0, 0.0), yaw=0.0, yaw_rate=0.0, down=0.0, sinking=0.0):
    return MotionState(
        position_ned=np.array([*position, down]),
        velocity_ned=np.array([*velocity, sinking]),
        acceleration_ned=np.zeros(3),
        yaw=yaw,
        yaw_rate=yaw_rate,
    )


def plan(start, goal, planner=plan_in_plane, limits=LIMITS, **more):
    request = PlanRequest(
        start=start,
        t_start=5.0,
        goal=goal,
        t_goal_hint=5.4,
        limits=limits,
        t_expiry=20.0,
        reset_counter=3,
        parameters=PlanParameters(),
        **more,
    )
    return planner(request)


def moving(place, velocity, yaw=0.0, yaw_rate=0.0, **more):
    return lambda t: state(
        np.add(place, np.multiply(velocity, t - 5.0)), velocity, yaw + yaw_rate * (t - 5.0), yaw_rate, **more
    )


def sampled(trajectory):
    return [trajectory.at(t) for t in np.linspace(trajectory.t_start, trajectory.t_end, 200)]


places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
slow = st.tuples(st.floats(-0.06, 0.06), st.floats(-0.06, 0.06))


@settings(max_examples=60, deadline=None)
@given(place=places, velocity=slow, drift=slow, turn=st.floats(-3.0, 3.0))
def test_plans_keep_the_limits_and_the_floor(place, velocity, drift, turn):
    start = state((0.0, 0.0), velocity, down=-0.25, sinking=0.004)
    result = plan(start, moving(place, drift, yaw=turn, down=-0.9, sinking=0.1))
    assert result.limits_hold, result.worst
    for motion in sampled(result.trajectory):
        assert motion.position_ned[2] == pytest.approx(-0.25, abs=1e-12)
        assert motion.velocity_ned[2] == pytest.approx(0.0, abs=1e-12)
        assert math.hypot(*motion.velocity_ned[:2]) <= LIMITS.speed_horizontal * 1.0001
        assert math.hypot(*motion.acceleration_ned[:2]) <= LIMITS.acceleration_horizontal * 1.0001
        assert abs(motion.yaw_rate) <= LIMITS.yaw_rate * 1.0001


@settings(max_examples=30, deadline=None)
@given(place=places, drift=slow, turn=st.floats(-3.0, 3.0))
def test_it_meets_the_goal_in_place_speed_and_heading(place, drift, turn):
    goal = moving(place, drift, yaw=turn)
    result = plan(state((0.0, 0.0)), goal)
    end, wanted = result.trajectory.at(result.t_goal), goal(result.t_goal)
    assert end.position_ned[:2] == pytest.approx(wanted.position_ned[:2], abs=1e-9)
    assert end.velocity_ned[:2] == pytest.approx(wanted.velocity_ned[:2], abs=1e-9)
    assert math.remainder(end.yaw - wanted.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_dropping_z_changes_nothing_else():
    start, goal = state((0.0, 0.0), (0.05, 0.0)), moving((1.5, -0.7), (0.05, 0.02), yaw=1.0)
    flat, spatial = plan(start, goal), plan(start, goal, plan_to_moving_goal)
    assert flat.t_goal == spatial.t_goal
    assert np.array_equal(flat.trajectory.position, spatial.trajectory.position)
    assert np.array_equal(flat.trajectory.yaw, spatial.trajectory.yaw)


def test_height_would_stretch_a_plan_in_space():
    start, goal = state((0.0, 0.0), down=-0.25), moving((1.0, 0.0), (0.0, 0.0), down=-0.9)
    flat, spatial = plan(start, goal), plan(start, goal, plan_to_moving_goal)
    assert spatial.t_goal - 5.0 > 3.0 * (flat.t_goal - 5.0)


def test_a_goal_as_fast_as_the_vehicle_is_followed_but_never_caught():
    limits = FreeFlyer(parameters=FreeFlyerParameters(speed=0.1)).limits
    result = plan(state((0.0, 0.0), (0.1, 0.0)), moving((0.3, 0.0), (0.1, 0.0)), limits=limits)
    assert not result.limits_hold
    assert result.worst.name == "speed_horizontal"
    fastest = max(math.hypot(*motion.velocity_ned[:2]) for motion in sampled(result.trajectory))
    assert fastest < 0.11
