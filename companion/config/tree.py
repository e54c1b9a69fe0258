"""The one configuration: every package's parameters in a single frozen tree."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Len

from companion.config.sections import CameraSection, LinkSection, RecordingSection, VehicleSection
from companion.estimation.measurement import MeasurementParameters
from companion.estimation.ownship import OwnshipHistoryParameters
from companion.estimation.target_model import TargetEstimatorParameters
from companion.guidance.parameters import GuidanceParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationSection:
    """The target's estimate, relative to the vehicle."""

    target: TargetEstimatorParameters = field(default_factory=TargetEstimatorParameters)  # the filter
    measurement: MeasurementParameters = field(default_factory=MeasurementParameters)  # from pose to measurement
    ownship: OwnshipHistoryParameters = field(default_factory=OwnshipHistoryParameters)  # history of our own motion


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A configuration file. Whatever it leaves out has the default that stands beside the code it tunes."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people: which vehicle, which purpose
    camera: CameraSection  # the downward camera
    vehicle: VehicleSection = field(default_factory=VehicleSection)  # the airframe
    link: LinkSection = field(default_factory=LinkSection)  # MAVLink to the autopilot
    estimation: EstimationSection = field(default_factory=EstimationSection)  # where the target is
    guidance: GuidanceParameters = field(default_factory=GuidanceParameters)  # what to do next
    recording: RecordingSection = field(default_factory=RecordingSection)  # what is written down
