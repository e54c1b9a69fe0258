"""A world file, and the running world made from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sitl_stub.world.camera import CameraConfig, CameraFaults, CameraSensor, Content, Imager
from sitl_stub.world.corners import CornersImager
from sitl_stub.world.documents import (
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Section,
    WorldFileError,
    file_of,
    read_document,
)
from sitl_stub.world.exposure import Exposure
from sitl_stub.world.light import Light, LightConfig
from sitl_stub.world.motion import MotionConfig
from sitl_stub.world.pads import find_pad, load_pad
from sitl_stub.world.photosensor import Photosensor
from sitl_stub.world.ranging import Ranging, RangingConfig
from sitl_stub.world.renderer import Renderer
from sitl_stub.world.targets import StartCondition, TargetConfig, Targets
from sitl_stub.world.wind import CALM, Wind, WindConfig

WORLDS = Path(__file__).parent / "worlds"
CameraKind = Literal["rendered", "corners"]

_GROUND_NAMES = ("ground", "")
_METRES = Bounds(low=-1000.0, high=1000.0)
_DEGREES = Bounds(low=-360.0, high=360.0)


class RenderedImager:
    """Makes rendered pictures."""

    def __init__(self, renderer: Renderer, light: Light, sensor: Photosensor) -> None:
        self._renderer = renderer
        self._light = light
        self._sensor = sensor

    def capture(self, exposure: Exposure, *, bad: bool) -> Content:
        """Give a picture."""
        north, east = self._renderer.ground_points(exposure.at(exposure.t_middle))
        uneven = self._renderer.spread(self._light.on_ground(north, east))
        level = self._light.exposure(exposure.t_middle)
        return Content(image=self._sensor.develop(self._renderer.render(exposure), uneven, level, bad=bad))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunningWorld:
    """A world with its dice thrown."""

    targets: Targets
    wind: Wind
    camera: CameraSensor
    ranging: Ranging | None = None  # no radios


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What a world file says. Nothing is drawn yet."""

    name: str
    targets: tuple[TargetConfig, ...]
    wind: WindConfig
    light: LightConfig
    ground_contrast: float  # 0 is plain grey
    camera_faults: CameraFaults
    ranging: RangingConfig | None = None  # no radios

    @classmethod
    def load(cls, path_or_name: str | Path) -> World:
        """Read a world file, or the world of that name that comes with the simulator; raises `WorldFileError`."""
        path = file_of(path_or_name, WORLDS, what="world")
        document = read_document(path)
        document.integer("version", bounds=Bounds(low=1, high=1))
        ground = document.section("ground")
        targets = _targets(document, path.parent)
        world = cls(
            name=document.text("name", path.stem),
            targets=targets,
            wind=CALM if document.has("wind") and _is_calm(document) else WindConfig.read(document.section("wind")),
            light=LightConfig.read(document.section("light")),
            ground_contrast=ground.number("contrast", 1.0, Bounds(low=0.0, high=3.0)),
            camera_faults=CameraFaults.read(document.section("camera")),
            ranging=RangingConfig.read(document.section("ranging"), targets) if document.has("ranging") else None,
        )
        ground.finish()
        document.finish()
        return world

    def flat(self) -> World:
        """Give the same world with every platform lying on the ground as a mat, without sides."""
        return replace(self, targets=tuple(replace(target, height=0.0, sides=False) for target in self.targets))

    def in_wind(self, mean: float) -> World:
        """Give the same world in a wind of this mean [m/s], see `WindConfig.of_mean`."""
        return replace(self, wind=WindConfig.of_mean(mean))

    def with_measurements(self, *, interval: float | None = None, corrupted: float | None = None) -> World:
        """Give the same world seen less often, or wrongly.

        Args:
            interval: between two frames at least [s]; None: as the world has it.
            corrupted: share of the frames in which the targets are somewhere else; None: as the world has it.
        """
        faults = self.camera_faults
        interval = faults.interval if interval is None else interval
        corrupted = faults.corrupted if corrupted is None else corrupted
        return replace(self, camera_faults=replace(faults, interval=interval, corrupted=corrupted))

    def with_dropouts(self, length: float) -> World:
        """Give the same world with other dropouts of the camera.

        Args:
            length: of each [s]; 0: none. When they come is the world's.

        Raises:
            WorldFileError: the world has no dropouts.
        """
        faults = self.camera_faults
        if length > 0.0 and not faults.blindness.length:
            raise WorldFileError(f'the world "{self.name}" has no dropouts to be made {length:g} s long: camera.blind')
        return replace(self, camera_faults=replace(faults, blindness=replace(faults.blindness, length=length)))

    def start(
        self, seeds: np.random.SeedSequence, camera: CameraKind, camera_parameters: Mapping[str, Any]
    ) -> RunningWorld:
        """Throw the dice.

        Targets, wind, frame times and losses, and ranges are the same for both kinds of camera. `camera_parameters` is
        the `camera:` mapping of a vehicle file, see `CameraConfig.from_mapping`. Raises `WorldFileError` where it is
        wrong.
        """
        config = CameraConfig.from_mapping(camera_parameters)
        for_targets, for_wind, for_frames, for_imager, for_ranging = (
            np.random.default_rng(seed) for seed in seeds.spawn(5)
        )
        pads = tuple(target.pad for target in self.targets)
        imager: Imager
        if camera == "corners":
            imager = CornersImager(config.intrinsics, pads, for_imager)
        else:
            imager = self._rendered(config, for_imager)
        return RunningWorld(
            targets=Targets(self.targets, for_targets),
            wind=Wind(self.wind, for_wind),
            camera=CameraSensor(config, self.camera_faults, imager, pads, for_frames),
            ranging=None if self.ranging is None else Ranging(self.ranging, for_ranging),
        )

    def _rendered(self, config: CameraConfig, rng: np.random.Generator) -> RenderedImager:
        for_ground, for_light, for_sensor = rng.spawn(3)
        return RenderedImager(
            Renderer(config.intrinsics, self.targets, contrast=self.ground_contrast, rng=for_ground),
            Light(self.light, for_light),
            Photosensor(config, for_sensor),
        )


def _is_calm(document: Section) -> bool:
    try:
        return document.text("wind") == "calm"
    except WorldFileError:
        return False


def _targets(document: Section, folder: Path) -> tuple[TargetConfig, ...]:
    targets: list[TargetConfig] = []
    for section in document.sections("targets"):
        target = _target(section, folder)
        if target.name in _GROUND_NAMES or any(target.name == other.name for other in targets):
            raise section.error("name", f"'{target.name}' is taken")
        targets.append(target)
    return tuple(targets)


def _target(section: Section, folder: Path) -> TargetConfig:
    start, starts = section.section("start"), section.section("starts")
    heading = start.interval("heading_deg", bounds=_DEGREES)
    above = starts.number("vehicle_above_m", bounds=NOT_NEGATIVE) if starts.has("vehicle_above_m") else -math.inf
    within = starts.number("vehicle_within_m", bounds=POSITIVE) if starts.has("vehicle_within_m") else math.inf
    try:
        pad = load_pad(find_pad(section.text("pad"), folder))
    except WorldFileError as error:
        raise section.error("pad", str(error)) from error
    target = TargetConfig(
        name=section.text("name"),
        pad=pad,
        height=0.0 if pad.faces else section.number("height_m", 0.15, Bounds(above=0.0, high=20.0)),
        sides=not pad.faces and section.boolean("sides", True),
        north=start.interval("north_m", bounds=_METRES),
        east=start.interval("east_m", bounds=_METRES),
        heading=type(heading)(math.radians(heading.low), math.radians(heading.high)),
        starts=StartCondition(
            vehicle_above=above, vehicle_within=within, after=starts.number("after_s", 0.0, NOT_NEGATIVE)
        ),
        motion=MotionConfig.read(section.section("motion")),
    )
    start.finish()
    starts.finish()
    section.finish()
    return target
