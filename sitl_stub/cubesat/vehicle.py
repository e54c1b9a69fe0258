"""The file of a CubeSat that docks: body, nozzles, how well it is built, and what its sensors are like."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sitl_stub.cubesat.rotation import Matrix
from sitl_stub.truth import Vector
from sitl_stub.vehicle.config import VEHICLES
from sitl_stub.world.documents import FRACTION, NOT_NEGATIVE, POSITIVE, Bounds, Section, read_document

CUBESAT = "cubesat"
VERSION = Bounds(low=1, high=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFile:
    """A cube, rigid."""

    side: float
    """[m]"""
    mass: float
    """[kg]"""
    inertia: Matrix
    """Tensor about the centre of mass [kg m^2], in d: products of inertia with their minus sign."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NozzleFile:
    """One nozzle as designed."""

    position: Vector
    """[m], in d."""
    direction: Vector
    """Of the force on the body, in d, unit length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PropulsionFile:
    """All nozzles, and the valves before them."""

    nozzles: tuple[NozzleFile, ...]
    thrust: float
    """Of each open nozzle [N]."""
    on_time_min: float
    """A shorter opening [s] is not made."""
    period: float
    """Control period [s]: each valve opens at most once in it."""
    valve_delay: float
    """From the command to the flow [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AsBuiltFile:
    """Standard deviations by which the built vehicle differs from the designed one."""

    thrust_std: float
    """Share of each nozzle's thrust."""
    direction_std: float
    """[rad] about each of two axes across the nozzle."""
    mass_std: float
    """Share; the inertia goes with it."""
    mass_centre_std: float
    """[m], each axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroFile:
    """The rate gyroscope."""

    enabled: bool
    rate: float
    """Readings per second [Hz]."""
    latency: float
    """From the reading to its delivery [s]."""
    noise_density: float
    """Of the rate's white noise [rad/s/sqrt(Hz)]: the angle's random walk [rad/sqrt(s)]."""
    bias_std: float
    """Of the constant bias of each axis [rad/s]."""

    @property
    def noise_std(self) -> float:
        """Standard deviation of one reading [rad/s]: density times sqrt(rate).

        Then the angle that the readings add up to walks by density times sqrt(time), whatever the rate. A data sheet
        may mean a one-sided density instead, sqrt(2) less; it does not say, and the larger noise is the safe reading.
        """
        return self.noise_density * math.sqrt(self.rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioFile:
    """The ultra-wideband radio that measures ranges to the anchors in turn."""

    enabled: bool
    rate: float
    latency: float
    position: Vector
    """Lever arm [m], in d."""
    noise_std: float
    """[m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFile:
    """The camera on the docking face; `cam` is x right and y down in the picture, z along the optical axis."""

    enabled: bool
    rate: float
    latency: float
    position: Vector
    """[m], in d."""
    d_from_cam: Matrix
    focal_length: float
    """[pixels]"""
    pixel_step: float
    """To which the place of a marker in the picture is found [pixels]; 0: exactly."""
    half_angle: float
    """Of the cone of sight about the optical axis [rad]."""
    near: float
    """Least distance to the docking face [m]."""
    far: float
    """Largest distance to the docking face [m]."""
    face_turned_max: float
    """Largest angle between the docking face's normal and the line of sight back [rad]."""
    noise_std: float
    """Of each component of a marker's position [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CubesatVehicle:
    """What the file says; nothing is drawn yet."""

    name: str
    body: BodyFile
    propulsion: PropulsionFile
    as_built: AsBuiltFile
    gyro: GyroFile
    radio: RadioFile
    camera: CameraFile

    @classmethod
    def load(cls, path_or_name: str | Path = CUBESAT) -> CubesatVehicle:
        """Read a CubeSat's file, or the one of that name that comes with the simulator.

        Raises `WorldFileError` with file, line and key where something is missing, unknown or impossible.
        """
        path = Path(path_or_name)
        document = read_document(path if path.suffix else VEHICLES / f"{path_or_name}.yaml")
        document.integer("version", bounds=VERSION)
        if document.text("kind") != CUBESAT:
            raise document.error("kind", f"must be {CUBESAT}: the docking simulator flies nothing else")
        vehicle = cls(
            name=document.text("name"),
            body=_body(document.section("body")),
            propulsion=_propulsion(document.section("nozzles")),
            as_built=_as_built(document.section("as_built")),
            gyro=_gyro(document.section("gyro")),
            radio=_radio(document.section("radio")),
            camera=_camera(document.section("camera")),
        )
        document.finish()
        return vehicle


def vector(section: Section, key: str) -> Vector:
    """Read three numbers."""
    x, y, z = section.vector(key, 3)
    return (x, y, z)


def _direction(section: Section, key: str) -> Vector:
    x, y, z = vector(section, key)
    size = math.hypot(x, y, z)
    if size < 1e-6:
        raise section.error(key, "must have a length above zero")
    return (x / size, y / size, z / size)


def _body(section: Section) -> BodyFile:
    xx, yy, zz = section.vector("inertia_kg_m2", 3, bounds=POSITIVE)
    xy, xz, yz = section.vector("products_of_inertia_kg_m2", 3)
    inertia = ((xx, -xy, -xz), (-xy, yy, -yz), (-xz, -yz, zz))
    a, b, c = np.linalg.eigvalsh(np.array(inertia)).tolist()
    if a <= 0.0 or c > a + b:
        raise section.error(
            "inertia_kg_m2",
            "no rigid body has this tensor: each principal moment is above zero and at most the others' sum",
        )
    body = BodyFile(
        side=section.number("side_m", bounds=POSITIVE), mass=section.number("mass_kg", bounds=POSITIVE), inertia=inertia
    )
    section.finish()
    return body


def _propulsion(section: Section) -> PropulsionFile:
    propulsion = PropulsionFile(
        nozzles=tuple(_nozzle(place) for place in section.sections("places")),
        thrust=section.number("thrust_n", bounds=POSITIVE),
        on_time_min=section.number("on_time_min_s", bounds=Bounds(low=1e-4)),
        period=section.number("period_s", bounds=POSITIVE),
        valve_delay=section.number("valve_delay_s", bounds=NOT_NEGATIVE),
    )
    if not propulsion.nozzles:
        raise section.error("places", "must name at least one nozzle")
    if propulsion.on_time_min >= propulsion.period:
        raise section.error("on_time_min_s", "must be less than period_s")
    if propulsion.valve_delay >= propulsion.period:
        raise section.error("valve_delay_s", "must be less than period_s")
    section.finish()
    return propulsion


def _nozzle(section: Section) -> NozzleFile:
    nozzle = NozzleFile(position=vector(section, "position_m"), direction=_direction(section, "direction"))
    section.finish()
    return nozzle


def _as_built(section: Section) -> AsBuiltFile:
    as_built = AsBuiltFile(
        thrust_std=section.number("thrust_std", bounds=Bounds(low=0.0, high=0.3)),
        direction_std=math.radians(section.number("direction_std_deg", bounds=Bounds(low=0.0, high=30.0))),
        mass_std=section.number("mass_std", bounds=Bounds(low=0.0, high=0.2)),
        mass_centre_std=section.number("mass_centre_std_m", bounds=NOT_NEGATIVE),
    )
    section.finish()
    return as_built


def _gyro(section: Section) -> GyroFile:
    gyro = GyroFile(
        enabled=section.boolean("enabled"),
        rate=section.number("rate_hz", bounds=POSITIVE),
        latency=section.number("latency_s", bounds=NOT_NEGATIVE),
        noise_density=math.radians(section.number("noise_density_degps_per_sqrt_hz", bounds=NOT_NEGATIVE)),
        bias_std=math.radians(section.number("bias_std_degps", bounds=NOT_NEGATIVE)),
    )
    section.finish()
    return gyro


def _radio(section: Section) -> RadioFile:
    radio = RadioFile(
        enabled=section.boolean("enabled"),
        rate=section.number("rate_hz", bounds=POSITIVE),
        latency=section.number("latency_s", bounds=NOT_NEGATIVE),
        position=vector(section, "position_m"),
        noise_std=section.number("noise_std_m", bounds=NOT_NEGATIVE),
    )
    section.finish()
    return radio


def _camera(section: Section) -> CameraFile:
    near, far = section.vector("distance_m", 2, bounds=NOT_NEGATIVE)
    if near >= far:
        raise section.error("distance_m", "must be [nearest, farthest]")
    camera = CameraFile(
        enabled=section.boolean("enabled"),
        rate=section.number("rate_hz", bounds=POSITIVE),
        latency=section.number("latency_s", bounds=NOT_NEGATIVE),
        position=vector(section, "position_m"),
        d_from_cam=_axes(section),
        focal_length=section.number("focal_length_px", bounds=POSITIVE),
        pixel_step=section.number("pixel_step", bounds=FRACTION),
        half_angle=math.radians(section.number("half_angle_deg", bounds=Bounds(above=0.0, high=89.0))),
        near=near,
        far=far,
        face_turned_max=math.radians(section.number("face_turned_max_deg", bounds=Bounds(low=0.0, high=90.0))),
        noise_std=section.number("noise_std_m", bounds=NOT_NEGATIVE),
    )
    section.finish()
    return camera


def _axes(section: Section) -> Matrix:
    """Give d_from_cam from the two axes that the file names; down is optical cross right."""
    x, z = _direction(section, "right_axis"), _direction(section, "optical_axis")
    if abs(x[0] * z[0] + x[1] * z[1] + x[2] * z[2]) > 1e-6:
        raise section.error("right_axis", "must be at right angles to optical_axis")
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
