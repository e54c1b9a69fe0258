"""What one prediction and one update of the proximity filter cost on this computer, and in operations.

Floating-point operations are counted while the filter itself runs, on arrays and floats that count what is done with
them. Time is CPU time of the whole filter: history, gate and bookkeeping included.
"""

from __future__ import annotations

import math
import time
import tracemalloc
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from companion.estimation.proximity.covariance import Compounded, Covariance
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.fusion import Fusion
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.snapshot import Mover, Snapshot
from companion.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion
from companion.messages.proximity import GyroReading, ProximityState, RangeReading

Structure = Literal["tandem", "compounded"]
STRUCTURES: tuple[Structure, ...] = ("compounded", "tandem")
STEPS = 2000
_PERIOD = 0.01  # [s] of the gyro
_RATE = (0.02, -0.05, 0.08)  # [rad/s] that it reads while operations are counted
_GYRO_STD = 6e-4  # [rad/s] of its readings
_RANGE_STD = 0.02  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorCost:
    """Of one gyro reading and one range: a prediction over 10 ms and an update."""

    operations: int  # floating-point
    state_bytes: int  # of the arrays that are the filter's state at one instant
    memory_kb: float  # largest that a step takes besides
    median_us: float  # CPU time
    late_us: float  # which one step of a hundred exceeds


def measure(setup: ProximitySetup, structure: Structure, steps: int = STEPS) -> EstimatorCost:
    """Measure a filter that stands in front of the target.

    Args:
        setup: anchors, target and chaser.
        structure: of the filter.
        steps: over which time is taken, two or more.
    """
    start = standing_state(setup)
    parameters = ProximityParameters(structure=structure)
    spent, memory = _timed(setup, parameters, start, steps)
    median, late = 1e6 * np.quantile(spent, [0.5, 0.99])
    return EstimatorCost(
        operations=count_operations(setup, structure),
        state_bytes=_state_bytes(Mover(setup, parameters).first(start, setup, parameters)),
        memory_kb=memory / 1024.0,
        median_us=float(median),
        late_us=float(late),
    )


def standing_state(setup: ProximitySetup) -> ProximityState:
    """Give an estimate on the way to the target, turned to it and turning, as uncertain as at a usual start."""
    stds = np.repeat([0.05, 0.002, math.radians(1.0)], 3)
    return ProximityState(
        t=0.0,
        position=np.array([0.5, 1.4, 0.4]),
        velocity=np.zeros(3),
        quaternion=quaternion_from_rotation(setup.c_from_t.rotation),
        rate=np.array(_RATE),
        covariance=np.diag(stds**2),
        mahalanobis=0.0,
        t_vision=-np.inf,
        t_range=-np.inf,
    )


def expected_range(setup: ProximitySetup, s: Snapshot, anchor: int) -> float:
    """Give the range [m] to an anchor that fits exactly to the filter's state."""
    turned = rotation_from_quaternion(np.array([float(part) for part in s.quaternion])) @ setup.lever_arm
    return float(np.linalg.norm(np.asarray(s.position) + turned - setup.anchors[anchor]))


def count_operations(setup: ProximitySetup, structure: Structure) -> int:
    """Count a prediction over 10 ms with a thrust and a turn rate, one gyro reading, and one range.

    Raises:
        ValueError: the filter rejects the range, so there was no update to count.
    """
    parameters = ProximityParameters(structure=structure)
    mover, fusion = Mover(setup, parameters), Fusion(setup, parameters)
    s = mover.first(standing_state(setup), setup, parameters)
    s = mover.command(s, 0.0, np.array([0.01, 0.0, 0.005]))
    s, _ = fusion.range(s, 1, expected_range(setup, s, 1) + 0.01)
    s = mover.gyro(s, 0.0, _RATE)
    measured = expected_range(setup, s, 0)
    s = _counting(s)
    rate = (CountedFloat(0.021), CountedFloat(-0.05), CountedFloat(0.079))
    _Count.operations = 0
    s = mover.moved(mover.gyro(s, _PERIOD, rate), _PERIOD)
    _, verdicts = fusion.range(s, 0, measured)
    if not verdicts[0].accepted:
        raise ValueError(f"the range should have been fused: {verdicts}")
    return _Count.operations


def _timed(
    setup: ProximitySetup, parameters: ProximityParameters, start: ProximityState, steps: int
) -> tuple[list[float], int]:
    """Give the CPU time [s] of each step but the last, and the memory [bytes] that the last one takes."""
    estimator = ProximityFilter(setup, parameters, start)
    rotation = rotation_from_quaternion(start.quaternion)
    rng = np.random.default_rng(1)
    spent = []
    for k in range(1, steps + 1):
        t, anchor = _PERIOD * k, k % len(setup.anchors)
        gyro = GyroReading(t=t, rate=_GYRO_STD * rng.standard_normal(3))
        away = start.position + rotation @ setup.lever_arm - setup.anchors[anchor]
        measured = float(np.linalg.norm(away)) + _RANGE_STD * float(rng.standard_normal())
        if k == steps:
            tracemalloc.start()
        begin = time.thread_time()
        estimator.gyro(gyro)
        estimator.range(RangeReading(t=t, anchor=anchor, range=measured))
        spent.append(time.thread_time() - begin)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return spent[:-1], peak


def _state_bytes(s: Snapshot) -> int:
    arrays = [s.position, s.velocity, s.acceleration]
    arrays += [part for part in s.covariance if isinstance(part, np.ndarray)]
    return sum(array.nbytes for array in arrays)


class _Count:
    """Operations so far: numbers that count cannot carry a counter along."""

    operations = 0


class CountedArray(np.ndarray[Any, Any]):
    """Counts one operation for each number that is added, multiplied, divided or negated."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, out: Any = None, **options: Any) -> Any:
        """Do it on plain arrays, and count."""
        plain = [np.asarray(value) if isinstance(value, np.ndarray) else value for value in inputs]
        if out is not None:
            options["out"] = tuple(np.asarray(value) for value in out)
        result = getattr(ufunc, method)(*plain, **options)
        size = int(np.size(result))
        _Count.operations += size * (2 * np.shape(plain[0])[-1] - 1) if ufunc is np.matmul else size
        return np.asarray(result).view(CountedArray) if np.ndim(result) else CountedFloat(result)


class CountedFloat(float):
    """Counts sums, differences, products and quotients with itself."""


def _counted_operator(name: str) -> Any:
    plain = getattr(float, name)

    def operate(self: CountedFloat, *other: Any) -> Any:
        if other and isinstance(other[0], np.ndarray):
            return NotImplemented
        _Count.operations += 1
        return CountedFloat(plain(float(self), *(float(value) for value in other)))

    return operate


for _name in ("add", "sub", "mul", "truediv"):
    setattr(CountedFloat, f"__{_name}__", _counted_operator(f"__{_name}__"))
    setattr(CountedFloat, f"__r{_name}__", _counted_operator(f"__r{_name}__"))
CountedFloat.__neg__ = _counted_operator("__neg__")  # type: ignore[method-assign]


def _counting(s: Snapshot) -> Snapshot:
    """Give the same snapshot, of numbers that count."""
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
