"""The world file of a docking: anchors, target, where the chaser starts, what it is told, and what goes wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from sitl_stub.cubesat.rotation import printed_attitude
from sitl_stub.cubesat.vehicle import VERSION, vector
from sitl_stub.truth import Quaternion, Vector
from sitl_stub.world.documents import (
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Interval,
    Section,
    WorldFileError,
    file_of,
    read_document,
)

WORLDS = Path(__file__).parent / "worlds"
_FACE = 1e-6
"""Markers lie on the docking face to this [m]."""
_BESIDE = "starts inside or beside the target: leave two sides of it between the centres"


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetFile:
    """The other cube; its docking face is the side +z of its frame t."""

    position: Vector
    """Centre [m], in c."""
    quaternion: Quaternion
    """c_from_t"""
    side: float
    """[m]"""
    markers: tuple[Vector, ...]
    """On the docking face [m], in t."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyFile:
    """How well anchors and target are known: standard deviations of the truth about the file."""

    anchor_std: float
    """[m], each axis."""
    target_position_std: float
    """[m], each axis."""
    target_attitude_std: float
    """[rad], about each axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChaserFile:
    """Where the chaser starts, at rest, and what pushes it ever after."""

    position: Vector
    """Centre [m], in c."""
    quaternion: Quaternion
    """c_from_d"""
    position_std: float
    """Of the true start [m], each axis."""
    attitude_std: float
    """Of the true start [rad], about each axis."""
    residual_acceleration: float
    """[m/s^2]; its direction is drawn, and constant in c."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialEstimateFile:
    """Standard deviations of what the chaser is told about its start, each axis."""

    position_std: float
    """[m]"""
    velocity_std: float
    """[m/s]"""
    attitude_std: float
    """[rad]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultsFile:
    """What goes wrong with radio and camera."""

    outlier_share: float
    """Of the ranges."""
    outlier: Interval
    """By how much an outlier is too long [m]."""
    dropout_interval: float
    """Mean time between losses of the radio [s]; 0: none."""
    dropout: float
    """Time that a loss lasts [s]."""
    lost_pictures: float
    """Share of the pictures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DockedFile:
    """What counts as docked at the contact."""

    position_error_max: float
    """[m]"""
    attitude_error_max: float
    """[rad]"""
    closing_speed_max: float
    """[m/s]"""
    lateral_speed_max: float
    """[m/s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingWorld:
    """What the file says; nothing is drawn yet. It is also what the chaser is told about anchors and target."""

    name: str
    anchors: tuple[Vector, ...]
    """[m], in c."""
    target: TargetFile
    survey: SurveyFile
    chaser: ChaserFile
    initial_estimate: InitialEstimateFile
    faults: FaultsFile
    docked: DockedFile

    @classmethod
    def load(cls, path_or_name: str | Path) -> DockingWorld:
        """Read a world file, or the one of that name that comes with the simulator.

        Raises `WorldFileError` with file, line and key where something is missing, unknown or impossible.
        """
        path = file_of(path_or_name, WORLDS, what="docking world")
        document = read_document(path)
        document.integer("version", bounds=VERSION)
        world = cls(
            name=document.text("name", path.stem),
            anchors=tuple(_place(anchor) for anchor in document.sections("anchors")),
            target=_target(document.section("target")),
            survey=_survey(document.section("survey")),
            chaser=_chaser(document.section("chaser")),
            initial_estimate=_initial_estimate(document.section("initial_estimate")),
            faults=_faults(document.section("radio"), document.section("camera")),
            docked=_docked(document.section("docked")),
        )
        document.finish()
        if not world.anchors:
            raise document.error("anchors", "must name at least one anchor")
        if world.starts_beside_target:
            raise document.error("chaser", _BESIDE)
        return world

    @property
    def starts_beside_target(self) -> bool:
        """Whether there is no room between chaser and target at the start."""
        return math.dist(self.chaser.position, self.target.position) < 2.0 * self.target.side

    def starting_at(self, position: Vector) -> DockingWorld:
        """Give the same world with another start of the chaser [m], in c.

        Raises `WorldFileError` where that is inside or beside the target.
        """
        moved = replace(self, chaser=replace(self.chaser, position=position))
        if moved.starts_beside_target:
            raise WorldFileError(f"the chaser {_BESIDE}")
        return moved


def _place(section: Section) -> Vector:
    place = vector(section, "position_m")
    section.finish()
    return place


def _attitude(section: Section) -> Quaternion:
    return printed_attitude(vector(section, "attitude_deg"))


def _spread_deg(section: Section, key: str) -> float:
    return math.radians(section.number(key, bounds=Bounds(low=0.0, high=30.0)))


def _target(section: Section) -> TargetFile:
    side = section.number("side_m", bounds=POSITIVE)
    target = TargetFile(
        position=vector(section, "position_m"),
        quaternion=_attitude(section),
        side=side,
        markers=tuple(_marker(marker, side) for marker in section.sections("markers")),
    )
    section.finish()
    return target


def _marker(section: Section, side: float) -> Vector:
    x, y, z = place = _place(section)
    half = 0.5 * side
    if abs(z - half) > _FACE or max(abs(x), abs(y)) > half:
        raise section.error("position_m", f"must lie on the docking face: |x|, |y| at most {half:g}, z = {half:g}")
    return place


def _survey(section: Section) -> SurveyFile:
    survey = SurveyFile(
        anchor_std=section.number("anchor_std_m", bounds=NOT_NEGATIVE),
        target_position_std=section.number("target_position_std_m", bounds=NOT_NEGATIVE),
        target_attitude_std=_spread_deg(section, "target_attitude_std_deg"),
    )
    section.finish()
    return survey


def _chaser(section: Section) -> ChaserFile:
    chaser = ChaserFile(
        position=vector(section, "position_m"),
        quaternion=_attitude(section),
        position_std=section.number("position_std_m", bounds=NOT_NEGATIVE),
        attitude_std=_spread_deg(section, "attitude_std_deg"),
        residual_acceleration=section.number("residual_acceleration_mps2", bounds=NOT_NEGATIVE),
    )
    section.finish()
    return chaser


def _initial_estimate(section: Section) -> InitialEstimateFile:
    estimate = InitialEstimateFile(
        position_std=section.number("position_std_m", bounds=NOT_NEGATIVE),
        velocity_std=section.number("velocity_std_mps", bounds=NOT_NEGATIVE),
        attitude_std=_spread_deg(section, "attitude_std_deg"),
    )
    section.finish()
    return estimate


def _faults(radio: Section, camera: Section) -> FaultsFile:
    low, high = radio.vector("outlier_m", 2, bounds=NOT_NEGATIVE)
    if low > high:
        raise radio.error("outlier_m", "must be [least, largest]")
    faults = FaultsFile(
        outlier_share=radio.number("outlier_share", bounds=FRACTION),
        outlier=Interval(low, high),
        dropout_interval=radio.number("dropout_interval_s", bounds=NOT_NEGATIVE),
        dropout=radio.number("dropout_s", bounds=NOT_NEGATIVE),
        lost_pictures=camera.number("lost_pictures", bounds=FRACTION),
    )
    radio.finish()
    camera.finish()
    return faults


def _docked(section: Section) -> DockedFile:
    docked = DockedFile(
        position_error_max=section.number("position_error_max_m", bounds=POSITIVE),
        attitude_error_max=section.number("attitude_error_max_rad", bounds=POSITIVE),
        closing_speed_max=section.number("closing_speed_max_mps", bounds=POSITIVE),
        lateral_speed_max=section.number("lateral_speed_max_mps", bounds=POSITIVE),
    )
    section.finish()
    return docked
