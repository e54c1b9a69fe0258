"""What proximity operations exchange: readings of the sensors, the estimated pose, goals and nozzle pulses.

Frames: `c` is fixed to the mother-ship (or to the landing pad) and carries the ranging anchors; `d` is the body of the
chaser, its origin the centre of mass; `cam` is the chaser's camera (x right, y down, z along the optical axis).
Quaternions are (w, x, y, z), Hamilton's product, and turn vectors of `d` into `c`.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.arrays import Array, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GyroReading:
    """One reading of the rate gyroscope."""

    t: float  # [s] when it was taken
    rate: Array  # (3,) [rad/s] of d against c, in d

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", frozen(self.rate, (3,)))


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeReading:
    """One range between the chaser's radio and an anchor."""

    t: float  # [s] when it was taken
    anchor: int  # number of the anchor in the survey
    range: float  # [m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FeatureReading:
    """Markers of the target that the camera has found in one picture."""

    t: float  # [s] when the picture was taken
    markers: tuple[int, ...]  # numbers of the markers in the target's file
    positions: Array  # (N, 3) [m] of those markers, in cam

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", frozen(self.positions, (len(self.markers), 3)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProximityState:
    """The chaser's estimated motion against the mother-ship."""

    t: float  # [s]
    position: Array  # (3,) [m] of the centre of mass, in c
    velocity: Array  # (3,) [m/s] of the centre of mass, in c
    quaternion: Array  # (4,) c_from_d
    rate: Array  # (3,) [rad/s] of d against c, in d
    covariance: Array  # (9, 9): position, velocity (c), attitude error (rotation vector in d, truth = estimate * error)
    mahalanobis: float  # root mean square Mahalanobis distance per degree of freedom of the last second's measurements
    t_vision: float  # [s] of the newest fused picture, -inf before the first
    t_range: float  # [s] of the newest fused range, -inf before the first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseGoal:
    """Where the chaser is to be, now."""

    position: Array  # (3,) [m] of the centre of mass, in c
    velocity: Array  # (3,) [m/s], in c
    acceleration: Array  # (3,) [m/s^2], in c
    quaternion: Array  # (4,) c_from_d
    rate: Array  # (3,) [rad/s], in d


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NozzlePulses:
    """How long each nozzle is to open in the control period that begins at `t`."""

    t: float  # [s]
    on_times: tuple[float, ...]  # [s], 0: stays shut
    force: Array  # (3,) [N] mean over the period, in d
    torque: Array  # (3,) [N m] mean over the period, in d
