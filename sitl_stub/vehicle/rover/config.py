"""The rover's own section of the vehicle file."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sitl_stub.vehicle.config import VehicleFile, common_sections, section

ROVER_ACKERMANN = "rover_ackermann"


@dataclass(frozen=True, slots=True, kw_only=True)
class RoverBodyParameters:
    """A car: two axles, steered at the front, driven along its body."""

    mass_kg: float
    yaw_inertia_kg_m2: float
    front_axle_m: float
    """Front axle ahead of the centre of mass; with `rear_axle_m` it makes the wheel base."""
    rear_axle_m: float
    body_height_m: float
    """Body origin above the ground."""
    steering_angle_max_deg: float
    """Angle of the front wheels at full steering."""
    cornering_stiffness_n_per_rad: float
    """Side force of one axle for its slip angle."""
    grip: float
    """Side force of an axle never exceeds `grip` times its load."""
    yaw_damping_nm_per_radps: float
    thrust_max_n: float
    """Driving force at full throttle."""
    actuator_time_constant_s: float
    """Lag of throttle and steering."""
    static_friction_n: float
    """Force that must be overcome to start from rest."""
    creeping_friction_n: float
    """Resistance below 0.05 m/s."""
    rolling_friction_n: float
    """Resistance while rolling."""
    rolling_drag_n_per_mps2: float
    """Resistance that grows with the square of the speed over ground."""
    air_drag_n_per_mps2: float
    """Resistance that grows with the square of the speed through the air."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoverConfig(VehicleFile):
    """One simulated rover."""

    body: RoverBodyParameters

    @property
    def origin_height_m(self) -> float:
        """See `VehicleFile.origin_height_m`."""
        return self.body.body_height_m

    @classmethod
    def read(cls, where: str, document: Mapping[str, Any]) -> "RoverConfig":
        """Take over a file's content; `where` names the file in errors. Raises `VehicleFileError`."""
        common = common_sections(where, document, ROVER_ACKERMANN, {"body"})
        above_zero = ("mass_kg", "yaw_inertia_kg_m2", "front_axle_m", "rear_axle_m", "actuator_time_constant_s")
        body = section(RoverBodyParameters, document["body"], f"{where}: body", above_zero)
        return cls(**common, body=body)
