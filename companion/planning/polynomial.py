"""A trajectory of polynomial pieces."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

from companion.geometry.arrays import Array, frozen
from companion.messages.motion import MotionState

_Piece = tuple[float, float, tuple[tuple[float, ...], ...], tuple[float, ...]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolynomialTrajectory:
    """Position of degree 7 and yaw of degree 3, piece after piece; implements `companion.messages.motion.Trajectory`.

    Each piece is kept over normalised time s = (t - piece start) / duration in [0, 1]. Before `t_start` and after
    `t_end` the end states move on at their velocity and yaw rate, with no acceleration.
    """

    t_start: float  # [s]
    durations: tuple[float, ...]  # (K,) [s] of each piece, positive
    position: Array  # (K, 8, 3) [m] coefficients over s, lowest power first; ned
    yaw: Array  # (K, 4) [rad] coefficients over s; not wrapped
    t_expiry: float  # [s]
    reset_counter: int
    t_end: float = field(init=False)  # [s]
    _starts: tuple[float, ...] = field(init=False, repr=False)
    _pieces: tuple[_Piece, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = len(self.durations)
        if count == 0 or min(self.durations) <= 0.0:
            raise ValueError(f"durations must be positive and at least one, got {self.durations}")
        object.__setattr__(self, "position", frozen(self.position, (count, 8, 3)))
        object.__setattr__(self, "yaw", frozen(self.yaw, (count, 4)))
        pieces: list[_Piece] = []
        elapsed = 0.0
        for k, duration in enumerate(self.durations):
            axes = tuple(tuple(column) for column in self.position[k].T.tolist())
            pieces.append((elapsed, duration, axes, tuple(self.yaw[k].tolist())))
            elapsed += duration
        object.__setattr__(self, "_starts", tuple(piece[0] for piece in pieces))
        object.__setattr__(self, "_pieces", tuple(pieces))
        object.__setattr__(self, "t_end", self.t_start + elapsed)

    def at(self, t: float) -> MotionState:
        """Give the reference at `t` [s]."""
        elapsed = t - self.t_start
        index = bisect_right(self._starts, elapsed) - 1 if len(self._pieces) > 1 else 0
        start, duration, axes, yaw = self._pieces[max(index, 0)]
        local = elapsed - start
        beyond = local if local < 0.0 else max(local - duration, 0.0)
        s = 0.0 if local < 0.0 else min(local / duration, 1.0)
        rate = 1.0 / duration
        px, vx, ax = _septic(axes[0], s, rate)
        py, vy, ay = _septic(axes[1], s, rate)
        pz, vz, az = _septic(axes[2], s, rate)
        c0, c1, c2, c3 = yaw
        heading = c0 + s * (c1 + s * (c2 + s * c3))
        turn = rate * (c1 + s * (2.0 * c2 + s * 3.0 * c3))
        if beyond != 0.0:
            px, py, pz, heading = px + beyond * vx, py + beyond * vy, pz + beyond * vz, heading + beyond * turn
            ax = ay = az = 0.0
        return MotionState(
            position_ned=(px, py, pz),  # type: ignore[arg-type]  # MotionState copies any three numbers
            velocity_ned=(vx, vy, vz),  # type: ignore[arg-type]
            acceleration_ned=(ax, ay, az),  # type: ignore[arg-type]
            yaw=heading,
            yaw_rate=turn,
        )

    def jerk_at(self, t: float) -> Array:
        """Give the jerk (3,) [m/s^3], ned, at `t` [s]; zero outside of [t_start, t_end].

        Given as the start jerk of the next plan, it makes the switch between plans smooth to the jerk.
        """
        elapsed = t - self.t_start
        if elapsed < 0.0 or t > self.t_end:
            return frozen((0.0, 0.0, 0.0))
        start, duration, axes, _ = self._pieces[bisect_right(self._starts, elapsed) - 1]
        s, cube = min((elapsed - start) / duration, 1.0), duration**3
        return frozen(
            [
                (6.0 * c[3] + s * (24.0 * c[4] + s * (60.0 * c[5] + s * (120.0 * c[6] + s * 210.0 * c[7])))) / cube
                for c in axes
            ]
        )


def _septic(c: tuple[float, ...], s: float, rate: float) -> tuple[float, float, float]:
    """Give value, velocity and acceleration of a degree-7 polynomial over s; `rate` is 1 / duration [1/s]."""
    c0, c1, c2, c3, c4, c5, c6, c7 = c
    value = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * (c5 + s * (c6 + s * c7))))))
    first = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5 + s * (6.0 * c6 + s * 7.0 * c7)))))
    second = 2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * (20.0 * c5 + s * (30.0 * c6 + s * 42.0 * c7))))
    return value, rate * first, rate * rate * second
