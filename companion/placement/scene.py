"""A set-up of anchors, port and chaser, as the study looks at it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.steady_state import ATTITUDE_STD, steady_state
from companion.geometry.arrays import Array, frozen
from companion.geometry.rotations import rotation_from_quaternion
from companion.guidance.docking.parameters import MarkovSwitchingParameters
from companion.perception.docking_port import DockingPort
from companion.placement.sight import SightParameters, sees_port

_AT_ANCHOR = 0.01  # [m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Anchors, port and chaser, and how often they measure."""

    setup: ProximitySetup  # anchors, lever arm, markers, mounts
    noise: ProximityParameters = field(default_factory=ProximityParameters)
    start_quaternion: Array  # (4,) c_from_d, kept until the chaser turns
    port: DockingPort | None = None  # None: there is nothing to dock with, ranges are all
    sight: SightParameters = field(default_factory=SightParameters)
    switching: MarkovSwitchingParameters = field(default_factory=MarkovSwitchingParameters)
    range_rate: float = 50.0  # [1/s] of all anchors together, taken in turn
    vision_rate: float = 20.0  # [1/s] pictures
    attitude_std: float = ATTITUDE_STD  # [rad] per axis while there are no pictures

    def __post_init__(self) -> None:
        object.__setattr__(self, "start_quaternion", frozen(self.start_quaternion, (4,)))

    def with_anchors(self, anchors: Array) -> Scene:
        """Give the same scene with anchors (N, 3) [m] elsewhere."""
        return dataclasses.replace(self, setup=dataclasses.replace(self.setup, anchors=anchors))

    def radio(self, positions: Array) -> Array:
        """Give where the radio is (..., 3) [m] when the centre of mass is at `positions`, in the start's attitude."""
        result: Array = positions + rotation_from_quaternion(self.start_quaternion) @ self.setup.lever_arm
        return result

    def sees(self, position: Array, quaternion: Array) -> bool:
        """Say whether the camera sees the port from a pose."""
        return self.port is not None and sees_port(self.sight, self.setup.d_from_cam, self.port, position, quaternion)

    def covariance(self, position: Array, quaternion: Array, *, with_vision: bool) -> Array | None:
        """Give the steady-state covariance (3, 3) [m^2] of the position; None: undetermined, as at an anchor.

        Args:
            position: (3,) [m] of the centre of mass, in c.
            quaternion: (4,) c_from_d.
            with_vision: whether pictures are fused.
        """
        radio = position + rotation_from_quaternion(quaternion) @ self.setup.lever_arm
        if float(np.linalg.norm(self.setup.anchors - radio, axis=1).min()) < _AT_ANCHOR:
            return None  # a range of nothing has no direction
        try:
            whole = steady_state(
                self.setup,
                self.noise,
                position,
                quaternion,
                with_vision=with_vision,
                range_rate=self.range_rate,
                vision_rate=self.vision_rate,
                attitude_std=self.attitude_std,
            )
        except ValueError:
            return None
        return whole[:3, :3]

    def by_ranges(self, position: Array) -> Array | None:
        """Give the covariance (3, 3) [m^2] of the position by ranges alone, in the start's attitude."""
        return self.covariance(position, self.start_quaternion, with_vision=False)


def worst_std(covariance: Array | None) -> float:
    """Give the standard deviation [m] in the worst direction; inf where there is no covariance."""
    return float("inf") if covariance is None else float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def whole_std(covariance: Array | None) -> float:
    """Give the root mean square [m] of the error's length, `sqrt(trace)`; inf where there is no covariance."""
    return float("inf") if covariance is None else float(np.sqrt(np.trace(covariance)))
