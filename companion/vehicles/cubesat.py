"""CubeSats with on/off nozzles: what they may be asked for near another spacecraft."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Gt

from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.vehicles.multicopter import SetpointForm


@dataclass(frozen=True, slots=True, kw_only=True)
class CubeSatParameters:
    """The chaser as configured; the defaults are limits for one unit of 2 kg with nozzles of 25 mN.

    At 20 mm/s it stops within 25 mm, a quarter of its own side. A planned acceleration is a third of what the nozzles
    give; the rest is for feedback and turning.
    """

    approach_speed: Annotated[float, Gt(0.0)] = 0.020  # [m/s] far from the target
    reorient_speed: Annotated[float, Gt(0.0)] = 0.015  # [m/s] while it turns to the target's attitude
    closing_speed: Annotated[float, Gt(0.0)] = 0.010  # [m/s] aligned, and at contact
    acceleration: Annotated[float, Gt(0.0)] = 0.008  # [m/s^2]
    # from the goal to nozzle pulses
    control: RigidBodyParameters = field(default_factory=RigidBodyParameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class CubeSat:
    """A CubeSat: position and attitude independent of each other."""

    parameters: CubeSatParameters = field(default_factory=CubeSatParameters)
    setpoint_form: SetpointForm = SetpointForm.NOZZLE_ON_TIMES

    @property
    def closing_speed(self) -> float:
        """Largest speed [m/s] towards the target, relative to it, when aligned."""
        return self.parameters.closing_speed

    @property
    def turn_rate(self) -> float:
        """Largest turn rate [rad/s]."""
        return self.parameters.control.rate_max
