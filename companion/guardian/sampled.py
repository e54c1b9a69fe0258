"""A trajectory given by samples."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array, frozen
from companion.messages.motion import MotionState

COLUMNS = 12  # t, position, velocity, acceleration, yaw, yaw rate
_Row = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledTrajectory:
    """States at instants; implements `companion.messages.motion.Trajectory`.

    Between two samples the position is the cubic through both positions and velocities, the velocity the cubic through
    both velocities and accelerations; the rest is linear. Outside, the end states move on at their velocity.

    Raises:
        ValueError: fewer than one sample, or their times do not increase.
    """

    samples: Array  # (N, 12): t [s], position [m], velocity [m/s], acceleration [m/s^2], all ned, yaw [rad], rate
    t_expiry: float  # [s]
    reset_counter: int
    t_start: float = field(init=False)  # [s] of the first sample
    t_end: float = field(init=False)  # [s] of the last
    _times: tuple[float, ...] = field(init=False, repr=False)
    _rows: tuple[_Row, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        samples = frozen(self.samples, (len(self.samples), COLUMNS))
        rows = tuple(tuple(row) for row in samples.tolist())
        times = tuple(row[0] for row in rows)
        if not times or any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError("the times of the samples must increase, and there must be one at least")
        for name, value in (("samples", samples), ("_rows", rows), ("_times", times)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "t_start", times[0])
        object.__setattr__(self, "t_end", times[-1])

    def at(self, t: float) -> MotionState:
        """Give the reference at `t` [s]."""
        after = bisect_right(self._times, t)
        if after == 0 or after == len(self._rows):
            return _beyond(self._rows[max(after - 1, 0)], t)
        return _between(self._rows[after - 1], self._rows[after], t)


def _beyond(row: _Row, t: float) -> MotionState:
    elapsed = t - row[0]
    resting = elapsed == 0.0
    return MotionState(
        position_ned=[row[k] + elapsed * row[k + 3] for k in (1, 2, 3)],  # type: ignore[arg-type]  # copied
        velocity_ned=row[4:7],  # type: ignore[arg-type]
        acceleration_ned=row[7:10] if resting else (0.0, 0.0, 0.0),  # type: ignore[arg-type]
        yaw=row[10] + elapsed * row[11],
        yaw_rate=row[11],
    )


def _between(first: _Row, second: _Row, t: float) -> MotionState:
    span = second[0] - first[0]
    u = (t - first[0]) / span
    return MotionState(
        position_ned=[_cubic(first, second, k, u, span) for k in (1, 2, 3)],  # type: ignore[arg-type]  # copied
        velocity_ned=[_cubic(first, second, k, u, span) for k in (4, 5, 6)],  # type: ignore[arg-type]
        acceleration_ned=[(1.0 - u) * first[k] + u * second[k] for k in (7, 8, 9)],  # type: ignore[arg-type]
        yaw=first[10] + u * wrap_angle(second[10] - first[10]),
        yaw_rate=(1.0 - u) * first[11] + u * second[11],
    )


def _cubic(first: _Row, second: _Row, k: int, u: float, span: float) -> float:
    """Hermite's cubic: value in column k, its rate three columns on."""
    u2, u3 = u * u, u * u * u
    return (
        (2.0 * u3 - 3.0 * u2 + 1.0) * first[k]
        + (u3 - 2.0 * u2 + u) * span * first[k + 3]
        + (3.0 * u2 - 2.0 * u3) * second[k]
        + (u3 - u2) * span * second[k + 3]
    )
