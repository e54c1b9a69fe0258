"""The coupled planner: a sequence of convex programs (Patel et al., section 3, "Coupled Position and Orientation").

Every iterate is drivable: the controls that a convex program gives are brought into the nonlinear bounds and rolled
out by the nonlinear model, so the sequence may be stopped at any time, and the best iterate followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.planning.coupled.guesses import DriveTable, is_lateral_correction, moved_on, simple_drives
from companion.planning.coupled.model import (
    CoupledRequest,
    NonlinearProblem,
    RoverMotion,
)
from companion.planning.coupled.plan import CoupledParameters, CoupledPlan, Deadline, PlanEnd
from companion.planning.coupled.program import ConvexProgram
from companion.planning.coupled.qp import SOLVERS, TOLERANCES, QpSolution, QpSolver, SolverFactory


@dataclass(slots=True, kw_only=True, eq=False)
class _Iterate:
    controls: Array
    poses: Array
    objective: float
    merit: float  # objective and the price of slack: what the sequence lowers


@dataclass(slots=True, kw_only=True, eq=False)
class _Tally:
    end: PlanEnd = PlanEnd.ITERATIONS
    programs: int = 0
    solver_iterations: int = 0
    primal: float = 0.0
    dual: float = 0.0
    slack: float = 0.0

    def add(self, solution: QpSolution) -> None:
        self.programs += 1
        self.solver_iterations += solution.iterations
        self.primal = max(self.primal, solution.residual_primal)
        self.dual = max(solution.residual_dual, self.dual)  # a NaN stays


# Shares of a program's step that are tried at once, by rolling all out together.
_SHARES = np.array((1.0, 0.7, 0.45, 0.25, 0.12, 0.05))[:, None, None]


class CoupledPlanner:
    """Plans for one rover; holds the convex programs, whose matrices are built once.

    Args:
        rover: what it can do.
        parameters: of the sequence.
        make_solver: a solver of one's own in place of the parameters'.
    """

    def __init__(
        self, rover: RoverMotion, parameters: CoupledParameters, make_solver: SolverFactory | None = None
    ) -> None:
        self._rover, self._parameters = rover, parameters
        make = make_solver or SOLVERS[parameters.solver]
        tolerance = parameters.solver_tolerance or TOLERANCES[parameters.solver]
        self._solvers: dict[bool, tuple[ConvexProgram, QpSolver]] = {}
        for elastic in (False, True):
            program = ConvexProgram(parameters.horizon, elastic=elastic, standing=parameters.standing)
            solver = make(program.program, tolerance)
            self._solvers[elastic] = (program, solver)
        self._drives = simple_drives(rover, parameters.horizon)
        self._table: tuple[float, DriveTable] | None = None  # for the last length of step

    def plan(
        self, request: CoupledRequest, *, last: CoupledPlan | None = None, deadline: Deadline | None = None
    ) -> CoupledPlan:
        """Minimise equation 6 under equations 7 and 8.

        Args:
            request: the problem.
            last: an earlier plan; the sequence starts from what is left of it.
            deadline: when to stop with the best iterate so far; None: only convergence and the number of iterations.

        Raises:
            ValueError: goal or target have another length than the horizon.
        """
        goal = self._goal(request)
        began = self._correction(request, goal[-1], last)
        problem = self._problem(request, goal, began)
        best = self._first(problem, request, last)
        first = best.objective
        elastic = problem.violation(best.poses, best.controls).worst > 1e-9
        program, solver = self._solvers[elastic]
        program.pose(problem, self._parameters.slack_cost)
        best, tally = self._improve(problem, program, solver, best, deadline)
        excess = 0.0
        if problem.target is not None:
            excess = max(float(np.abs(problem.bearing(best.poses)).max()) - problem.view.half_angle, 0.0)
        return CoupledPlan(
            t_start=request.t_start,
            step=request.step,
            controls=frozen(best.controls),
            poses=frozen(best.poses),
            objective=best.objective,
            objective_first=first,
            violation=problem.violation(best.poses, best.controls),
            end=tally.end,
            iterations=tally.programs,
            solver_iterations=tally.solver_iterations,
            residual_primal=tally.primal,
            residual_dual=tally.dual,
            slack=tally.slack,
            elastic=elastic,
            correction_began=began,
            view_excess=excess,
        )

    def _goal(self, request: CoupledRequest) -> Array:
        """Give the goal (N + 1, 3)."""
        n = self._parameters.horizon
        goal = np.broadcast_to(request.goal, (n + 1, 3)) if request.goal.shape == (3,) else request.goal
        if goal.shape != (n + 1, 3) or (request.target is not None and request.target.shape != (n + 1, 2)):
            raise ValueError(f"goal must be (3,) or ({n + 1}, 3) and target ({n + 1}, 2) for a horizon of {n} steps")
        return goal

    def _correction(self, request: CoupledRequest, goal: Array, last: CoupledPlan | None) -> float | None:
        """Say when the present lateral correction began [s], or that there is none.

        It is begun once, not in each plan: a reward for backing out that starts anew with every plan is never used up,
        and the rover would back out forever.
        """
        p = self._parameters
        if request.forward_only or self._rover.speed_reverse == 0.0 or (request.weights or p.weights).reverse == 0.0:
            return None
        needed = is_lateral_correction(goal, self._rover.turning_radius, p.correction_reach, p.correction_tolerance)
        began = None if last is None else last.correction_began
        if began is not None:
            since = request.t_start - began
            if since < p.reverse_time or (needed and since < p.correction_time):
                return began
        return request.t_start if needed else None

    def _problem(self, request: CoupledRequest, goal: Array, began: float | None) -> NonlinearProblem:
        p, n = self._parameters, self._parameters.horizon
        weights = request.weights or p.weights
        bias = np.full(n, -2.0 * weights.speed * request.speed_wanted)
        if began is not None:
            left = began + p.reverse_time - request.t_start
            bias[: max(math.ceil(left / request.step - 1e-9), 0)] += weights.reverse
        return NonlinearProblem(
            rover=replace(
                self._rover,
                speed_forward=min(self._rover.speed_forward, request.speed_most),
                speed_reverse=0.0 if request.forward_only else self._rover.speed_reverse,
            ),
            weights=weights,
            view=p.view,
            midpoint=p.midpoint,
            step=request.step,
            start=(request.speed, request.yaw_rate),
            goal=goal,
            target=request.target,
            bias=bias,
        )

    def _first(self, problem: NonlinearProblem, request: CoupledRequest, last: CoupledPlan | None) -> _Iterate:
        """Give the last plan moved on, or the best simple drive where there is none or it has become dear."""
        warm = None
        if last is not None and len(last.controls) == self._parameters.horizon:
            elapsed = max(request.t_start - last.t_start, 0.0)
            warm = self._iterate(problem, problem.drivable(moved_on(last.controls, elapsed, last.step, request.step)))
            if warm.objective <= last.objective + self._parameters.restart_growth * (abs(last.objective) + 0.1):
                return warm
        if self._table is None or self._table[0] != request.step:
            self._table = (request.step, DriveTable(problem, self._drives))
        cold = self._iterate(problem, problem.drivable(self._table[1].best(problem)))
        return cold if warm is None or cold.objective < warm.objective else warm

    def _improve(
        self,
        problem: NonlinearProblem,
        program: ConvexProgram,
        solver: QpSolver,
        best: _Iterate,
        deadline: Deadline | None,
    ) -> tuple[_Iterate, _Tally]:
        """Solve convex programs until nothing is gained, or the iterations or the time are used up."""
        p, tally, trust = self._parameters, _Tally(), self._parameters.trust_first
        begin, longest = (deadline.clock() if deadline else 0.0), 0.0
        while tally.programs < p.iterations_max:
            if deadline is not None and begin + longest >= deadline.t:
                tally.end = PlanEnd.DEADLINE
                break
            program.linearise(problem, best.poses, best.controls, trust)
            z = program.stacked(best.poses, best.controls, problem.slack(best.controls))
            solution = solver.solve(z)
            tally.add(solution)
            if not solution.usable:
                tally.end = PlanEnd.SOLVER_FAILED
                break
            tally.slack = program.slack(solution.z)
            candidate, share = self._along(problem, best, program.controls(solution.z))
            predicted, gained = program.gain(z, solution.z), best.merit - candidate.merit
            moved = max(
                float(np.abs(candidate.controls - best.controls).max()),
                float(np.abs(candidate.poses - best.poses).max()),
            )
            if gained > 0.0:
                best = candidate
            small = p.tolerance_cost * (abs(best.merit) + 1e-3)
            if share == 1.0 and gained > 0.75 * predicted:
                trust = min(2.0 * trust, p.trust_max)
            elif share < 0.5 or gained <= 0.0:
                trust *= 0.4
            if predicted <= small or (gained > 0.0 and (moved < p.tolerance or gained <= small)) or trust < p.trust_min:
                tally.end = PlanEnd.CONVERGED
                break
            if deadline is not None:
                now = deadline.clock()
                begin, longest = now, max(longest, now - begin)
        return best, tally

    def _iterate(self, problem: NonlinearProblem, controls: Array) -> _Iterate:
        poses = problem.rolled_out(controls)
        objective = float(problem.objective(poses, controls))
        merit = objective + self._parameters.slack_cost * float(problem.slack(controls).sum())
        return _Iterate(controls=controls, poses=poses, objective=objective, merit=merit)

    def _along(self, problem: NonlinearProblem, start: _Iterate, wanted: Array) -> tuple[_Iterate, float]:
        """Give the best drivable iterate on the way from one to the controls wanted, and its share of the way."""
        wanted = problem.drivable(wanted)
        controls = start.controls + _SHARES * (wanted - start.controls)
        costs = problem.objective(problem.rolled_out(controls), controls)
        costs = costs + self._parameters.slack_cost * problem.slack(controls).sum(axis=-1)
        index = int(np.argmin(costs))
        # Between two gears lies a standstill, at which it must not turn.
        found = wanted if index == 0 else problem.drivable(controls[index])
        return self._iterate(problem, found), float(_SHARES[index, 0, 0])
