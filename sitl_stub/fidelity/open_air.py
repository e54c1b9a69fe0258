"""A world with flat ground and a steady wind that can be changed in flight: PX4's SIH has no other."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sitl_stub.truth import GROUND, TargetTruth, Truth, Vector, VehicleTruth

if TYPE_CHECKING:
    from sitl_stub.simulation import CameraKind
    from sitl_stub.world.camera import Frame


class FlatGround:
    """Ground at height 0, no platforms."""

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        """Nothing moves."""

    def truths(self) -> tuple[TargetTruth, ...]:
        """Give no platforms."""
        return ()

    def surface_under(self, north: float, east: float) -> tuple[float, str, Vector, float]:  # noqa: ARG002
        """Give the ground."""
        return (0.0, GROUND, (0.0, 0.0, 0.0), 0.0)


class NoCamera:
    """Nothing is seen."""

    def step(self, t: float, truth: Truth) -> None:
        """Look at nothing."""

    def frames(self, t: float) -> "Sequence[Frame]":  # noqa: ARG002
        """Give no frames."""
        return ()


class OpenAir:
    """World, running world and wind in one: it has no dice to throw."""

    def __init__(self, *, north: float = 0.0, east: float = 0.0) -> None:
        self.north, self.east = north, east
        """Velocity of the air [m/s]; PX4's SIH_WIND_N and SIH_WIND_E say where it comes from: the opposite sign."""
        self.targets = FlatGround()
        self.camera = NoCamera()
        self.ranging = None

    @property
    def wind(self) -> "OpenAir":
        """The air."""
        return self

    @property
    def mean_speed(self) -> float:
        """Speed of the air [m/s]."""
        return math.hypot(self.north, self.east)

    def step(self, dt: float) -> Vector:  # noqa: ARG002
        """Give the air's velocity [m/s], ned."""
        return (self.north, self.east, 0.0)

    def start(
        self,
        seeds: np.random.SeedSequence,  # noqa: ARG002
        camera: "CameraKind",  # noqa: ARG002
        camera_parameters: Mapping[str, Any],  # noqa: ARG002
    ) -> "OpenAir":
        """Give itself."""
        return self
