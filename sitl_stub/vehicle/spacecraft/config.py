"""The free-flyer's own section of the vehicle file."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sitl_stub.vehicle.config import Triple, VehicleFile, VehicleFileError, common_sections, section

SPACECRAFT = "spacecraft"


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyerBodyParameters:
    """A disc on air bearings with eight thrusters, two at each corner of a square, as PX4's ATMOS airframe has them."""

    mass_kg: float
    yaw_inertia_kg_m2: float
    body_height_m: float
    """Body origin above the floor."""
    footprint_radius_m: float
    """Nothing of the vehicle stands out beyond this."""
    thruster_lever_m: float
    """Half the side of the square at whose corners the thrusters sit."""
    mass_centre_offset_m: Triple
    """Centre of mass from the middle of the thrusters, frd; only forward and right count."""
    thrust_n: float
    """Thrust of one open thruster while all others are shut."""
    pressure_drop: float
    """Share of its thrust that each open thruster loses for each other one that is open."""
    pulse_period_s: float
    """Each valve opens at most once in this time, at its beginning."""
    pulse_on_time_min_s: float
    """A shorter opening gives no thrust and is not made: the dead band."""
    thrust_time_constant_s: float
    """Rise and fall of the thrust behind the valve."""
    film_drag_n_per_mps: float
    """Friction of the air film under the bearings."""
    film_turn_drag_nm_per_radps: float
    air_drag_n_per_mps2: float
    """Resistance that grows with the square of the speed through the air."""
    floor_slope_deg: float
    floor_downhill_deg: float
    """Heading into which the floor falls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyerConfig(VehicleFile):
    """One simulated free-flyer."""

    body: FreeFlyerBodyParameters

    @property
    def origin_height_m(self) -> float:
        """See `VehicleFile.origin_height_m`."""
        return self.body.body_height_m

    @classmethod
    def read(cls, where: str, document: Mapping[str, Any]) -> "FreeFlyerConfig":
        """Take over a file's content; `where` names the file in errors. Raises `VehicleFileError`."""
        common = common_sections(where, document, SPACECRAFT, {"body"})
        above_zero = ("mass_kg", "yaw_inertia_kg_m2", "thruster_lever_m", "thrust_n", "pulse_period_s")
        body = section(FreeFlyerBodyParameters, document["body"], f"{where}: body", above_zero)
        if not body.pulse_on_time_min_s < body.pulse_period_s:
            raise VehicleFileError(f"{where}: body.pulse_on_time_min_s must be below pulse_period_s")
        return cls(**common, body=body)
