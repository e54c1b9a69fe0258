"""Minimum snap to a moving goal: ends, optimality, limits, symmetries."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.messages.motion import MotionLimits, MotionState
from companion.planning.minimum_snap import PlanParameters, PlanRequest, plan_to_moving_goal
from companion.planning.polynomial import PolynomialTrajectory
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits
WIDE = MotionLimits(
    speed_horizontal=1e4,
    speed_up=1e4,
    speed_down=1e4,
    acceleration_horizontal=1e4,
    acceleration_vertical=1e4,
    jerk=1e5,
    yaw_rate=1e4,
    yaw_acceleration=1e4,
)


def state(position=(0, 0, 0), velocity=(0, 0, 0), acceleration=(0, 0, 0), yaw=0.0, yaw_rate=0.0):
    return MotionState(
        position_ned=np.array(position, float),
        velocity_ned=np.array(velocity, float),
        acceleration_ned=np.array(acceleration, float),
        yaw=yaw,
        yaw_rate=yaw_rate,
    )


def moving(position, velocity, yaw=0.0, yaw_rate=0.0, t0=0.0):
    position, velocity = np.array(position, float), np.array(velocity, float)
    return lambda t: state(position + velocity * (t - t0), velocity, yaw=yaw + yaw_rate * (t - t0), yaw_rate=yaw_rate)


def plan(start, goal, *, t_start=0.0, hint=3.0, limits=WIDE, **more):
    request = PlanRequest(
        start=start,
        t_start=t_start,
        goal=goal,
        t_goal_hint=hint,
        limits=limits,
        t_expiry=t_start + 100.0,
        reset_counter=7,
        parameters=PlanParameters(),
        **more,
    )
    return plan_to_moving_goal(request)


def vectors(low, high):
    return st.tuples(*[st.floats(low, high)] * 3)


def samples(trajectory: PolynomialTrajectory, count=2001):
    return [trajectory.at(t) for t in np.linspace(trajectory.t_start, trajectory.t_end, count)]


@given(
    p=vectors(-20, 20), v=vectors(-2, 2), a=vectors(-1, 1), g=vectors(-20, 20), w=vectors(-2, 2), yaw=st.floats(-9, 9)
)
@settings(max_examples=60, deadline=None)
def test_starts_at_the_present_state_and_meets_the_goal(p, v, a, g, w, yaw):
    start, goal = state(p, v, a, yaw=0.3, yaw_rate=0.2), moving(g, w, yaw=yaw, yaw_rate=0.1)
    result = plan(start, goal, start_jerk_ned=np.array([0.5, -0.4, 0.3]))
    trajectory = result.trajectory
    first, last, wanted = trajectory.at(0.0), trajectory.at(result.t_goal), goal(result.t_goal)
    for got, expected in ((first, start), (last, wanted)):
        assert got.position_ned == pytest.approx(expected.position_ned, abs=1e-9)
        assert got.velocity_ned == pytest.approx(expected.velocity_ned, abs=1e-9)
        assert got.acceleration_ned == pytest.approx(expected.acceleration_ned, abs=1e-8)
        assert math.remainder(got.yaw - expected.yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
        assert got.yaw_rate == pytest.approx(expected.yaw_rate, abs=1e-9)
    assert trajectory.jerk_at(0.0) == pytest.approx([0.5, -0.4, 0.3])
    assert trajectory.jerk_at(result.t_goal) == pytest.approx(np.zeros(3), abs=1e-6)
    assert abs(last.yaw - first.yaw) <= math.pi + 1e-9
    assert trajectory.reset_counter == 7


def test_derivatives_belong_to_the_position():
    trajectory = plan(state(v := (1, 0, 0), v, (0, 1, 0), 0.1, 0.3), moving((5, 2, -1), (0.5, 0, 0), 1.0)).trajectory
    h = 1e-4
    for t in np.linspace(0.1, 2.9, 9):
        before, now, after = (trajectory.at(t + k * h) for k in (-1, 0, 1))
        assert (after.position_ned - before.position_ned) / (2 * h) == pytest.approx(now.velocity_ned, abs=1e-6)
        assert (after.velocity_ned - before.velocity_ned) / (2 * h) == pytest.approx(now.acceleration_ned, abs=1e-6)
        jerk = (after.acceleration_ned - before.acceleration_ned) / (2 * h)
        assert jerk == pytest.approx(trajectory.jerk_at(t), abs=1e-5)
        assert (after.yaw - before.yaw) / (2 * h) == pytest.approx(now.yaw_rate, abs=1e-6)


def snap_cost(coefficients):
    s = np.linspace(0, 1, 4001)
    snap = np.polynomial.Polynomial(coefficients).deriv(4)(s)
    return float(np.trapezoid(snap * snap, s))


@given(bump=st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda b: max(map(abs, b)) > 0.01))
@settings(max_examples=30, deadline=None)
def test_no_perturbation_that_keeps_the_ends_has_less_snap(bump):
    result = plan(state((0, 1, 2), (1, 0, 0), (0, 0.5, 0)), moving((5, 2, -1), (0.5, 0, 0)), start_jerk_ned=np.zeros(3))
    keep_ends = np.polynomial.Polynomial([0, 0, 0, 0, 1]) * np.polynomial.Polynomial([1, -1]) ** 4
    for axis in range(3):
        best = result.trajectory.position[0, :, axis]
        other = np.polynomial.Polynomial(best) + keep_ends * np.polynomial.Polynomial(bump)
        assert snap_cost(other.coef) > snap_cost(best)


def test_a_free_start_jerk_costs_least():
    start, goal = state((0, 1, 2), (1, 0, 0), (0, 0.5, 0)), moving((5, 2, -1), (0.5, 0, 0))
    free = plan(start, goal).trajectory
    at_best = snap_cost(free.position[0, :, 0])
    for jerk in (-0.5, 0.0, 0.7):
        other = plan(start, goal, start_jerk_ned=free.jerk_at(0.0) + jerk + 0.1).trajectory
        assert snap_cost(other.position[0, :, 0]) > at_best


def test_yaw_has_least_acceleration():
    yaw = plan(state(yaw_rate=0.4), moving((1, 1, 1), (0, 0, 0), yaw=1.0)).trajectory.yaw[0]
    s = np.linspace(0, 1, 2001)
    best = np.trapezoid(np.polynomial.Polynomial(yaw).deriv(2)(s) ** 2, s)
    bump = np.polynomial.Polynomial([0, 0, 1]) * np.polynomial.Polynomial([1, -1]) ** 2
    for size in (-0.3, 0.1, 1.0):
        other = np.polynomial.Polynomial(yaw) + size * bump
        assert np.trapezoid(other.deriv(2)(s) ** 2, s) > best


@given(
    v=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.4, 0.4)),
    g=vectors(-12, 12),
    w=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.just(0.0)),
    yaw=st.floats(-4, 4),
    hint=st.floats(0, 8),
)
@settings(max_examples=60, deadline=None)
def test_limits_hold_on_a_dense_grid(v, g, w, yaw, hint):
    result = plan(state(velocity=v), moving(g, w, yaw), hint=hint, limits=LIMITS)
    assert result.limits_hold
    assert result.worst.ratio <= 1.0
    every = samples(result.trajectory)
    speed = [math.hypot(*s.velocity_ned[:2]) for s in every]
    assert max(speed) <= LIMITS.speed_horizontal
    assert max(s.velocity_ned[2] for s in every) <= LIMITS.speed_down
    assert max(-s.velocity_ned[2] for s in every) <= LIMITS.speed_up
    assert max(math.hypot(*s.acceleration_ned[:2]) for s in every) <= LIMITS.acceleration_horizontal
    assert max(abs(s.acceleration_ned[2]) for s in every) <= LIMITS.acceleration_vertical
    assert max(abs(s.yaw_rate) for s in every) <= LIMITS.yaw_rate
    times = np.linspace(0, result.t_goal, 501)
    assert max(np.abs(result.trajectory.jerk_at(t)).max() for t in times) <= LIMITS.jerk
    assert result.t_goal >= hint - 1e-9


def test_a_motion_from_rest_is_as_short_as_the_limits_allow():
    result = plan(state(), moving((20, 0, 0), (0, 0, 0)), hint=0.0, limits=LIMITS, start_jerk_ned=np.zeros(3))
    shortest = 2.1875 * 20 / LIMITS.speed_horizontal
    assert shortest <= result.t_goal <= 1.06 * shortest
    assert result.scale_steps > 0


def test_a_hint_inside_the_limits_is_kept():
    result = plan(state(), moving((5, 0, 0), (0, 0, 0)), hint=30.0, limits=LIMITS)
    assert result.t_goal == pytest.approx(30.0)
    assert result.scale_steps == 0


def test_the_closing_speed_is_kept_relative_to_the_goal():
    goal = moving((10, 0, 0), (1.0, 0, 0))
    result = plan(state(), goal, hint=0.0, limits=LIMITS, closing_speed=1.5)
    relative = [np.linalg.norm(s.velocity_ned - [1.0, 0, 0]) for s in samples(result.trajectory)]
    assert result.limits_hold
    assert max(relative) <= 1.5


def test_a_start_beyond_a_limit_is_said_and_still_brought_back():
    result = plan(state(velocity=(4.0, 0, 0)), moving((10, 0, 0), (0, 0, 0)), hint=1.0, limits=LIMITS)
    assert not result.limits_hold
    assert result.worst.name == "speed_horizontal"
    assert result.worst.ratio == pytest.approx(4.0 / 3.0, rel=0.06)
    assert result.trajectory.at(result.t_goal).velocity_ned == pytest.approx(np.zeros(3), abs=1e-9)


def test_what_cannot_be_kept_gives_the_mildest_plan():
    start = state(velocity=(2.9, 0, 0), acceleration=(2.5, 0, 0))
    result = plan(start, moving((3, 0, 0), (0, 0, 0)), hint=1.0, limits=LIMITS)
    hasty = plan(start, moving((3, 0, 0), (0, 0, 0)), hint=1.0)
    assert not result.limits_hold
    assert max(np.abs(s.velocity_ned[0]) for s in samples(result.trajectory)) <= max(
        np.abs(s.velocity_ned[0]) for s in samples(hasty.trajectory)
    )


@given(shift=st.floats(-1e4, 1e4))
@settings(max_examples=20, deadline=None)
def test_the_clock_does_not_matter(shift):
    start = state((0, 1, 2), (1, 0, 0))
    here = plan(start, moving((6, 2, -1), (0.5, 0, 0)), limits=LIMITS)
    there = plan(start, moving((6, 2, -1), (0.5, 0, 0), t0=shift), t_start=shift, hint=shift + 3.0, limits=LIMITS)
    assert there.t_goal - shift == pytest.approx(here.t_goal, abs=1e-6)
    assert there.trajectory.at(shift + 1.0).position_ned == pytest.approx(
        here.trajectory.at(1.0).position_ned, abs=1e-6
    )


@given(angle=st.floats(-3, 3), offset=vectors(-50, 50))
@settings(max_examples=20, deadline=None)
def test_turning_and_moving_the_world_turns_and_moves_the_plan(angle, offset):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    p, v, g, w = np.array([0, 1, 2.0]), np.array([1, 0, 0.1]), np.array([6, 2, -1.0]), np.array([0.5, 0.1, 0])
    here = plan(state(p, v, yaw=0.2), moving(g, w, 1.0)).trajectory.at(1.3)
    there = plan(
        state(turn @ p + offset, turn @ v, yaw=0.2 + angle), moving(turn @ g + offset, turn @ w, 1.0 + angle)
    ).trajectory.at(1.3)
    assert there.position_ned == pytest.approx(turn @ here.position_ned + offset, abs=1e-8)
    assert there.velocity_ned == pytest.approx(turn @ here.velocity_ned, abs=1e-8)
    assert there.yaw == pytest.approx(here.yaw + angle, abs=1e-9)


@given(drift=vectors(-3, 3))
@settings(max_examples=20, deadline=None)
def test_a_moving_goal_is_a_still_one_in_its_own_frame(drift):
    drift = np.array(drift)
    still = plan(state((0, 1, 2), (1, 0, 0)), moving((6, 2, -1), (0, 0, 0))).trajectory
    moved = plan(state((0, 1, 2), drift + np.array([1, 0, 0])), moving((6, 2, -1), drift)).trajectory
    for t in (0.0, 0.7, 2.0, 3.0, 4.5):
        assert moved.at(t).position_ned - drift * t == pytest.approx(still.at(t).position_ned, abs=1e-8)


def test_after_the_end_it_moves_on_and_before_the_start_it_comes_from_there():
    trajectory = plan(state((0, 1, 2), (1, 0, 0)), moving((6, 2, -1), (0.5, 0, 0), yaw_rate=0.1)).trajectory
    end, later = trajectory.at(3.0), trajectory.at(5.0)
    assert later.position_ned == pytest.approx(end.position_ned + 2.0 * np.array([0.5, 0, 0]))
    assert later.yaw == pytest.approx(end.yaw + 0.2)
    assert later.acceleration_ned == pytest.approx(np.zeros(3))
    assert trajectory.at(-1.0).position_ned == pytest.approx([-1, 1, 2])
    assert trajectory.jerk_at(-1.0) == pytest.approx(np.zeros(3))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_start_that_is_not_finite_is_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        plan(state((bad, 0, 0)), moving((6, 2, -1), (0, 0, 0)))


def test_a_trajectory_needs_positive_durations():
    with pytest.raises(ValueError, match="positive"):
        PolynomialTrajectory(
            t_start=0.0,
            durations=(0.0,),
            position=np.zeros((1, 8, 3)),
            yaw=np.zeros((1, 4)),
            t_expiry=1.0,
            reset_counter=0,
        )
