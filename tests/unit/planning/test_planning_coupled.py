"""The coupled planner: it arrives, it keeps the nonlinear limits, and it says so where it cannot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.coupled.model import CameraView, CostWeights, CoupledRequest, NonlinearProblem, RoverMotion
from companion.planning.coupled.plan import CoupledParameters, Deadline, PlanEnd
from companion.planning.coupled.program import ConvexProgram
from companion.planning.coupled.qp import QpBackend, QpSolution
from companion.planning.coupled.scp import CoupledPlanner
from companion.planning.coupled.trajectory import RoverTrajectory

STEP = 0.2
ROVER = RoverMotion()
PARAMETERS = CoupledParameters()
PRECISE = CoupledParameters(
    tolerance=1e-5, tolerance_cost=1e-8, iterations_max=80, solver_tolerance=1e-7, trust_min=1e-4
)
PLANNERS = {backend: CoupledPlanner(ROVER, replace(PARAMETERS, solver=backend)) for backend in QpBackend}


def request(goal, **more):
    return CoupledRequest(t_start=more.pop("t_start", 0.0), step=STEP, goal=np.array(goal, float), **more)


def plan(goal, *, planner=PLANNERS[QpBackend.PIQP], last=None, deadline=None, **more):
    return planner.plan(request(goal, **more), last=last, deadline=deadline)


def driven(controls, *, substeps=1, midpoint=PARAMETERS.midpoint):
    """Drive the bicycle model; many substeps come to the exact arcs."""
    pose, poses, h = np.zeros(3), [np.zeros(3)], STEP / substeps
    for speed, yaw_rate in controls:
        for _ in range(substeps):
            course = pose[2] + midpoint * yaw_rate * h
            pose = pose + h * np.array([speed * math.cos(course), speed * math.sin(course), yaw_rate])
        poses.append(pose)
    return np.array(poses)


def assert_drivable(result, rover=ROVER, start=(0.0, 0.0), room=1e-9):
    speed, yaw_rate = result.controls.T
    assert speed.max() <= rover.speed_forward + room
    assert speed.min() >= -rover.speed_reverse - room
    assert np.all(rover.turning_radius * np.abs(yaw_rate) <= np.abs(speed) + room)
    assert np.abs(yaw_rate).max() <= rover.yaw_rate + room
    change = np.abs(np.diff(np.vstack((start, result.controls)), axis=0)) / STEP
    assert change[:, 0].max() <= rover.acceleration + room
    assert change[:, 1].max() <= rover.yaw_acceleration + room
    assert result.poses == pytest.approx(driven(result.controls), abs=1e-9)


REACHABLE = [(4.0, 0.0, 0.0), (3.0, 2.0, 1.2), (3.0, -2.0, -1.2), (2.0, 1.0, 0.0), (-2.0, 0.0, 0.0), (-2.5, 1.0, -0.7)]


@pytest.mark.parametrize("backend", list(QpBackend))
@pytest.mark.parametrize("goal", REACHABLE)
def test_reaches_the_intercept_pose_inside_the_nonlinear_limits(goal, backend):
    result = plan(goal, planner=PLANNERS[backend])
    assert math.dist(result.poses[-1, :2], goal[:2]) < 0.05
    assert abs(math.remainder(result.poses[-1, 2] - goal[2], 2 * math.pi)) < 0.05
    assert result.end is PlanEnd.CONVERGED
    assert result.violation.worst <= 1e-9
    assert not result.elastic
    assert_drivable(result)


def test_the_model_of_a_step_is_near_the_exact_arc():
    result = plan((3.0, 2.0, 1.2))
    assert result.poses == pytest.approx(driven(result.controls, substeps=200), abs=0.03)
    printed = CoupledPlanner(ROVER, CoupledParameters(midpoint=0.0)).plan(request((3.0, 2.0, 1.2)))
    assert printed.poses == pytest.approx(driven(printed.controls, midpoint=0.0), abs=1e-9)


@given(
    x=st.floats(-4, 5),
    y=st.floats(-4, 4),
    heading=st.floats(-4, 4),
    speed=st.floats(-1, 1),
    turn=st.floats(-1, 1),
)
@settings(max_examples=60, deadline=None)
def test_every_plan_is_drivable_and_no_worse_than_where_it_began(x, y, heading, speed, turn):
    yaw_rate = turn * abs(speed) / ROVER.turning_radius
    result = plan((x, y, heading), speed=speed, yaw_rate=yaw_rate)
    assert_drivable(result, start=(speed, yaw_rate))
    assert result.violation.worst <= 1e-9
    assert result.objective <= result.objective_first + 1e-9


def test_reports_the_objective_of_equation_6_with_the_state_of_each_step():
    goal = np.array((3.0, 2.0, 1.2))
    result, w = plan(goal), CostWeights()
    speed, yaw_rate = result.controls.T
    error = (result.poses - goal) ** 2
    expected = (
        (w.speed * speed**2 + w.yaw_rate * yaw_rate**2).sum()
        + w.stage_position * error[:-1, :2].sum()
        + w.stage_heading * error[:-1, 2].sum()
        + w.final_position * error[-1, :2].sum()
        + w.final_heading * error[-1, 2]
    )
    assert result.objective == pytest.approx(expected)


def test_mirrored_goals_give_mirrored_plans():
    left, right = plan((3.0, -1.0, -0.5)), plan((3.0, 1.0, 0.5))
    assert left.controls[:, 0] == pytest.approx(right.controls[:, 0], abs=0.02)
    assert left.controls[:, 1] == pytest.approx(-right.controls[:, 1], abs=0.02)


@pytest.mark.parametrize("aside", [-0.6, -0.4, -0.2, 0.2, 0.4, 0.6])
def test_a_lateral_correction_backs_out_first(aside):
    result = plan((0.0, aside, 0.0))
    moving = np.flatnonzero(np.abs(result.controls[:, 0]) > 0.05)
    assert result.correction_began == 0.0
    assert result.controls[moving[0], 0] < 0.0
    assert result.poses[:, 0].max() < 0.1  # nowhere towards the target ahead
    assert math.dist(result.poses[-1, :2], (0.0, aside)) < 0.05


def drive_to(goal, *, planner, seconds, period=0.1):
    """Plan again every 0.1 s, and drive; give the poses (K, 3) in the first plan's frame, and the plans."""
    pose, controls, last, poses, plans = np.zeros(3), np.zeros(2), None, [np.zeros(3)], []
    for k in range(round(seconds / period)):
        c, s = math.cos(pose[2]), math.sin(pose[2])
        north, east = goal[0] - pose[0], goal[1] - pose[1]
        seen = (c * north + s * east, c * east - s * north, goal[2] - pose[2])
        last = plan(seen, planner=planner, last=last, t_start=k * period, speed=controls[0], yaw_rate=controls[1])
        controls = last.controls[0]
        course = pose[2] + 0.5 * period * controls[1]
        pose = pose + period * np.array([controls[0] * math.cos(course), controls[0] * math.sin(course), controls[1]])
        poses.append(pose)
        plans.append(last)
    return np.array(poses), plans


@pytest.mark.parametrize("goal", [(0.0, 0.2, 0.0), (0.0, -0.4, 0.0), (0.0, 0.4, -0.4), (0.2, 0.6, 0.2)])
def test_a_correction_planned_again_and_again_backs_out_and_arrives(goal):
    poses, plans = drive_to(goal, planner=PLANNERS[QpBackend.PIQP], seconds=12.0)
    assert math.dist(poses[-1, :2], goal[:2]) < 0.03
    assert abs(poses[-1, 2] - goal[2]) < 0.03
    assert poses[:, 0].min() < -0.3
    assert plans[0].correction_began == 0.0
    assert plans[-1].correction_began is None


def test_an_intercept_planned_again_and_again_arrives():
    poses, plans = drive_to((3.0, 1.5, 0.6), planner=PLANNERS[QpBackend.PIQP], seconds=9.0)
    assert poses[-1] == pytest.approx((3.0, 1.5, 0.6), abs=0.03)
    assert max(p.violation.worst for p in plans) <= 1e-9
    assert np.median([p.iterations for p in plans]) <= 4


def test_without_the_bias_some_lateral_correction_drives_ahead_first():
    planner = CoupledPlanner(ROVER, CoupledParameters(weights=CostWeights(reverse=0.0)))
    ahead = [plan((0.0, y, 0.0), planner=planner).poses[:, 0].max() for y in (-0.6, -0.4, -0.2, 0.2, 0.4, 0.6)]
    assert max(ahead) > 0.1


def test_a_rover_that_cannot_reverse_never_does():
    rover = RoverMotion(speed_reverse=0.0)
    planner = CoupledPlanner(rover, PARAMETERS)
    for goal in ((3.0, 1.0, 0.3), (0.0, 0.4, 0.0), (-2.0, 0.0, 0.0)):
        result = plan(goal, planner=planner)
        assert_drivable(result, rover)
        assert result.controls[:, 0].min() >= -1e-9
        assert result.correction_began is None


@pytest.mark.parametrize("backend", list(QpBackend))
def test_a_warm_start_comes_to_the_cold_starts_optimum(backend):
    planner = CoupledPlanner(ROVER, replace(PRECISE, solver=backend))
    goal = (3.0, 1.0, 0.5)
    first = plan(goal, planner=planner)
    # 0.2 s later, seen from where it has driven to:
    x, y, heading = first.poses[1]
    c, s = math.cos(heading), math.sin(heading)
    ahead, aside = goal[0] - x, goal[1] - y
    later = (c * ahead + s * aside, c * aside - s * ahead, goal[2] - heading)
    more = {"speed": first.controls[0, 0], "yaw_rate": first.controls[0, 1], "t_start": STEP}
    cold = plan(later, planner=planner, **more)
    warm = plan(later, planner=planner, last=first, **more)
    assert warm.objective == pytest.approx(cold.objective, rel=1e-4)
    assert warm.poses == pytest.approx(cold.poses, abs=0.05)
    assert warm.objective_first < cold.objective_first
    assert warm.iterations < cold.iterations


def test_both_solvers_come_to_the_same_plan():
    for goal in REACHABLE:
        one, other = (
            CoupledPlanner(ROVER, replace(PRECISE, solver=backend)).plan(request(goal))
            for backend in (QpBackend.PIQP, QpBackend.OSQP)
        )
        assert one.objective == pytest.approx(other.objective, rel=1e-3)
        assert one.poses == pytest.approx(other.poses, abs=0.03)


@pytest.mark.parametrize("backend", list(QpBackend))
@pytest.mark.parametrize(("speed", "yaw_rate"), [(1.8, 0.0), (-1.7, 0.0), (0.2, 1.9), (0.0, 1.5)])
def test_an_infeasible_start_is_recovered_by_slack_and_says_so(speed, yaw_rate, backend):
    result = plan((3.0, 0.8, 0.2), planner=PLANNERS[backend], speed=speed, yaw_rate=yaw_rate)
    assert result.elastic
    assert result.slack > 0.05
    assert max(result.violation.speed, result.violation.turning) > 0.05
    assert result.violation.acceleration <= 1e-9
    assert result.violation.yaw_acceleration <= 1e-9
    assert result.violation.dynamics <= 1e-9
    # It comes back as fast as the accelerations allow, and stays.
    late = result.controls[8:]
    assert np.abs(late[:, 0]).max() <= 1.0 + 1e-3
    assert np.all(ROVER.turning_radius * np.abs(late[:, 1]) <= np.abs(late[:, 0]) + 1e-3)
    assert math.dist(result.poses[-1, :2], (3.0, 0.8)) < 0.1


def test_slack_is_used_no_more_than_the_brakes_need():
    result = plan((3.0, 0.8, 0.2), speed=1.8)
    over = np.maximum(np.abs(result.controls[:, 0]) - ROVER.speed_forward, 0.0)
    braking = np.maximum(1.8 - ROVER.acceleration * STEP * np.arange(1, 31) - ROVER.speed_forward, 0.0)
    assert over == pytest.approx(braking, abs=2e-3)


class Ticks:
    """A clock that advances by one each time it is read."""

    def __init__(self):
        self.now = -1.0

    def __call__(self):
        self.now += 1.0
        return self.now


def test_a_deadline_gives_the_best_drivable_iterate_so_far():
    goal = (0.3, 0.5, -0.5)
    objectives = []
    for t in (0.0, 2.0, 3.0, 4.0, 5.0, 100.0):
        result = plan(goal, deadline=Deadline(clock=Ticks(), t=t))
        assert_drivable(result)
        assert result.violation.worst <= 1e-9
        objectives.append(result.objective)
        if t < 100.0:
            assert result.end is PlanEnd.DEADLINE
            assert result.iterations == max(int(t) - 1, 1 if t > 0.0 else 0)
    assert objectives == sorted(objectives, reverse=True)
    assert objectives[0] > objectives[-1] + 0.5


def test_a_budget_of_iterations_is_kept():
    planner = CoupledPlanner(ROVER, CoupledParameters(iterations_max=2))
    result = plan((0.3, 0.5, -0.5), planner=planner)
    assert (result.end, result.iterations) == (PlanEnd.ITERATIONS, 2)
    assert_drivable(result)


def test_a_solver_that_fails_leaves_a_drivable_plan():
    class Failing:
        def __init__(self, program, tolerance):
            self.size = len(program.q)

        def solve(self, guess):
            return QpSolution(
                z=np.full(self.size, math.nan),
                usable=False,
                status="broken",
                iterations=3,
                residual_primal=0.0,
                residual_dual=0.0,
            )

    result = plan((3.0, 1.0, 0.3), planner=CoupledPlanner(ROVER, PARAMETERS, Failing))
    assert (result.end, result.iterations, result.solver_iterations) == (PlanEnd.SOLVER_FAILED, 1, 3)
    assert result.objective == result.objective_first
    assert_drivable(result)


def test_a_solver_that_misleads_makes_nothing_worse_and_is_trusted_less(monkeypatch):
    class Misleading:
        def __init__(self, program, tolerance):
            self.size = len(program.q)

        def solve(self, guess):
            z = np.random.default_rng(1).uniform(-1, 1, self.size)
            return QpSolution(z=z, usable=True, status="", iterations=1, residual_primal=0.0, residual_dual=0.0)

    trusts, linearise = [], ConvexProgram.linearise

    def noted(self, problem, poses, controls, trust):
        trusts.append(trust)
        linearise(self, problem, poses, controls, trust)

    monkeypatch.setattr(ConvexProgram, "linearise", noted)
    honest = plan((3.0, 1.0, 0.3))
    assert trusts[0] == PARAMETERS.trust_first
    assert max(trusts) == PARAMETERS.trust_max  # a program that keeps its word is trusted further
    trusts.clear()
    monkeypatch.setattr(ConvexProgram, "gain", lambda *_: 1.0)  # what its solutions promise and do not keep
    result = plan((3.0, 1.0, 0.3), planner=CoupledPlanner(ROVER, PARAMETERS, Misleading), last=honest)
    assert result.objective <= result.objective_first
    assert len(trusts) > 2
    assert np.all(np.diff(trusts) < 0.0)
    assert_drivable(result)


@pytest.mark.parametrize(("goal", "target"), [((3.0, -1.5, 0.0), (5.0, 0.0)), ((2.5, 1.5, 0.0), (4.0, 0.0))])
def test_the_cameras_term_keeps_the_target_in_sight(goal, target):
    targets = np.tile(target, (31, 1))
    blind = CoupledPlanner(ROVER, CoupledParameters(weights=CostWeights(view=0.0)))
    without, with_term = (plan(goal, planner=p, target=targets) for p in (blind, PLANNERS[QpBackend.PIQP]))
    assert without.view_excess > 0.4
    assert with_term.view_excess < 0.2
    assert math.dist(with_term.poses[-1, :2], goal[:2]) < 0.15
    assert with_term.violation.worst <= 1e-9


def test_a_moving_goal_is_followed():
    t = np.arange(31) * STEP
    goal = np.stack((1.0 + 0.5 * t, 0.3 * np.ones(31), np.zeros(31)), axis=1)
    result = plan(goal)
    assert np.abs(result.poses[-8:, :2] - goal[-8:, :2]).max() < 0.15
    assert result.controls[-5:, 0] == pytest.approx(0.5, abs=0.1)


def test_a_turned_heading_counts_by_the_full_turn():
    one, other = plan((3.0, 1.0, 0.5)), plan((3.0, 1.0, 0.5 + 2 * math.pi))
    assert one.poses == pytest.approx(other.poses, abs=1e-6)
    assert one.objective == pytest.approx(other.objective)


def test_the_same_requests_give_the_same_bytes():
    def all_plans():
        planner, last, found = CoupledPlanner(ROVER, PARAMETERS), None, []
        for k in range(4):
            last = plan((3.0, 1.0 + 0.1 * k, 0.5), planner=planner, last=last, t_start=0.1 * k)
            found.append(last.controls.tobytes())
        return found

    assert all_plans() == all_plans()


def test_the_trajectory_follows_the_plans_poses_in_the_local_frame():
    result = plan((3.0, 2.0, 1.2), t_start=10.0)
    trajectory = RoverTrajectory(
        plan=result, origin_ned=(5.0, -2.0, -0.3), yaw=2.0, midpoint=0.5, t_expiry=11.0, reset_counter=3
    )
    c, s = math.cos(2.0), math.sin(2.0)
    for k, (x, y, heading) in enumerate(result.poses):
        state = trajectory.at(10.0 + k * STEP + 1e-9)
        assert state.position_ned == pytest.approx((5.0 + c * x - s * y, -2.0 + s * x + c * y, -0.3), abs=1e-6)
        assert state.yaw == pytest.approx(2.0 + heading, abs=1e-6)
    h = 1e-5
    for t in np.linspace(10.05, 15.9, 23):
        before, now, after = (trajectory.at(t + d) for d in (-h, 0.0, h))
        assert (after.position_ned - before.position_ned) / (2 * h) == pytest.approx(now.velocity_ned, abs=0.13)
        assert (after.yaw - before.yaw) / (2 * h) == pytest.approx(now.yaw_rate, abs=1e-6)
    assert (trajectory.t_start, trajectory.t_end) == (10.0, 16.0)
    assert np.all(trajectory.at(20.0).velocity_ned == 0.0)


def test_what_cannot_be_planned_is_refused():
    with pytest.raises(ValueError, match="finite"):
        request((math.nan, 0.0, 0.0))
    with pytest.raises(ValueError, match="positive"):
        CoupledRequest(t_start=0.0, step=0.0, goal=np.zeros(3))
    with pytest.raises(ValueError, match="horizon of 30"):
        plan(np.zeros((7, 3)))


def problem(**more):
    numbers = {
        "rover": ROVER,
        "weights": CostWeights(),
        "view": CameraView(),
        "midpoint": 0.5,
        "step": STEP,
        "start": (0.0, 0.0),
        "goal": np.zeros((31, 3)),
        "target": None,
        "bias": np.zeros(30),
    }
    return NonlinearProblem(**(numbers | more))


@pytest.mark.parametrize(
    "rover",
    [
        ROVER,
        RoverMotion(acceleration=4.0, yaw_acceleration=0.4),
        RoverMotion(speed_reverse=0.0),
        RoverMotion(yaw_rate=0.4),
    ],
)
@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_any_controls_are_made_drivable_and_drivable_ones_stay(rover, seed):
    rng, stated = np.random.default_rng(seed), problem(rover=rover)
    made = stated.drivable(rng.uniform(-3, 3, (30, 2)))
    assert stated.violation(stated.rolled_out(made), made).worst <= 1e-9
    assert stated.drivable(made) == pytest.approx(made, abs=1e-12)


def test_a_plan_goes_around_what_it_must_keep_clear_of():
    """The place lies beyond the target: straight ahead is through it."""
    weights = CostWeights(clearance=40.0, clearance_m=1.0)
    target = np.tile((2.0, 0.0), (PARAMETERS.horizon + 1, 1))
    distances = [
        np.hypot(*(found.poses[:, :2] - target).T).min()
        for found in (
            plan((4.0, 0.1, 0.0), target=target, planner=CoupledPlanner(ROVER, replace(PARAMETERS, weights=chosen)))
            for chosen in (CostWeights(view=0.0), replace(weights, view=0.0))
        )
    ]
    assert distances[0] < 0.3
    assert distances[1] > 0.75


def test_a_plan_that_may_only_drive_forward_does_so_below_the_speed_it_may():
    result = plan((-1.0, 0.3, 0.2), forward_only=True)
    assert result.controls[:, 0].min() >= -1e-9
    assert result.correction_began is None
    slow = plan((4.0, 0.0, 0.0), speed_most=0.3)
    assert slow.controls[:, 0].max() <= 0.3 + 1e-9
    assert_drivable(slow, rover=replace(ROVER, speed_forward=0.3))


@pytest.mark.parametrize("backend", list(QpBackend))
@pytest.mark.parametrize("goal", [(1.5, 2.5, 3.0), (0.0, 3.0, 3.1), (3.0, 2.0, 1.2)])
def test_it_turns_no_faster_than_it_may_though_the_radius_would_allow_it(goal, backend):
    rover = replace(ROVER, speed_forward=1.5, yaw_rate=0.8)
    planner = CoupledPlanner(rover, replace(PARAMETERS, solver=backend))
    result = plan(goal, planner=planner)
    assert_drivable(result, rover=rover)
    assert result.violation.yaw_rate == 0.0
    assert np.abs(result.controls[:, 1]).max() == pytest.approx(0.8)
    free = plan(goal, planner=CoupledPlanner(replace(rover, yaw_rate=5.0), replace(PARAMETERS, solver=backend)))
    assert np.abs(free.controls[:, 1]).max() > 1.0


def test_what_turns_too_fast_already_comes_down_as_fast_as_it_may():
    rover = replace(ROVER, yaw_rate=0.5, yaw_acceleration=1.0)
    result = plan((3.0, 1.0, 0.5), speed=1.0, yaw_rate=1.1, planner=CoupledPlanner(rover, PARAMETERS))
    steps = int(np.ceil((1.1 - 0.5) / (rover.yaw_acceleration * STEP)))
    assert result.violation.yaw_rate > 0.0
    assert np.abs(result.controls[steps:, 1]).max() <= 0.5 + 1e-9
    assert result.violation.yaw_acceleration <= 1e-9


def test_the_speed_wanted_costs_nothing_and_weights_come_with_the_request():
    goal = np.array([(0.5 * STEP * k, 0.0, 0.0) for k in range(PARAMETERS.horizon + 1)])
    weights = replace(PARAMETERS.weights, speed=5.0)
    kept = plan(goal, speed=0.5, weights=weights, speed_wanted=0.5)
    slowed = plan(goal, speed=0.5, weights=weights)
    assert kept.controls[:, 0] == pytest.approx(0.5, abs=0.02)
    assert slowed.controls[:, 0].mean() < 0.47
