"""How a rover's plans are made and driven."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Interval

from companion.estimation.target_rest import TargetRestParameters
from companion.estimation.target_speed import TargetSpeedParameters
from companion.planning.coupled.model import CameraView, CostWeights
from companion.planning.coupled.plan import CoupledParameters
from companion.planning.run_up import RunUpParameters
from companion.planning.shortest.meeting import MeetingParameters
from companion.planning.stopping import StoppingParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivingSection:
    """From the goal to the trajectory; the drive train itself stands with the vehicle."""

    # the sequence of convex programs
    planner: CoupledParameters = field(
        default_factory=lambda: CoupledParameters(
            weights=CostWeights(view=10.0, clearance=40.0, clearance_m=1.3, reverse=0.3),
            view=CameraView(forward=0.38),
            correction_tolerance=0.15,
            restart_growth=3.0,
        )
    )
    # the same beside a target that drives: at each instant near the place and turned right, in the measure in which a
    # vehicle that goes where it points can be both; speeds are compared with the target's
    station: CostWeights = field(
        default_factory=lambda: CostWeights(
            speed=0.5,
            yaw_rate=0.1,
            stage_position=1.0,
            stage_heading=2.3,
            final_position=1.0,
            final_heading=2.3,
            reverse=0.0,
            view=10.0,
            clearance=40.0,
            clearance_m=1.3,
        )
    )
    # [1 / (m/s)^2] beside that, of the speed across its heading that the rover has relative to such a target
    station_drift: Annotated[float, Interval(ge=0.0, le=100.0)] = 1.6
    station_m: Annotated[float, Interval(gt=0.0, le=20.0)] = 1.2  # no farther from the place
    station_faster_mps: Annotated[float, Interval(gt=0.0, le=20.0)] = 0.4  # than the target at most
    # [m/s] at most beside a target that stands, as near to the place as that
    correction_mps: Annotated[float, Interval(gt=0.0, le=20.0)] = 0.45
    station_near_m: Annotated[float, Interval(gt=0.0, le=20.0)] = (
        1.05  # farther from the target than this it only drives forward
    )
    # out of sight for so long [s], the target's bearing counts so many times as much: a detour to see it is worth it
    unseen_s: Annotated[float, Interval(gt=0.0, le=60.0)] = 0.3
    unseen_view: Annotated[float, Interval(ge=1.0, le=1000.0)] = 10.0
    step_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.2  # of the planner; times its horizon: how far it looks
    replan_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.1  # between plans
    # for one plan, in flight: then the best so far is driven. Simulations have no clock: same seed, same drive
    deadline_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.05
    expiry_s: Annotated[float, Interval(gt=0.1, le=2.0)] = 0.5  # a plan not renewed by then is dropped by the guardian
    lead_s: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.15  # a command takes this long to move the rover
    # [m/s] between what is asked and what is measured, above which a plan begins with what is measured
    reference_leash_mps: Annotated[float, Interval(gt=0.0, le=5.0)] = 0.5
    bias_bandwidth: Annotated[float, Interval(gt=0.0, le=20.0)] = 4.0  # [rad/s] of the speed relative to the target
    relative_max_mps: Annotated[float, Interval(ge=0.0, le=20.0)] = (
        4.0  # what that observer believes at most, the target's own speed in it
    )
    meeting: MeetingParameters = field(default_factory=MeetingParameters)  # where a place that moves is met
    # that it can stop behind a target that brakes
    stopping: StoppingParameters = field(default_factory=StoppingParameters)
    target_rest: TargetRestParameters = field(default_factory=TargetRestParameters)  # when the target stands
    target_speed: TargetSpeedParameters = field(default_factory=TargetSpeedParameters)  # how fast a slow one drives
    run_up: RunUpParameters = field(default_factory=RunUpParameters)  # the last centimetres beside one that stands
    standing_mps: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.05  # slower, beside a target that stands, it stands,
    start_s: Annotated[float, Interval(gt=0.0, le=10.0)] = 1.5  # and its plan waits at most so long for it to set off
    # Plans that stand still for so long,
    stuck_s: Annotated[float, Interval(gt=0.0, le=60.0)] = 0.6
    stuck_m: Annotated[float, Interval(gt=0.0, le=10.0)] = 0.12  # farther than this from the place, or
    stuck_rad: Annotated[float, Interval(gt=0.0, le=3.0)] = 0.15  # turned farther away,
    stuck_mps: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.12  # with no speed above this
    stuck_steps: Annotated[int, Interval(ge=1, le=200)] = 12  # in so many steps, begin again from scratch
