"""Plans through waypoints, and goals that move with the target."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from companion.messages.motion import MotionState
from companion.messages.target import TargetPose
from companion.planning.goal import goal_at_target
from companion.planning.minimum_snap import PlanParameters
from companion.planning.spline import SNAP, cost_from_ends, optimal_derivatives, time_powers
from companion.planning.waypoints import Waypoint, plan_through
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits
START = MotionState(
    position_ned=np.array([0, 0, -2.0]),
    velocity_ned=np.array([0.5, 0, 0]),
    acceleration_ned=np.array([0.1, 0, 0]),
    yaw=3.0,
    yaw_rate=0.1,
)
POINTS = [(4, 0, -3), (4, 3, -3), (0, 3, -4), (0, 6, -4)]


def through(points=POINTS, **more):
    waypoints = [Waypoint(position_ned=np.array(p, float), yaw=-3.0 + 0.2 * k) for k, p in enumerate(points)]
    arguments = {
        "t_start": 10.0,
        "limits": LIMITS,
        "t_expiry": 99.0,
        "reset_counter": 1,
        "parameters": PlanParameters(),
    }
    return plan_through(START, waypoints, **(arguments | more))


def test_it_passes_every_waypoint_and_ends_at_rest():
    result = through()
    trajectory = result.trajectory
    t = 10.0
    assert trajectory.at(t).velocity_ned == pytest.approx(START.velocity_ned)
    assert trajectory.at(t).acceleration_ned == pytest.approx(START.acceleration_ned)
    for duration, point in zip(trajectory.durations, POINTS, strict=True):
        t += duration
        assert trajectory.at(t).position_ned == pytest.approx(point, abs=1e-7)
    assert trajectory.at(t).velocity_ned == pytest.approx(np.zeros(3), abs=1e-7)
    assert abs(trajectory.at(t).yaw - START.yaw) < math.pi
    assert result.limits_hold
    assert t == pytest.approx(result.t_goal)


def test_nothing_up_to_the_jerk_steps_at_a_waypoint():
    trajectory = through().trajectory
    t = 10.0
    for duration in trajectory.durations[:-1]:
        t += duration
        before, after = trajectory.at(t - 1e-7), trajectory.at(t + 1e-7)
        assert after.velocity_ned == pytest.approx(before.velocity_ned, abs=1e-5)
        assert after.acceleration_ned == pytest.approx(before.acceleration_ned, abs=1e-5)
        assert trajectory.jerk_at(t + 1e-7) == pytest.approx(trajectory.jerk_at(t - 1e-7), abs=1e-4)
        assert after.yaw_rate == pytest.approx(before.yaw_rate, abs=1e-5)


def test_limits_hold_on_a_dense_grid():
    trajectory = through().trajectory
    for t in np.linspace(10.0, trajectory.t_end, 4001):
        s = trajectory.at(t)
        assert math.hypot(*s.velocity_ned[:2]) <= LIMITS.speed_horizontal
        assert -LIMITS.speed_up <= s.velocity_ned[2] <= LIMITS.speed_down
        assert math.hypot(*s.acceleration_ned[:2]) <= LIMITS.acceleration_horizontal
        assert abs(s.yaw_rate) <= LIMITS.yaw_rate


def test_free_derivatives_are_optimal():
    rng = np.random.default_rng(1)
    durations = (1.0, 2.0, 1.5)
    derivatives = rng.normal(size=(4, SNAP, 1))
    fixed = np.zeros((4, SNAP), dtype=bool)
    fixed[:, 0] = fixed[0] = fixed[-1] = True

    def cost(d):
        total = 0.0
        for k, duration in enumerate(durations):
            ends = np.concatenate([d[k, :, 0], d[k + 1, :, 0]]) * time_powers(duration, SNAP)
            total += ends @ cost_from_ends(SNAP) @ ends / duration**7
        return total

    best = optimal_derivatives(SNAP, durations, derivatives, fixed)
    assert best[fixed] == pytest.approx(derivatives[fixed])
    for _ in range(20):
        other = best + 0.1 * rng.normal(size=best.shape) * ~fixed[:, :, None]
        assert cost(other) > cost(best)


def test_one_waypoint_is_enough_and_none_is_not():
    assert through(POINTS[:1]).limits_hold
    with pytest.raises(ValueError, match="at least one"):
        through([])
    with pytest.raises(ValueError, match="finite"):
        through([(math.nan, 0, 0)])


def test_a_start_that_is_too_fast_is_said():
    fast = MotionState(
        position_ned=np.zeros(3), velocity_ned=np.array([9.0, 0, 0]), acceleration_ned=np.zeros(3), yaw=0, yaw_rate=0
    )
    point = Waypoint(position_ned=np.array([5.0, 0, 0]), yaw=0.0)
    result = plan_through(
        fast, [point], t_start=0.0, limits=LIMITS, t_expiry=1.0, reset_counter=0, parameters=PlanParameters()
    )
    assert not result.limits_hold


@dataclass
class Turning:
    t: float = 0.0
    horizon: float = 10.0
    reset_counter: int = 0

    def at(self, t):
        return TargetPose(
            t=t,
            position_ned=np.array([1 + 0.5 * t, 2, 0]),
            velocity_ned=np.array([0.5, 0, 0]),
            acceleration_ned=np.zeros(3),
            yaw=0.3 + 0.8 * t,
            yaw_rate=0.8,
            covariance=np.eye(4),
        )


def test_a_goal_turns_with_the_pad():
    goal = goal_at_target(Turning(), offset_pad=np.array([1.0, 0.5, -2.0]), yaw_offset=0.1)
    h = 1e-5
    before, now, after = goal(1.0 - h), goal(1.0), goal(1.0 + h)
    assert (after.position_ned - before.position_ned) / (2 * h) == pytest.approx(now.velocity_ned, abs=1e-6)
    assert (after.velocity_ned - before.velocity_ned) / (2 * h) == pytest.approx(now.acceleration_ned, abs=1e-6)
    assert now.position_ned[2] == -2.0
    assert now.yaw == pytest.approx(0.3 + 0.8 + 0.1)
    assert now.yaw_rate == 0.8


def test_a_goal_may_keep_its_own_heading_and_sink():
    goal = goal_at_target(Turning(), offset_pad=np.zeros(3), follow_yaw=False, yaw=1.2, offset_velocity_down=0.4)
    assert goal(3.0).yaw == 1.2
    assert goal(3.0).yaw_rate == 0.0
    assert goal(3.0).velocity_ned[2] == 0.4
