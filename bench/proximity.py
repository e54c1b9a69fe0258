"""What one prediction and one update of the proximity filter cost: table I of Parikh et al., both structures.

Floating-point operations are counted while the filter itself runs, on arrays and floats that count what is done with
them. Time is CPU time of the whole filter: history, gate and bookkeeping included.

Run: `python bench/proximity.py [--steps 5000] [--updates 0]`.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from typing import Any, Literal

import numpy as np
from proximity_world import DOCKING, SETUP, START_COVARIANCE, World, build, feed
from rich.console import Console
from rich.table import Table

from companion.estimation.proximity.covariance import Compounded, Covariance
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.fusion import Fusion
from companion.estimation.proximity.parameters import ProximityParameters
from companion.estimation.proximity.snapshot import Mover, Snapshot
from companion.estimation.proximity.steady_state import steady_state
from companion.geometry.rotations import quaternion_from_rotation
from companion.messages.proximity import GyroReading, ProximityState, RangeReading

Structure = Literal["tandem", "compounded"]
STRUCTURES: tuple[Structure, ...] = ("compounded", "tandem")
PAPER = {"compounded": (210_421, 644, 7.054), "tandem": (100_009, 128, 3.407)}
RATE = np.array([0.02, -0.05, 0.08])


class Count:
    operations = 0


class CountedArray(np.ndarray):
    """Counts one operation for each number that is added, multiplied, divided or negated."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, out: Any = None, **options: Any) -> Any:
        plain = [np.asarray(value) if isinstance(value, np.ndarray) else value for value in inputs]
        if out is not None:
            options["out"] = tuple(np.asarray(value) for value in out)
        result = getattr(ufunc, method)(*plain, **options)
        size = int(np.size(result))
        Count.operations += size * (2 * np.shape(plain[0])[-1] - 1) if ufunc is np.matmul else size
        return np.asarray(result).view(CountedArray) if np.ndim(result) else CountedFloat(result)


class CountedFloat(float):
    """Counts sums, differences, products and quotients with itself."""


def _counting(name: str) -> Any:
    plain = getattr(float, name)

    def operate(self: CountedFloat, *other: Any) -> Any:
        if other and isinstance(other[0], np.ndarray):
            return NotImplemented
        Count.operations += 1
        return CountedFloat(plain(float(self), *(float(value) for value in other)))

    return operate


for _name in ("add", "sub", "mul", "truediv"):
    setattr(CountedFloat, f"__{_name}__", _counting(f"__{_name}__"))
    setattr(CountedFloat, f"__r{_name}__", _counting(f"__r{_name}__"))
CountedFloat.__neg__ = _counting("__neg__")  # type: ignore[method-assign]


def counted(s: Snapshot) -> Snapshot:
    """The same snapshot, of numbers that count."""
    covariance: Covariance
    if isinstance(s.covariance, Compounded):
        covariance = Compounded(s.covariance.matrix.view(CountedArray))
    else:
        covariance = s.covariance._replace(
            translation=s.covariance.translation.view(CountedArray), rotation=s.covariance.rotation.view(CountedArray)
        )
    w, x, y, z = (CountedFloat(number) for number in s.quaternion)
    u, v, n = (CountedFloat(number) for number in s.rate)
    return s._replace(
        position=s.position.view(CountedArray),
        velocity=s.velocity.view(CountedArray),
        acceleration=s.acceleration.copy().view(CountedArray),
        quaternion=(w, x, y, z),
        rate=(u, v, n),
        covariance=covariance,
    )


def start() -> ProximityState:
    return ProximityState(
        t=0.0,
        position=np.array([0.5, 1.4, 0.4]),
        velocity=np.zeros(3),
        quaternion=quaternion_from_rotation(DOCKING),
        rate=RATE,
        covariance=START_COVARIANCE,
        mahalanobis=0.0,
        t_vision=-np.inf,
        t_range=-np.inf,
    )


def expected_range(s: Snapshot, anchor: int) -> float:
    w, x, y, z = s.quaternion
    imaginary = np.array([x, y, z])
    turned = SETUP.lever_arm + 2.0 * np.cross(imaginary, np.cross(imaginary, SETUP.lever_arm) + w * SETUP.lever_arm)
    return float(np.linalg.norm(s.position + turned - SETUP.anchors[anchor]))


def operations(structure: Structure) -> int:
    """Of a prediction over 10 ms with a thrust and a turn rate, with one gyro reading, and one range."""
    parameters = ProximityParameters(structure=structure)
    mover, fusion = Mover(SETUP, parameters), Fusion(SETUP, parameters)
    s = mover.command(mover.first(start(), SETUP, parameters), 0.0, np.array([0.01, 0.0, 0.005]))
    s, _ = fusion.range(s, 1, expected_range(s, 1) + 0.01)
    s = mover.gyro(s, 0.0, (0.02, -0.05, 0.08))
    measured = expected_range(s, 0)
    s = counted(s)
    rate = (CountedFloat(0.021), CountedFloat(-0.05), CountedFloat(0.079))
    Count.operations = 0
    s = mover.moved(mover.gyro(s, 0.01, rate), 0.01)
    s, verdicts = fusion.range(s, 0, measured)
    if not verdicts[0].accepted:
        raise SystemExit(f"the range should have been fused: {verdicts}")
    return Count.operations


def kept(s: Snapshot) -> int:
    """Bytes of the arrays of one snapshot."""
    covariance = s.covariance
    arrays = [s.position, s.velocity, s.acceleration]
    arrays += [part for part in covariance if isinstance(part, np.ndarray)]
    return sum(array.nbytes for array in arrays)


def cost(structure: Structure, steps: int) -> tuple[float, float, float, float, float, int]:
    """Time [us] of a gyro reading with a range (median, p99) and of a picture, memory of a step [kB], state [bytes]."""
    estimator = ProximityFilter(SETUP, ProximityParameters(structure=structure), start())
    mover = Mover(SETUP, ProximityParameters(structure=structure))
    rng = np.random.default_rng(1)
    spent = []
    for k in range(1, steps + 1):
        t = 0.01 * k
        gyro = GyroReading(t=t, rate=6e-4 * rng.standard_normal(3))
        place = start().position + DOCKING @ SETUP.lever_arm - SETUP.anchors[k % 4]
        ranging = RangeReading(t=t, anchor=k % 4, range=float(np.linalg.norm(place)) + 0.02 * rng.standard_normal())
        if k == steps:
            tracemalloc.start()
        begin = time.thread_time()
        estimator.gyro(gyro)
        estimator.range(ranging)
        spent.append(time.thread_time() - begin)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    median, late = 1e6 * np.quantile(spent[:-1], [0.5, 0.99])
    size = kept(mover.first(start(), SETUP, ProximityParameters(structure=structure)))
    return float(median), float(late), *whole_run(structure), peak / 1024, size


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
    s = mover.first(start(), SETUP, parameters)
    least = np.inf
    for _ in range(updates):
        s = mover.moved(s, s.t + 1e-3)
        anchor = int(rng.integers(4))
        s, _ = fusion.range(s, anchor, expected_range(s, anchor))
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
        counts[structure] = operations(structure)
        median, late, plain, seeing, memory, size = cost(structure, arguments.steps)
        flop, kilobytes, milliseconds = PAPER[structure]
        cells = (f"{counts[structure]}", f"{size}", f"{memory:.1f}", f"{median:.0f}", f"{late:.0f}", f"{plain:.1f}")
        table.add_row(structure, *cells, f"{seeing:.1f}", f"{flop}", f"{kilobytes}", f"{milliseconds}")
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
