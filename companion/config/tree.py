"""The one configuration: every package's parameters in a single frozen tree."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Len

from companion.config.sections import CameraSection, LinkSection, RecordingSection, VehicleSection
from companion.control.relative_feedback import RelativeFeedbackParameters
from companion.estimation.measurement import MeasurementParameters
from companion.estimation.ownship import OwnshipHistoryParameters
from companion.estimation.target_model import TargetEstimatorParameters
from companion.guardian.parameters import GuardianParameters
from companion.guidance.parameters import GuidanceParameters
from companion.perception.edge_refinement import EdgeParameters
from companion.planning.minimum_snap import PlanParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceptionSection:
    """From pixels to the pad's pose."""

    refinement: EdgeParameters = field(default_factory=EdgeParameters)  # of the tags' corners


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationSection:
    """The target's estimate, relative to the vehicle."""

    target: TargetEstimatorParameters = field(default_factory=TargetEstimatorParameters)  # the filter
    measurement: MeasurementParameters = field(default_factory=MeasurementParameters)  # from pose to measurement
    ownship: OwnshipHistoryParameters = field(default_factory=OwnshipHistoryParameters)  # history of our own motion


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSection:
    """Corrections on top of the planned motion."""

    feedback: RelativeFeedbackParameters = field(default_factory=RelativeFeedbackParameters)  # above the pad


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A configuration file. Whatever it leaves out has the default that stands beside the code it tunes."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people: which vehicle, which purpose
    camera: CameraSection  # the downward camera
    vehicle: VehicleSection = field(default_factory=VehicleSection)  # the airframe
    link: LinkSection = field(default_factory=LinkSection)  # MAVLink to the autopilot
    perception: PerceptionSection = field(default_factory=PerceptionSection)  # what the camera sees
    estimation: EstimationSection = field(default_factory=EstimationSection)  # where the target is
    guidance: GuidanceParameters = field(default_factory=GuidanceParameters)  # what to do next
    planning: PlanParameters = field(default_factory=PlanParameters)  # how to get there
    control: ControlSection = field(default_factory=ControlSection)  # how to stay there
    guardian: GuardianParameters = field(default_factory=GuardianParameters)  # what is never allowed: fence, silence
    recording: RecordingSection = field(default_factory=RecordingSection)  # what is written down
