"""The vehicle file: what every kind of vehicle has, and what a multicopter has besides."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import yaml

MULTICOPTER = "multicopter"
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
class VehicleFile:
    """What the file of any vehicle says; each kind of vehicle adds its own sections."""

    name: str
    estimator: EstimatorParameters
    start_heading_deg: tuple[float, float]
    """Range [deg] from which the seed draws the heading at the start."""
    autopilot: Mapping[str, float | int]
    """Autopilot parameters that differ from PX4's defaults."""
    camera: Mapping[str, Any]
    """The `camera:` section as it stands; its meaning belongs to the world half."""
    antenna_frd_m: Triple = (0.0, 0.0, 0.0)
    """The ranging radio's antenna [m], forward, right, down of the body origin."""

    @property
    def origin_height_m(self) -> float:
        """Height of the body's origin above the ground on which the vehicle stands [m]."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleConfig(VehicleFile):
    """One simulated multicopter."""

    body: BodyParameters
    gear: GearParameters

    @property
    def origin_height_m(self) -> float:
        """See `VehicleFile.origin_height_m`."""
        return self.gear.foot_down_m

    @classmethod
    def load(cls, path_or_name: str | Path) -> "VehicleConfig":
        """Read a multicopter's file, or the multicopter of that name that comes with the simulator.

        Raises `VehicleFileError` when the file is missing, is no YAML, has unknown or missing keys, or values that are
        no finite numbers or below zero where that has no meaning.
        """
        return cls.read(*read_document(path_or_name))

    @classmethod
    def read(cls, where: str, document: Mapping[str, Any]) -> "VehicleConfig":
        """Take over a file's content; `where` names the file in errors."""
        common = common_sections(where, document, MULTICOPTER, {"body", "gear"})
        return cls(
            **common,
            body=section(BodyParameters, document["body"], f"{where}: body"),
            gear=section(GearParameters, document["gear"], f"{where}: gear"),
        )


def read_document(path_or_name: str | Path) -> tuple[str, dict[str, Any]]:
    """Read a vehicle file as YAML; returns its path and content. Raises `VehicleFileError`."""
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
    return str(path), document


def common_sections(where: str, document: Mapping[str, Any], kind: str, own: set[str]) -> dict[str, Any]:
    """Check a file's keys and read what every vehicle has, as arguments of `VehicleFile`.

    `own` are the sections that only this `kind` has. A file without `kind` is a multicopter's.
    """
    if document.get("kind", MULTICOPTER) != kind:
        raise VehicleFileError(f"{where}: kind is {document.get('kind', MULTICOPTER)!r}, expected {kind!r}")
    required = {"version", "name", "start", "autopilot", "estimator", "camera"} | own
    _same_keys({key: value for key, value in document.items() if key not in ("kind", "radio")}, required, where)
    radio = document.get("radio", {"antenna_frd_m": [0.0, 0.0, 0.0]})
    _same_keys(radio, {"antenna_frd_m"}, f"{where}: radio")
    start = document["start"]
    _same_keys(start, {"heading_deg"}, f"{where}: start")
    heading = _numbers(start["heading_deg"], 2, f"{where}: start.heading_deg")
    return {
        "name": str(document["name"]),
        "estimator": section(EstimatorParameters, document["estimator"], f"{where}: estimator"),
        "start_heading_deg": (heading[0], heading[1]),
        "autopilot": dict(document["autopilot"] or {}),
        "camera": dict(document["camera"] or {}),
        "antenna_frd_m": _numbers(radio["antenna_frd_m"], 3, f"{where}: radio.antenna_frd_m"),
    }


def _same_keys(content: object, expected: set[str], where: str) -> None:
    if not isinstance(content, dict):
        raise VehicleFileError(f"{where}: expected a mapping")
    unknown, missing = set(content) - expected, expected - set(content)
    if unknown or missing:
        raise VehicleFileError(f"{where}: unknown keys {sorted(map(str, unknown))}, missing keys {sorted(missing)}")


def _numbers(value: object, count: int, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise VehicleFileError(f"{where}: expected a list of {count} numbers, got {value!r}")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            raise VehicleFileError(f"{where}: {number!r} is no finite number")
    return tuple(float(number) for number in value)


def section(kind: type[T], content: Any, where: str, above_zero: Sequence[str] = ()) -> T:
    """Read a section whose keys are the fields of `kind`: numbers not below zero, triples of them, true or false.

    `above_zero` names numbers that may not be zero either.
    """
    names = {field.name: field.type for field in fields(kind)}  # type: ignore[arg-type]
    _same_keys(content, set(names), where)
    values: dict[str, Any] = {}
    for name, declared in names.items():
        value, place = content[name], f"{where}.{name}"
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
    for name in above_zero:
        if not values[name] > 0.0:
            raise VehicleFileError(f"{where}.{name} must be above zero")
    return kind(**values)
