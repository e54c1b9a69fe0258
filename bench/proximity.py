"""What one prediction and one update of the proximity filter cost: table I of Parikh et al., both structures.

The figures of table I come from `companion.papers.estimator_cost`, as in `companion papers parikh --table 1`; besides,
time for whole stretches of flight, and the steady state.

Run: `python bench/proximity.py [--steps 5000] [--updates 0]`.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from proximity_world import DOCKING, SETUP, World, build, feed
from rich.console import Console
from rich.table import Table

from companion.estimation.proximity.covariance import Compounded
from companion.estimation.proximity.fusion import Fusion
from companion.estimation.proximity.parameters import ProximityParameters
from companion.estimation.proximity.snapshot import Mover
from companion.estimation.proximity.steady_state import steady_state
from companion.geometry.rotations import quaternion_from_rotation
from companion.papers.estimator_cost import STRUCTURES, Structure, expected_range, measure, standing_state

PAPER = {"compounded": (210_421, 644, 7.054), "tandem": (100_009, 128, 3.407)}


def whole_run(structure: Structure) -> tuple[float, float]:
    """Milliseconds for each second of flight, ranges alone and with pictures; late readings are done again."""
    parameters = ProximityParameters(structure=structure)
    figures = []
    for first in (np.inf, 0.0):
        run = build(1, World(duration=10.0, moving=False, vision_from=first), parameters)
        begin = time.thread_time()
        feed(run, parameters, 0.1)
        figures.append(100.0 * (time.thread_time() - begin))
    return figures[0], figures[1]


def least_eigenvalue(structure: Structure, updates: int) -> float:
    """Smallest eigenvalue of the covariance [in units of the largest] ever met in many very accurate updates."""
    parameters = ProximityParameters(structure=structure, acceleration_noise=1e-7, gyro_noise=1e-8, range_std=1e-5)
    mover, fusion = Mover(SETUP, parameters), Fusion(SETUP, parameters)
    rng = np.random.default_rng(2)
    s = mover.first(standing_state(SETUP), SETUP, parameters)
    least = np.inf
    for _ in range(updates):
        s = mover.moved(s, s.t + 1e-3)
        anchor = int(rng.integers(4))
        s, _ = fusion.range(s, anchor, expected_range(SETUP, s, anchor))
        matrix = s.covariance.matrix if isinstance(s.covariance, Compounded) else s.covariance.translation
        values = np.linalg.eigvalsh(matrix)
        least = min(least, float(values[0] / values[-1]))
    return least


def standing() -> Table:
    """Steady state at standing poses: largest standard deviation of position [mm], velocity [mm/s], attitude [mrad]."""
    table = Table("place [m]", "sensors", "position [mm]", "velocity [mm/s]", "attitude [mrad]", title="Steady state")
    quaternion = quaternion_from_rotation(DOCKING)
    for place in ([0.0, 1.0, 0.0], [0.5, 1.4, 0.5], [1.0, 1.5, 1.0], [1.0, 1.88, 1.0]):
        for sensors, seeing, both in (("ranges", False, False), ("pictures", True, False), ("both", True, True)):
            parameters = ProximityParameters(ranges_with_vision=both)
            matrix = steady_state(SETUP, parameters, np.array(place), quaternion, with_vision=seeing)
            stds = 1e3 * np.sqrt(np.diag(matrix)).reshape(3, 3).max(axis=1)
            table.add_row(str(place), sensors, *(f"{std:.2f}" for std in stds))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--updates", type=int, default=0, help="so many random updates: is the covariance positive?")
    arguments = parser.parse_args()
    table = Table(title="One prediction and update: one gyro reading, one range (table I)")
    for heading in ("structure", "FLOP", "state [B]", "memory [kB]", "median [us]", "p99 [us]"):
        table.add_column(heading, justify="right")
    for heading in ("1 s of flight, ranges [ms]", "with pictures [ms]", "paper: FLOP", "kB", "ms"):
        table.add_column(heading, justify="right")
    counts = {}
    for structure in STRUCTURES:
        cost = measure(SETUP, structure, arguments.steps)
        counts[structure] = cost.operations
        plain, seeing = whole_run(structure)
        flop, kilobytes, milliseconds = PAPER[structure]
        cells = (f"{cost.operations}", f"{cost.state_bytes}", f"{cost.memory_kb:.1f}", f"{cost.median_us:.0f}")
        cells = (*cells, f"{cost.late_us:.0f}", f"{plain:.1f}", f"{seeing:.1f}")
        table.add_row(structure, *cells, f"{flop}", f"{kilobytes}", f"{milliseconds}")
    console = Console(width=140)
    console.print(table)
    ratio = counts["tandem"] / counts["compounded"]
    console.print(f"FLOP, tandem / compounded: {ratio:.3f} (at most 0.5 is wanted; the paper's are 0.475)")
    console.print(standing())
    if arguments.updates:
        for structure in STRUCTURES:
            least = least_eigenvalue(structure, arguments.updates)
            console.print(f"{structure}, {arguments.updates} updates: least eigenvalue {least:.1e} of the largest")


if __name__ == "__main__":
    main()
