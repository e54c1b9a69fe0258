"""Control of a CubeSat by on/off nozzles: accuracy and propellant of four tasks, and the time of a step.

Each task is flown with exact estimates and with noisy ones, by a spacecraft that is not the controller's model
(`rigid_body_truth.py`). Impulse is thrust times on-time, summed over the nozzles.

Run: python bench/rigid_body.py [--seeds N] [--repeats N]
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table
from rigid_body_truth import PERFECT, Imperfection, Spacecraft, about, product
from scipy.optimize import linprog

from companion.control.rigid_body.allocation import NozzleAllocator
from companion.control.rigid_body.controller import RigidBodyController
from companion.control.rigid_body.nozzles import effectiveness
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.messages.proximity import PoseGoal

ACCELERATION = 0.008  # [m/s^2] along a line
AXIS = np.array([1.0, 2.0, -1.0]) / math.sqrt(6.0)  # of the large turn
START = about(np.array([0.3, -0.2, 0.9]), 0.7)  # c_from_d at first
NOISE = {"position": 0.003, "velocity": 0.0015}  # [m], [m/s]

Goal = Callable[[float], PoseGoal]


def along_a_line(t: float, length: float, speed: float) -> tuple[float, float, float]:
    """Give way [m], speed [m/s] and acceleration [m/s^2] from rest to rest; a length of 0 is rest."""
    if length == 0.0:
        return 0.0, 0.0, 0.0
    ramp = speed / ACCELERATION
    end = length / speed + ramp
    if t <= 0.0 or t >= end:
        return (0.0 if t <= 0.0 else length), 0.0, 0.0
    if t < ramp:
        return 0.5 * ACCELERATION * t * t, ACCELERATION * t, ACCELERATION
    if t > end - ramp:
        left = end - t
        return length - 0.5 * ACCELERATION * left * left, ACCELERATION * left, -ACCELERATION
    return speed * (t - 0.5 * ramp), speed, 0.0


def goal_along(length: float, speed: float, *, turn: float = 0.0) -> Goal:
    """Go along (0.6, 0.8, 0) from the origin; the attitude jumps by `turn` [rad] after 5 s."""

    def goal(t: float) -> PoseGoal:
        way, pace, push = along_a_line(t, length, speed)
        direction = np.array([0.6, 0.8, 0.0])
        return PoseGoal(
            position=way * direction,
            velocity=pace * direction,
            acceleration=push * direction,
            quaternion=product(START, about(AXIS, turn)) if t > 5.0 else START,
            rate=np.zeros(3),
        )

    return goal


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is flown, and from when on its errors count."""

    name: str
    goal: Goal
    seconds: float
    settled: float  # [s]


TASKS = (
    Task(name="hold", goal=goal_along(0.0, 0.02), seconds=120.0, settled=20.0),
    Task(name="1 m at 20 mm/s", goal=goal_along(1.0, 0.02), seconds=75.0, settled=60.0),
    Task(name="1 m, turn by 120 deg", goal=goal_along(1.0, 0.02, turn=math.radians(120.0)), seconds=75.0, settled=60.0),
    Task(name="dock, 0.3 m at 10 mm/s", goal=goal_along(0.3, 0.01), seconds=31.25, settled=5.0),
)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """What a flight has shown."""

    position: np.ndarray  # (N,) [m] error once settled
    lateral: np.ndarray  # (N,) [m] across the way
    attitude: np.ndarray  # (N,) [rad]
    rate: float  # [rad/s] largest of all
    impulse: float  # [N s]
    openings: int


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    return 2.0 * math.acos(min(1.0, abs(float(a @ b))))


def fly(
    task: Task, seed: int, imperfection: Imperfection, *, noisy: bool, parameters: RigidBodyParameters | None = None
) -> Flight:
    """Fly a task from its first goal."""
    p = parameters or RigidBodyParameters()
    rng = np.random.default_rng(seed)
    craft = Spacecraft(p, imperfection, rng, position=np.zeros(3), quaternion=START)
    controller = RigidBodyController(p)
    across = np.eye(3) - np.outer([0.6, 0.8, 0.0], [0.6, 0.8, 0.0])
    position, lateral, attitude, fastest = [], [], [], 0.0
    for k in range(round(task.seconds / p.period)):
        t = k * p.period
        goal = task.goal(t)
        if t >= task.settled:
            error = goal.position - craft.position
            position.append(float(np.linalg.norm(error)))
            lateral.append(float(np.linalg.norm(across @ error)))
            attitude.append(angle_between(goal.quaternion, craft.quaternion))
        state = craft.noisy_state(rng, **NOISE) if noisy else craft.state()
        craft.advance(controller.step(t, state, goal))
        fastest = max(fastest, float(np.linalg.norm(craft.rate)))
    return Flight(
        position=np.array(position),
        lateral=np.array(lateral),
        attitude=np.array(attitude),
        rate=fastest,
        impulse=craft.impulse,
        openings=craft.openings,
    )


def show_tasks(console: Console, seeds: int) -> None:
    table = Table(title=f"worst of seeds 1 to {seeds}; impulse and openings: mean")
    for column in ("task", "spacecraft", "estimate", "position mm", "lateral mm", "attitude deg", "rate rad/s"):
        table.add_column(column, justify="left" if column in ("task", "spacecraft", "estimate") else "right")
    for column in ("impulse mN s", "openings/s"):
        table.add_column(column, justify="right")
    for task in TASKS:
        for craft, imperfection, noisy in (
            ("as modelled", PERFECT, False),
            ("imperfect", Imperfection(), False),
            ("imperfect", Imperfection(), True),
        ):
            flights = [fly(task, seed, imperfection, noisy=noisy) for seed in range(1, seeds + 1)]
            table.add_row(
                task.name,
                craft,
                "3 mm, 1.5 mm/s" if noisy else "exact",
                f"{1e3 * max(f.position.max() for f in flights):.2f}",
                f"{1e3 * max(f.lateral.max() for f in flights):.2f}",
                f"{math.degrees(max(f.attitude.max() for f in flights)):.3f}",
                f"{max(f.rate for f in flights):.3f}",
                f"{1e3 * statistics.mean(f.impulse for f in flights):.1f}",
                f"{statistics.mean(f.openings for f in flights) / task.seconds:.2f}",
            )
    console.print(table)


def median_us(call: Callable[[int], object], repeats: int) -> float:
    """Give the median time of a call [us]."""
    spent = []
    for k in range(repeats):
        begin = time.perf_counter_ns()
        call(k)
        spent.append(time.perf_counter_ns() - begin)
    return 1e-3 * statistics.median(spent)


def steps_of_a_flight(p: RigidBodyParameters, count: int) -> list[float]:
    """Give the times [us] of the controller's steps while it flies a metre by noisy estimates."""
    rng = np.random.default_rng(1)
    craft = Spacecraft(p, Imperfection(), rng, position=np.zeros(3), quaternion=START)
    controller = RigidBodyController(p)
    spent = []
    for k in range(count):
        t = k * p.period
        state, goal = craft.noisy_state(rng, **NOISE), TASKS[1].goal(t)
        begin = time.perf_counter_ns()
        pulses = controller.step(t, state, goal)
        spent.append(1e-3 * (time.perf_counter_ns() - begin))
        craft.advance(pulses)
    return spent


def show_times(console: Console, repeats: int) -> None:
    p = RigidBodyParameters()
    effect = effectiveness(p.nozzle_places, p.nozzle_directions, p.thrust)
    rng = np.random.default_rng(1)
    wrenches = effect @ rng.uniform(0.0, 0.5 * p.period, (10, repeats))
    begin = time.perf_counter_ns()
    allocator = NozzleAllocator(effect, p.period)
    built = 1e-6 * (time.perf_counter_ns() - begin)
    table_us = median_us(lambda k: allocator.allocate(wrenches[:, k]), repeats)
    scale = 1.0 / effect.max()
    bounds = (0.0, p.period)
    linprog_us = median_us(
        lambda k: linprog(np.ones(10), A_eq=scale * effect, b_eq=scale * wrenches[:, k], bounds=bounds), repeats // 10
    )
    steps = steps_of_a_flight(p, repeats)
    table = Table(title=f"{repeats} calls; table of the allocation built in {built:.0f} ms")
    for column in ("what", "us", "beside linprog"):
        table.add_column(column, justify="left" if column == "what" else "right")
    for name, us in (
        ("allocation, scipy linprog, median", linprog_us),
        ("allocation, table, median", table_us),
        ("whole step, median", statistics.median(steps)),
        ("whole step, mean", statistics.mean(steps)),
        ("whole step, 99 of 100", sorted(steps)[int(0.99 * repeats)]),
    ):
        table.add_row(name, f"{us:.0f}", f"1 / {linprog_us / us:.0f}" if us < linprog_us else "1")
    console.print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=1000, help="timed calls")
    options = parser.parse_args()
    console = Console(width=140)
    show_tasks(console, options.seeds)
    show_times(console, options.repeats)


if __name__ == "__main__":
    main()
