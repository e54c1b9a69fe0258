"""Setpoints for vehicles that are flown by attitude and body thrust."""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.arrays import Array, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AttitudeThrust:
    """Level attitude and thrust along the body's axes."""

    t: float  # [s] tick that made it
    yaw: float  # [rad] from north
    thrust_body: Array  # (3,) normalised, -1..1, frd; down is 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "thrust_body", frozen(self.thrust_body, (3,)))
