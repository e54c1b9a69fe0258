"""The vehicle file: mass, rotors, gear, noise of the estimate, changed autopilot parameters, camera."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import yaml

VEHICLES = Path(__file__).parent.parent / "vehicles"
Triple = tuple[float, float, float]
T = TypeVar("T")


class VehicleFileError(ValueError):
    """A vehicle file that cannot be used; the message names the file and the key."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyParameters:
    """Rigid body and rotors of a quadrotor X."""

    mass_kg: float
    inertia_kg_m2: Triple
    rotor_arm_m: float
    rotor_thrust_max_n: float
    rotor_torque_per_thrust_m: float
    rotor_time_constant_s: float
    rotor_radius_m: float
    rotor_height_m: float
    drag_linear_n_per_mps: float
    drag_quadratic_n_per_mps2: float
    angular_drag_nm_per_radps: float
    rotors_stop_on_termination: bool
    """Whether flight termination stops the rotors; otherwise they go on as they were."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GearParameters:
    """Four feet that press on surfaces: springs, dampers and Coulomb friction, each figure for one foot."""

    foot_forward_m: float
    foot_right_m: float
    foot_down_m: float
    stiffness_n_per_m: float
    damping_n_per_mps: float
    tangential_stiffness_n_per_m: float
    tangential_damping_n_per_mps: float
    friction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorParameters:
    """How the autopilot's estimate differs from the truth; triples are north, east, down or roll, pitch, yaw."""

    enabled: bool
    velocity_std_mps: Triple
    velocity_correlation_s: Triple
    velocity_smoothing_s: Triple
    position_decay_per_s: Triple
    attitude_bias_std_deg: Triple
    attitude_std_deg: Triple
    attitude_correlation_s: Triple
    attitude_smoothing_s: Triple
    gyro_noise_std_radps: float
    accelerometer_noise_std_mps2: float
    range_finder_noise_std_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConfig:
    """One simulated vehicle."""

    name: str
    body: BodyParameters
    gear: GearParameters
    estimator: EstimatorParameters
    start_heading_deg: tuple[float, float]
    """Range [deg] from which the seed draws the heading at the start."""
    autopilot: Mapping[str, float | int]
    """Autopilot parameters that differ from PX4's defaults."""
    camera: Mapping[str, Any]
    """The `camera:` section as it stands; its meaning belongs to the world half."""

    @classmethod
    def load(cls, path_or_name: str | Path) -> "VehicleConfig":
        """Read a vehicle file, or the vehicle of that name that comes with the simulator.

        Raises `VehicleFileError` when the file is missing, is no YAML, has unknown or missing keys, or values that are
        no finite numbers or below zero where that has no meaning.
        """
        path = Path(path_or_name)
        if not path.suffix:
            path = VEHICLES / f"{path_or_name}.yaml"
        try:
            document = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            known = ", ".join(sorted(p.stem for p in VEHICLES.glob("*.yaml")))
            raise VehicleFileError(f"{path}: not a readable vehicle file ({error}); known vehicles: {known}") from error
        if not isinstance(document, dict):
            raise VehicleFileError(f"{path}: expected a mapping, got {type(document).__name__}")
        sections = {"version", "name", "body", "gear", "start", "autopilot", "estimator", "camera"}
        _same_keys(document, sections, f"{path}")
        start = document["start"]
        _same_keys(start, {"heading_deg"}, f"{path}: start")
        heading = _numbers(start["heading_deg"], 2, f"{path}: start.heading_deg")
        return cls(
            name=str(document["name"]),
            body=_section(BodyParameters, document["body"], f"{path}: body"),
            gear=_section(GearParameters, document["gear"], f"{path}: gear"),
            estimator=_section(EstimatorParameters, document["estimator"], f"{path}: estimator"),
            start_heading_deg=(heading[0], heading[1]),
            autopilot=dict(document["autopilot"] or {}),
            camera=dict(document["camera"] or {}),
        )


def _same_keys(section: object, expected: set[str], where: str) -> None:
    if not isinstance(section, dict):
        raise VehicleFileError(f"{where}: expected a mapping")
    unknown, missing = set(section) - expected, expected - set(section)
    if unknown or missing:
        raise VehicleFileError(f"{where}: unknown keys {sorted(map(str, unknown))}, missing keys {sorted(missing)}")


def _numbers(value: object, count: int, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise VehicleFileError(f"{where}: expected a list of {count} numbers, got {value!r}")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            raise VehicleFileError(f"{where}: {number!r} is no finite number")
    return tuple(float(number) for number in value)


def _section(kind: type[T], section: Any, where: str) -> T:
    names = {field.name: field.type for field in fields(kind)}  # type: ignore[arg-type]
    _same_keys(section, set(names), where)
    values: dict[str, Any] = {}
    for name, declared in names.items():
        value, place = section[name], f"{where}.{name}"
        if declared is bool:
            if not isinstance(value, bool):
                raise VehicleFileError(f"{place}: expected true or false, got {value!r}")
            values[name] = value
            continue
        triple = declared == Triple
        numbers = _numbers(value, 3, place) if triple else _numbers([value], 1, place)
        if min(numbers) < 0.0:
            raise VehicleFileError(f"{place}: {value!r} is below zero")
        values[name] = numbers if triple else numbers[0]
    return kind(**values)
