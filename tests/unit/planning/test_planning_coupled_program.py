"""One convex program of the coupled planner: it touches the nonlinear problem at the iterate, and stays inside."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.planning.coupled.guesses import is_lateral_correction, moved_on, simple_drives
from companion.planning.coupled.model import CameraView, CostWeights, NonlinearProblem, RoverMotion
from companion.planning.coupled.program import ConvexProgram
from companion.planning.coupled.qp import OsqpSolver, PiqpSolver, SparsePattern

N, STEP = 12, 0.2
ROVER = RoverMotion()
SEEDS = st.integers(0, 10**6)


def problem_of(rng, **more):
    numbers = {
        "rover": ROVER,
        "weights": CostWeights(stage_heading=0.3, clearance=7.0, clearance_m=4.0),
        "view": CameraView(half_angle=0.3, yaw=0.2, forward=0.4),
        "midpoint": 0.5,
        "step": STEP,
        "start": (0.2, 0.1),
        "goal": rng.uniform(-2, 2, (N + 1, 3)),
        "target": rng.uniform(2, 6, (N + 1, 2)),
        "bias": rng.uniform(0, 1, N),
    }
    return NonlinearProblem(**(numbers | more))


def linearised(seed, *, elastic=False, **more):
    rng = np.random.default_rng(seed)
    problem = problem_of(rng, **more)
    controls = problem.drivable(rng.uniform(-1, 1, (N, 2)))
    poses = problem.rolled_out(controls)
    program = ConvexProgram(N, elastic=elastic, standing=0.02)
    program.pose(problem, 100.0)
    program.linearise(problem, poses, controls, 0.5)
    for pattern in (program.program.p, program.program.a, program.program.g):
        pattern.apply()
    return rng, problem, program, poses, controls


def defect(problem, poses, controls):
    """Give what is left of equation 7, nonlinear, row by row."""
    course = poses[:-1, 2] + problem.midpoint * STEP * controls[:, 1]
    moved = np.stack((controls[:, 0] * np.cos(course), controls[:, 0] * np.sin(course), controls[:, 1]), axis=1) * STEP
    return np.concatenate((poses[0], (np.diff(poses, axis=0) - moved).ravel()))


@pytest.mark.parametrize("midpoint", [0.0, 0.5])
@given(seed=SEEDS)
@settings(max_examples=20, deadline=None)
def test_the_dynamics_are_the_tangent_of_the_nonlinear_ones(midpoint, seed):
    rng, problem, program, poses, controls = linearised(seed, midpoint=midpoint)
    p = program.program
    at = program.stacked(poses, controls, np.zeros(N))
    assert p.a.matrix @ at == pytest.approx(p.b, abs=1e-12)
    d_poses, d_controls = rng.normal(size=(N + 1, 3)), rng.normal(size=(N, 2))
    direction = program.stacked(d_poses, d_controls, np.zeros(N))
    h = 1e-6
    slope = (
        defect(problem, poses + h * d_poses, controls + h * d_controls)
        - defect(problem, poses - h * d_poses, controls - h * d_controls)
    ) / (2 * h)
    assert p.a.matrix @ direction == pytest.approx(slope, abs=1e-7)


@given(seed=SEEDS)
@settings(max_examples=40, deadline=None)
def test_the_cost_is_the_tangent_of_the_nonlinear_one(seed):
    rng, problem, program, poses, controls = linearised(seed)
    at = program.stacked(poses, controls, np.zeros(N))
    d_poses, d_controls = rng.normal(size=(N + 1, 3)), rng.normal(size=(N, 2))
    d_poses[0] = 0.0
    h = 1e-6
    ends = [(poses + k * h * d_poses, controls + k * h * d_controls) for k in (-1, 1)]
    nonlinear = float(problem.objective(*ends[0]) - problem.objective(*ends[1]))
    quadratic = program.gain(*(program.stacked(*end, np.zeros(N)) for end in ends))
    assert quadratic == pytest.approx(nonlinear, rel=1e-4, abs=1e-9)
    assert program.gain(at, at) == 0.0


@given(seed=SEEDS)
@settings(max_examples=40, deadline=None)
def test_what_keeps_the_linearised_bounds_keeps_the_nonlinear_ones(seed):
    rng, _, program, poses, controls = linearised(seed)
    p = program.program
    other = controls + rng.normal(scale=0.4, size=(N, 2))
    z = program.stacked(poses, other, np.zeros(N))
    slack = np.maximum(p.g.matrix @ z - p.g_high, p.g_low - p.g.matrix @ z)
    turning = np.maximum(slack[:N], slack[N : 2 * N])
    allowed = ROVER.turning_radius * np.abs(other[:, 1]) <= np.abs(other[:, 0]) + 2e-2 + 1e-9
    assert np.all(allowed[turning <= 0.0])
    # The iterate itself keeps them.
    at = program.stacked(poses, controls, np.zeros(N))
    assert np.all(p.g.matrix @ at <= p.g_high + 1e-9)
    assert np.all(p.g.matrix @ at >= p.g_low - 1e-9)
    assert np.all((p.low <= at + 1e-9) & (at <= p.high + 1e-9))


def test_equation_8_is_not_empty_backwards():
    rng = np.random.default_rng(0)
    problem = problem_of(rng)
    controls = np.tile((-0.8, 0.5), (N, 1))
    program = ConvexProgram(N, elastic=False, standing=0.02)
    program.pose(problem, 100.0)
    program.linearise(problem, problem.rolled_out(controls), controls, 0.5)
    p = program.program
    z = program.stacked(problem.rolled_out(controls), controls, np.zeros(N))
    assert np.all(p.g.apply() @ z <= np.where(np.arange(len(p.g_high)) < 2 * N, p.g_high, math.inf))


@given(seed=SEEDS)
@settings(max_examples=15, deadline=None)
def test_a_solution_stays_within_the_trust_region(seed):
    _, problem, program, poses, controls = linearised(seed, goal=np.tile((0.0, 3.0, 3.0), (N + 1, 1)))
    turned = []
    for trust in (0.3, 0.05):
        program.linearise(problem, poses, controls, trust)
        z = PiqpSolver(program.program, 1e-8).solve(program.stacked(poses, controls, np.zeros(N))).z
        headings = np.append(z[: 5 * N].reshape(N, 5)[:, 2], z[5 * N + 2])
        turned.append(np.abs(headings - poses[:, 2]).max())
        assert turned[-1] <= trust + 1e-6
    assert turned[1] < turned[0]


@pytest.mark.parametrize("elastic", [False, True])
@given(seed=SEEDS)
@settings(max_examples=15, deadline=None)
def test_both_solvers_solve_the_same_program(elastic, seed):
    _, _, program, poses, controls = linearised(seed, elastic=elastic)
    guess = program.stacked(poses, controls, np.zeros(N))
    one = PiqpSolver(program.program, 1e-8).solve(guess)
    other = OsqpSolver(program.program, 1e-5).solve(guess)
    assert one.usable
    assert other.usable
    assert one.residual_primal < 1e-6
    assert program.gain(guess, one.z) >= -1e-6
    assert program.gain(guess, one.z) == pytest.approx(program.gain(guess, other.z), rel=1e-2, abs=1e-2)


@pytest.mark.parametrize("make", [PiqpSolver, OsqpSolver])
def test_updating_in_place_solves_as_building_anew(make):
    _, problem, program, poses, controls = linearised(5)
    kept = make(program.program, 1e-7)
    for scale in (1.0, 0.5, 0.1):
        program.linearise(problem, problem.rolled_out(controls * scale), controls * scale, 0.4)
        again = kept.solve(program.stacked(poses, controls, np.zeros(N)))
        fresh = make(program.program, 1e-7).solve(program.stacked(poses, controls, np.zeros(N)))
        assert again.z == pytest.approx(fresh.z, abs=2e-3)


def test_a_sparse_pattern_is_written_by_order_of_declaration():
    pattern = SparsePattern.of(np.array([1, 0, 1]), np.array([0, 2, 2]), (2, 3))
    pattern.entries[:] = (5.0, 6.0, 7.0)
    assert pattern.apply().toarray().tolist() == [[0.0, 0.0, 6.0], [5.0, 0.0, 7.0]]
    with pytest.raises(ValueError, match="twice"):
        SparsePattern.of(np.array([0, 0]), np.array([1, 1]), (2, 2))


def test_simple_drives_keep_speed_and_turning_radius():
    drives = simple_drives(ROVER, 30)
    assert np.abs(drives[..., 0]).max() <= 1.0
    assert np.all(ROVER.turning_radius * np.abs(drives[..., 1]) <= np.abs(drives[..., 0]) + 1e-12)
    assert drives[..., 0].min() < 0.0
    assert simple_drives(RoverMotion(speed_reverse=0.0), 30)[..., 0].min() == 0.0


def test_a_plan_moves_on_by_the_time_that_has_passed():
    controls = np.stack((np.arange(5.0), np.zeros(5)), axis=1)
    assert moved_on(controls, 0.0, 0.2, 0.2) == pytest.approx(controls)
    assert moved_on(controls, 0.4, 0.2, 0.2)[:, 0].tolist() == [2.0, 3.0, 4.0, 0.0, 0.0]
    assert moved_on(controls, 0.2, 0.2, 0.1)[:, 0].tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ((0.0, 0.4, 0.0), True),
        ((0.0, -0.4, 0.0), True),
        ((0.5, 0.4, 0.0), True),
        ((1.5, 0.4, 0.0), False),  # two arcs of 0.8 m do it
        ((1.0, 0.0, 0.0), False),
        ((0.5, 0.2, 0.38), False),  # straight along its own heading
        ((0.0, 3.0, 0.0), False),  # far: an intercept
    ],
)
def test_a_lateral_correction_is_told_from_an_intercept(goal, expected):
    assert is_lateral_correction(np.array(goal), 0.8, 2.5, 0.05) is expected
