"""The true state as scoring sees it: one sample of the vehicle and its targets, from the simulator or a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from companion.geometry.quaternions import yaw_of_quaternion

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSample:
    """One target at one instant."""

    name: str
    position_ned: Vector  # [m] of the landing point on its top surface
    yaw: float  # [rad] landing heading from north
    velocity_ned: Vector  # [m/s] of the landing point
    yaw_rate: float  # [rad/s]
    moving: bool  # moves or turns now


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthSample:
    """Vehicle and targets at one instant, in the world's ned frame."""

    t: float  # [s] simulation time
    position_ned: Vector  # [m] body origin
    velocity_ned: Vector  # [m/s]
    yaw: float  # [rad] heading from north
    armed: bool
    feet_in_contact: int  # of four
    surface: str  # name of the target that all touching feet stand on, "ground", or "" in the air
    targets: tuple[TargetSample, ...]

    def target(self, name: str | None) -> TargetSample:
        """Give one target by name; None: the first.

        Raises:
            KeyError: there is none of that name.
        """
        for target in self.targets:
            if name is None or target.name == name:
                return target
        raise KeyError(f"no target {name!r}; there are {[target.name for target in self.targets]}")


class VehicleLike(Protocol):
    """What of the simulator's true vehicle is needed."""

    @property
    def position_ned(self) -> Vector: ...  # noqa: D102
    @property
    def velocity_ned(self) -> Vector: ...  # noqa: D102
    @property
    def quaternion(self) -> tuple[float, float, float, float]: ...  # noqa: D102
    @property
    def feet_in_contact(self) -> int: ...  # noqa: D102
    @property
    def surface(self) -> str: ...  # noqa: D102
    @property
    def armed(self) -> bool: ...  # noqa: D102


class TargetLike(Protocol):
    """What of the simulator's true target is needed."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def position_ned(self) -> Vector: ...  # noqa: D102
    @property
    def yaw(self) -> float: ...  # noqa: D102
    @property
    def velocity_ned(self) -> Vector: ...  # noqa: D102
    @property
    def yaw_rate(self) -> float: ...  # noqa: D102
    @property
    def moving(self) -> bool: ...  # noqa: D102
    @property
    def half_size(self) -> tuple[float, float]: ...  # noqa: D102


class TruthLike(Protocol):
    """What `Simulation.truth()` gives."""

    @property
    def t(self) -> float: ...  # noqa: D102
    @property
    def vehicle(self) -> VehicleLike: ...  # noqa: D102
    @property
    def targets(self) -> Sequence[TargetLike]: ...  # noqa: D102


def sample_truth(truth: TruthLike) -> TruthSample:
    """Take a sample from the simulator's truth."""
    vehicle = truth.vehicle
    return TruthSample(
        t=truth.t,
        position_ned=vehicle.position_ned,
        velocity_ned=vehicle.velocity_ned,
        yaw=yaw_of_quaternion(vehicle.quaternion),
        armed=vehicle.armed,
        feet_in_contact=vehicle.feet_in_contact,
        surface=vehicle.surface,
        targets=tuple(
            TargetSample(
                name=target.name,
                position_ned=target.position_ned,
                yaw=target.yaw,
                velocity_ned=target.velocity_ned,
                yaw_rate=target.yaw_rate,
                moving=target.moving,
            )
            for target in truth.targets
        ),
    )


def truth_record(truth: TruthLike) -> dict[str, Any]:
    """Write the simulator's truth as a message of the channel `truth`."""
    vehicle = truth.vehicle
    return {
        "t": truth.t,
        "position_ned": vehicle.position_ned,
        "velocity_ned": vehicle.velocity_ned,
        "quaternion": vehicle.quaternion,
        "armed": vehicle.armed,
        "feet_in_contact": vehicle.feet_in_contact,
        "surface": vehicle.surface,
        "targets": [
            {
                "name": target.name,
                "position_ned": target.position_ned,
                "yaw": target.yaw,
                "velocity_ned": target.velocity_ned,
                "yaw_rate": target.yaw_rate,
                "half_size": target.half_size,
                "moving": target.moving,
            }
            for target in truth.targets
        ],
    }


def sample_from_record(data: Mapping[str, Any]) -> TruthSample:
    """Read a message of the channel `truth` back."""
    return TruthSample(
        t=data["t"],
        position_ned=_vector(data["position_ned"]),
        velocity_ned=_vector(data["velocity_ned"]),
        yaw=yaw_of_quaternion(data["quaternion"]),
        armed=data["armed"],
        feet_in_contact=data["feet_in_contact"],
        surface=data.get("surface", ""),
        targets=tuple(
            TargetSample(
                name=target["name"],
                position_ned=_vector(target["position_ned"]),
                yaw=target["yaw"],
                velocity_ned=_vector(target["velocity_ned"]),
                yaw_rate=target.get("yaw_rate", 0.0),
                moving=target["moving"],
            )
            for target in data["targets"]
        ),
    )


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return x, y, z
