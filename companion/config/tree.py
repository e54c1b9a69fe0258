"""The one configuration: every package's parameters in a single frozen tree."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Interval, Len

from companion.config.driving import DrivingSection
from companion.config.floating import FloatingSection
from companion.config.sections import (
    CameraSection,
    EngagementSection,
    LinkSection,
    OperatorSection,
    RecordingSection,
    VehicleSection,
)
from companion.control.motion_observer import MotionObserverParameters
from companion.control.relative_feedback import RelativeFeedbackParameters
from companion.estimation.coarse_pad import CoarsePadParameters
from companion.estimation.ground_odometry import GroundOdometryParameters
from companion.estimation.measurement import MeasurementParameters
from companion.estimation.ownship import OwnshipHistoryParameters
from companion.estimation.pad_slope import PadSlopeParameters
from companion.estimation.target_model import TargetEstimatorParameters
from companion.guardian.parameters import GuardianParameters
from companion.guidance.parameters import GuidanceParameters
from companion.perception.pad_detector import PerceptionParameters
from companion.planning.minimum_snap import PlanParameters
from companion.prediction.parameters import PredictorParameters
from companion.preflight.parameters import PreflightParameters
from companion.ranging.parameters import RangingParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationSection:
    """The target's estimate, relative to the vehicle."""

    target: TargetEstimatorParameters = field(default_factory=TargetEstimatorParameters)  # the filter
    measurement: MeasurementParameters = field(default_factory=MeasurementParameters)  # from pose to measurement
    pad_slope: PadSlopeParameters = field(default_factory=PadSlopeParameters)  # how the pad lies: for setting down
    ownship: OwnshipHistoryParameters = field(default_factory=OwnshipHistoryParameters)  # history of our own motion
    coarse: CoarsePadParameters = field(default_factory=CoarsePadParameters)  # where the pad is before it is seen
    ground: GroundOdometryParameters = field(default_factory=GroundOdometryParameters)  # a rover's motion over ground


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSection:
    """How plans are flown, and the corrections on top."""

    replan_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.1  # between plans
    expiry_s: Annotated[float, Interval(gt=0.1, le=2.0)] = 0.5  # a plan not renewed by then is dropped by the guardian
    touchdown_levelling: Annotated[float, Interval(ge=0.0, le=3.0)] = 1.0  # of the tilt, taken out at touchdown
    lean_smoothing_s: Annotated[float, Interval(gt=0.0, le=5.0)] = 0.5  # of the lean that the touchdown allows for
    station_m: Annotated[float, Interval(gt=0.0, le=2.0)] = (
        0.4  # nearer than this the feedback is against the goal itself
    )
    station_heading_rad: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.15  # likewise for the heading
    reference_leash_m: Annotated[float, Interval(gt=0.0, le=5.0)] = 1.0  # a reference farther away is given up

    # of velocity bias and disturbance, against the autopilot's position
    observer: MotionObserverParameters = field(default_factory=MotionObserverParameters)
    # the same against the position relative to the target: its bias holds the target's whole velocity
    relative_observer: MotionObserverParameters = field(
        default_factory=lambda: MotionObserverParameters(bandwidth=10.0, bias_max=20.0)
    )
    feedback: RelativeFeedbackParameters = field(default_factory=RelativeFeedbackParameters)  # above the pad


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A configuration file. Whatever it leaves out has the default that stands beside the code it tunes."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people: which vehicle, which purpose
    camera: CameraSection  # the camera
    ranging: RangingParameters = field(default_factory=RangingParameters)  # ranges to anchors
    vehicle: VehicleSection = field(default_factory=VehicleSection)  # the airframe
    link: LinkSection = field(default_factory=LinkSection)  # MAVLink to the autopilot
    perception: PerceptionParameters = field(default_factory=PerceptionParameters)  # what the camera sees
    estimation: EstimationSection = field(default_factory=EstimationSection)  # where the target is
    prediction: PredictorParameters = field(default_factory=PredictorParameters)  # where the target will be
    guidance: GuidanceParameters = field(default_factory=GuidanceParameters)  # what to do next
    planning: PlanParameters = field(default_factory=PlanParameters)  # how to get there
    control: ControlSection = field(default_factory=ControlSection)  # how to stay there
    driving: DrivingSection = field(default_factory=DrivingSection)  # both, for a rover
    floating: FloatingSection = field(default_factory=FloatingSection)  # how to get there, for a free-flyer
    guardian: GuardianParameters = field(default_factory=GuardianParameters)  # what is never allowed: fence, silence
    preflight: PreflightParameters = field(default_factory=PreflightParameters)  # what must be in order before it
    engagement: EngagementSection = field(default_factory=EngagementSection)  # from heartbeat to take-off
    operator: OperatorSection = field(default_factory=OperatorSection)  # `companion ctl`
    recording: RecordingSection = field(default_factory=RecordingSection)  # what is written down
