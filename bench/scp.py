"""The coupled planner at horizon 30: what a whole plan costs, beside CVXPY and a rebuild of the matrices at each step.

Run: python bench/scp.py [--plans-of-the-slow N]. Times are CPU time of the thread, and wall time beside it.

The requests come from rovers that drive after their targets: every solver plans each of them from the same last plan.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import piqp
from scipy.sparse import coo_matrix

from companion.planning.coupled.model import CoupledRequest, RoverMotion
from companion.planning.coupled.plan import CoupledParameters, CoupledPlan
from companion.planning.coupled.qp import QpBackend, QpSolution, QuadraticProgram
from companion.planning.coupled.scp import CoupledPlanner

STANDOFF = 1.25  # [m]
STEP = 0.2  # [s]
PERIOD = 0.1  # [s] between plans
PARAMETERS = CoupledParameters()
HORIZON = PARAMETERS.horizon
MEDIAN_REQUIRED, P99_REQUIRED = 4.0, 10.0  # [ms]


@dataclass(frozen=True)
class Planned:
    """A request and the plan that came before it."""

    case: str
    request: CoupledRequest
    last: CoupledPlan | None


Track = Callable[[float], tuple[np.ndarray, float]]  # time [s] to the target's place [m] and heading [rad]


def circling(rng: np.random.Generator, place: np.ndarray, heading: float) -> Track:
    speed, turn = rng.uniform(0.1, 0.6), rng.choice((-1, 1)) * rng.uniform(0.01, 0.15)

    def track(t: float) -> tuple[np.ndarray, float]:
        now = heading + turn * t
        way = np.array((math.sin(now) - math.sin(heading), math.cos(heading) - math.cos(now))) * speed / turn
        return place + way, now

    return track


def waving(rng: np.random.Generator, place: np.ndarray, _: float) -> Track:
    """A leader along a sine wave, as in table 2."""
    speed, length, height = rng.uniform(0.25, 0.8), rng.uniform(5, 10), rng.uniform(0.25, 1.0)

    def track(t: float) -> tuple[np.ndarray, float]:
        phase = 2.0 * math.pi * speed * t / length
        slope = 2.0 * math.pi * height / length * math.cos(phase)
        return place + np.array((speed * t, height * math.sin(phase))), math.atan(slope)

    return track


def seen_from(pose: np.ndarray, t: float, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Give goals (N + 1, 3), `STANDOFF` behind the target, and the target's places (N + 1, 2), in the rover's frame."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    into = np.array(((cosine, sine), (-sine, cosine)))
    goals, targets = [], []
    for k in range(HORIZON + 1):
        place, heading = track(t + k * STEP)
        behind = place - STANDOFF * np.array((math.cos(heading), math.sin(heading)))
        goals.append((*(into @ (behind - pose[:2])), heading - pose[2]))
        targets.append(into @ (place - pose[:2]))
    return np.array(goals), np.array(targets)


def pursuit(case: str, planner: CoupledPlanner, track: Track, duration: float) -> Iterator[Planned]:
    """Drive after a target, planning at 10 Hz, each plan from the last."""
    pose, controls, last = np.zeros(3), np.zeros(2), None
    for k in range(round(duration / PERIOD)):
        goal, target = seen_from(pose, k * PERIOD, track)
        request = CoupledRequest(
            t_start=k * PERIOD, step=STEP, goal=goal, target=target, speed=controls[0], yaw_rate=controls[1]
        )
        yield Planned(case, request, last)
        last = planner.plan(request, last=last)
        controls = last.controls[0]
        course = pose[2] + 0.5 * PERIOD * controls[1]
        pose = pose + PERIOD * np.array((controls[0] * math.cos(course), controls[0] * math.sin(course), controls[1]))


def problems() -> list[Planned]:
    """Give the requests: lateral intercepts, leaders followed, and lateral corrections from a cold start."""
    rng, found = np.random.default_rng(4), []
    planner = CoupledPlanner(RoverMotion(), PARAMETERS)
    for _ in range(6):
        place = np.array((rng.uniform(3, 6), rng.uniform(-3, 3)))
        found += pursuit("lateral intercept", planner, circling(rng, place, rng.uniform(-2, 2)), 8.0)
        found += pursuit("leader", planner, waving(rng, np.array((rng.uniform(2, 5), 0.5)), 0.0), 8.0)
    for _ in range(100):
        aside = rng.choice((-1, 1)) * rng.uniform(0.1, 0.8)
        goal = np.array((rng.uniform(-0.2, 0.3), aside, rng.uniform(-0.3, 0.3)))
        found.append(Planned("lateral correction, cold", CoupledRequest(t_start=0.0, step=STEP, goal=goal), None))
    return found


def driven_corrections() -> None:
    """Drive lateral corrections, planning at 10 Hz, and print how they end."""
    planner, rows = CoupledPlanner(RoverMotion(), PARAMETERS), []
    for aside in (-0.8, -0.6, -0.4, -0.2, -0.1, 0.1, 0.2, 0.4, 0.6, 0.8):
        end = np.array((STANDOFF, aside))
        *_, late = drive = list(pursuit("", planner, lambda _, end=end: (end, 0.0), 15.0))
        places = np.array([item.request.target[0] for item in drive])
        clear = float(np.hypot(*places.T).min())
        rows.append((float(np.hypot(*late.request.goal[0, :2])), abs(float(late.request.goal[0, 2])), clear))
    error, angle, clear = np.array(rows).T
    print(
        f"{len(rows)} lateral corrections of 0.1 to 0.8 m driven for 15 s: error {error.max():.3f} m and "
        f"{angle.max():.3f} rad at most; never nearer to the target than {clear.min():.2f} m (standoff {STANDOFF} m)"
    )


class RebuiltSolver:
    """PIQP with new matrices and a new solver for each program."""

    def __init__(self, program: QuadraticProgram, tolerance: float) -> None:
        self._program, self._tolerance = program, tolerance
        self._places = [(m.matrix.tocoo().row, m.matrix.tocoo().col) for m in (program.p, program.a, program.g)]

    def matrices(self) -> list:
        p = self._program
        return [
            coo_matrix((m.apply().data, places), shape=m.matrix.shape).tocsc()
            for m, places in zip((p.p, p.a, p.g), self._places, strict=True)
        ]

    def solve(self, guess: np.ndarray | None) -> QpSolution:  # noqa: ARG002
        p, (cost, equal, unequal) = self._program, self.matrices()
        solver = piqp.SparseSolver()
        s = solver.settings
        s.eps_abs = s.eps_rel = s.eps_duality_gap_abs = s.eps_duality_gap_rel = self._tolerance
        s.max_iter = 60
        solver.setup(cost, p.q, equal, p.b, unequal, p.g_low, p.g_high, p.low, p.high)
        status, info = solver.solve(), solver.result.info
        return QpSolution(
            z=np.array(solver.result.x),
            usable=status == piqp.PIQP_SOLVED,
            status=status.name,
            iterations=int(info.iter),
            residual_primal=float(info.primal_res),
            residual_dual=float(info.dual_res),
        )


class CvxpySolver(RebuiltSolver):
    """The same programs, in CVXPY's words, solved by PIQP beneath it."""

    def solve(self, guess: np.ndarray | None) -> QpSolution:  # noqa: ARG002
        import cvxpy as cp

        p, (cost, equal, unequal) = self._program, self.matrices()
        symmetric = cost + cost.T
        symmetric.setdiag(cost.diagonal())
        z = cp.Variable(len(p.q))
        low, box = np.isfinite(p.g_low), p.boxed
        bounds = [unequal @ z <= p.g_high, unequal[low] @ z >= p.g_low[low], z[box] >= p.low[box]]
        upper = box[np.isfinite(p.high[box])]
        problem = cp.Problem(
            cp.Minimize(0.5 * cp.quad_form(z, cp.psd_wrap(symmetric)) + p.q @ z),
            [equal @ z == p.b, *bounds, z[upper] <= p.high[upper]],
        )
        names = ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel")
        problem.solve(solver=cp.PIQP, **dict.fromkeys(names, self._tolerance))
        found = np.zeros(len(p.q)) if z.value is None else np.asarray(z.value)
        return QpSolution(
            z=found,
            usable=problem.status == "optimal",
            status=str(problem.status),
            iterations=int(problem.solver_stats.num_iters or 0),
            residual_primal=float(np.abs(equal @ found - p.b).max()),
            residual_dual=math.nan,  # CVXPY does not say
        )


def measured(planner: CoupledPlanner, chosen: list[Planned]) -> tuple[np.ndarray, list[CoupledPlan]]:
    """Give CPU and wall time [ms] of each plan (n, 2), and the plans."""
    times, plans = [], []
    for item in [*chosen[:3], *chosen]:
        cpu, wall = time.thread_time(), time.perf_counter()
        plans.append(planner.plan(item.request, last=item.last))
        times.append((1e3 * (time.thread_time() - cpu), 1e3 * (time.perf_counter() - wall)))
    return np.array(times[3:]), plans[3:]


def row(name: str, times: np.ndarray, plans: list[CoupledPlan], reference: list[CoupledPlan]) -> None:
    medians, late = np.median(times, axis=0), np.quantile(times, 0.99, axis=0)
    counts = [plan.iterations for plan in plans]
    worse = np.array([p.objective - r.objective for p, r in zip(plans, reference, strict=True)])
    scale = np.array([abs(r.objective) + 1.0 for r in reference])
    print(
        f"{name:34s}{len(plans):6d}{np.median(counts):5.0f}{max(counts):4d}"
        f"{medians[0]:9.2f}{late[0]:8.2f}{medians[1]:9.2f}{late[1]:8.2f}"
        f"{max(p.residual_primal for p in plans):10.1e}{np.max([p.residual_dual for p in plans]):10.1e}"
        f"{max(p.violation.worst for p in plans):10.1e}{np.mean(worse / scale):+10.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plans-of-the-slow", type=int, default=60, help="how many plans CVXPY makes")
    few = parser.parse_args().plans_of_the_slow
    every = problems()
    print(f"horizon {HORIZON}, {len(every)} plans; whole plan, all convex programs; times in ms")
    print(f"{'':40s}{'programs':>9s}{'CPU':>17s}{'wall':>17s}{'residual':>20s}{'nonlinear':>10s}{'cost':>10s}")
    titles = ("med", "max", "med", "p99", "med", "p99", "primal", "dual", "violation", "vs PIQP")
    widths = (5, 4, 9, 8, 9, 8, 10, 10, 10, 10)
    print(f"{'solver':34s}{'plans':>6s}" + "".join(f"{t:>{w}s}" for t, w in zip(titles, widths, strict=True)))
    rover = RoverMotion()
    times, plans = measured(CoupledPlanner(rover, PARAMETERS), every)
    row("PIQP, updated in place (default)", times, plans, plans)
    for case in dict.fromkeys(item.case for item in every):
        index = [k for k, item in enumerate(every) if item.case == case]
        row(f"  {case}", times[index], [plans[k] for k in index], [plans[k] for k in index])
    exact = replace(PARAMETERS, tolerance=1e-6, tolerance_cost=1e-7, trust_min=1e-4, iterations_max=150)
    row("PIQP, sequence run to its end", *measured(CoupledPlanner(rover, exact), every), plans)
    osqp_planner = CoupledPlanner(rover, replace(PARAMETERS, solver=QpBackend.OSQP))
    row("OSQP, updated in place", *measured(osqp_planner, every), plans)
    row("PIQP, rebuilt at each step", *measured(CoupledPlanner(rover, PARAMETERS, RebuiltSolver), every), plans)
    spread = np.linspace(0, len(every) - 1, min(few, len(every))).astype(int)
    try:
        import cvxpy
    except ImportError:
        print("CVXPY                             skipped: not installed (pip install cvxpy, for this comparison only)")
    else:
        chosen = [every[k] for k in spread]
        name = f"CVXPY {cvxpy.__version__} on PIQP"
        row(name, *measured(CoupledPlanner(rover, PARAMETERS, CvxpySolver), chosen), [plans[k] for k in spread])
    driven_corrections()
    median, late = np.median(times[:, 0]), np.quantile(times[:, 0], 0.99)
    held = "met" if median <= MEDIAN_REQUIRED and late <= P99_REQUIRED else "NOT met"
    print(
        f"required: median {MEDIAN_REQUIRED} ms, p99 {P99_REQUIRED} ms: {held}, in CPU time ({median:.2f}, {late:.2f})"
    )


if __name__ == "__main__":
    main()
