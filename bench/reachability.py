"""How well each reach foresees when a rover meets its place behind a target that drives.

Run: python bench/reachability.py [--cases 200] [--seed 1]

The same starts and motions for each, drawn from a seed. What is really needed is asked of the coupled planner: the
earliest instant (on a grid) at which one of its plans stands on the place at its heading, whatever its speed then. It
keeps accelerations of speed and turn, too, and begins from its own simple drives and from the shortest path. It is no
proof: a better plan may exist.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from companion.planning.coupled.model import CameraView, CostWeights, CoupledRequest
from companion.planning.coupled.plan import CoupledParameters, CoupledPlan
from companion.planning.coupled.scp import CoupledPlanner
from companion.planning.shortest.meeting import MeetingParameters, earliest_meeting, make_reach
from companion.planning.shortest.path import Pose
from companion.planning.shortest.reeds_shepp import reeds_shepp_path
from companion.vehicles.rover import Rover, RoverParameters

# the simulated rover at the speed of missions/rover_lateral.yaml
ROVER = Rover(parameters=RoverParameters(speed_forward=0.8, acceleration=2.0))
CAR = ROVER.car(gear_time=MeetingParameters().gear_s)
REACHES = ("circle", "paper", "dubins", "reeds_shepp")
HORIZON = 20.0  # [s]
GRID = 0.25  # [s]
THERE, TURNED = 0.1, 0.1  # [m], [rad] from the place: there
SLACK = 0.5  # [s] by which a claim may be early
PLANNER = CoupledParameters(
    horizon=40,
    iterations_max=15,
    correction_reach=0.0,
    weights=CostWeights(
        speed=1e-3,
        yaw_rate=1e-3,
        stage_position=0.0,
        stage_heading=0.0,
        final_position=400.0,
        final_heading=200.0,
        reverse=0.0,
        view=0.0,
    ),
    view=CameraView(),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A rover at (0, 0, 0) and a place that moves along its heading."""

    speed_start: float  # [m/s] of the rover
    place: Pose  # now
    speed: float  # [m/s] of the place
    turn: float  # [rad/s]

    def at(self, t: float) -> Pose:
        x, y, heading = self.place
        course = heading + 0.5 * self.turn * t
        way = self.speed * t * float(np.sinc(0.5 * self.turn * t / math.pi))
        return x + way * math.cos(course), y + way * math.sin(course), heading + self.turn * t


def draw(rng: np.random.Generator) -> Case:
    distance, bearing = rng.uniform(1.3, 6.0), rng.uniform(-math.pi, math.pi)
    return Case(
        speed_start=float(rng.choice((0.0, rng.uniform(0.0, 0.8)))),
        place=(float(distance * math.cos(bearing)), float(distance * math.sin(bearing)), float(rng.uniform(-3.1, 3.1))),
        speed=float(rng.uniform(0.1, 0.4)),
        turn=float(rng.choice((0.0, rng.uniform(-0.15, 0.15)))),
    )


def seed_plan(plan: CoupledPlan, case: Case, goal: Pose, step: float) -> CoupledPlan:
    """Give a plan that drives the shortest path at full speed, and then waits."""
    path = reeds_shepp_path(CAR, goal, speed=case.speed_start, speed_end=case.speed)
    controls = np.zeros_like(plan.controls)
    instants, at = (np.arange(len(controls)) + 0.5) * step, 0.0
    for segment in path.segments:
        most = CAR.speed(segment.turn, segment.length)
        ends = at + abs(segment.length) / most
        inside = (instants >= at) & (instants < ends)
        controls[inside] = (
            math.copysign(most, segment.length),
            segment.turn * math.copysign(most, segment.length) / CAR.turning_radius,
        )
        at = ends
    return replace(plan, t_start=0.0, step=step, controls=controls)


def needed_really(case: Case, planner: CoupledPlanner) -> float:
    """Find the earliest instant [s] of the grid at which a plan is at the place; infinite where there is none."""
    for index in range(1, int(HORIZON / GRID) + 1):
        t = index * GRID
        goal = case.at(t)
        if math.hypot(goal[0], goal[1]) > CAR.speed_forward * t + THERE:
            continue
        step = t / PLANNER.horizon
        request = CoupledRequest(t_start=0.0, step=step, goal=np.array(goal), speed=case.speed_start)
        plan = planner.plan(request, last=None)
        if arrives(plan, goal) or arrives(planner.plan(request, last=seed_plan(plan, case, goal, step)), goal):
            return t
    return math.inf


def arrives(plan: CoupledPlan, goal: Pose) -> bool:
    x, y, heading = plan.poses[-1].tolist()
    turned = abs((heading - goal[2] + math.pi) % (2.0 * math.pi) - math.pi)
    return math.hypot(x - goal[0], y - goal[1]) < THERE and turned < TURNED and plan.violation.worst < 1e-6


def timed(call: Callable[[], object], times: list[float]) -> object:
    begin = time.thread_time()
    result = call()
    times.append(1e6 * (time.thread_time() - begin))
    return result


def judge(name: str, cases: list[Case], truth: list[float]) -> str:
    """Give a row of the table."""
    reach = make_reach(name, CAR)
    errors, claims, false, late, calls, searches = [], 0, 0, 0, [], []
    for case, real in zip(cases, truth, strict=True):

        def needed(t: float, case: Case = case) -> float:
            return reach.time_to(case.at(t), speed=case.speed_start, speed_end=case.speed)

        timed(lambda: needed(0.0), calls)
        meeting = timed(lambda: earliest_meeting(needed, HORIZON), searches)
        if meeting.feasible:
            claims += 1
            false += real > meeting.elapsed + SLACK
        late += meeting.elapsed > real + SLACK
        if math.isfinite(real):
            errors.append(meeting.elapsed - real)
    size = np.abs(errors)
    row = (
        name,
        f"{claims}",
        f"{100.0 * false / claims:.0f} %",
        f"{100.0 * late / len(cases):.0f} %",
        f"{np.mean(errors):+.2f} s",
        f"{np.median(size):.2f} s",
        f"{np.percentile(size, 90):.2f} s",
        f"{statistics.median(calls):.0f} us",
        f"{statistics.median(searches) / 1e3:.2f} ms",
        f"{np.percentile(searches, 99) / 1e3:.2f} ms",
    )
    return "| " + " | ".join(row) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    cases = [draw(rng) for _ in range(options.cases)]
    planner = CoupledPlanner(ROVER.motion, PLANNER)
    truth = [needed_really(case, planner) for case in cases]
    met = [real for real in truth if math.isfinite(real)]
    after = f"after {np.mean(met):.1f} s on average"
    print(f"{len(cases)} cases, {len(met)} met by the planner within {HORIZON:.0f} s, {after}\n")
    heads = ("reach", "met, it says", f"too early by {SLACK} s", f"too late by {SLACK} s", "mean error")
    heads += ("median size", "90th percentile", "a call", "a search", "its p99")
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for name in REACHES:
        print(judge(name, cases, truth), flush=True)


if __name__ == "__main__":
    main()
