"""Parameters of the preflight checks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Interval

from companion.preflight.autopilot_parameters import WantedParameters
from companion.preflight.free_flyer_parameters import WantedFreeFlyerParameters
from companion.preflight.rover_parameters import WantedRoverParameters

Share = Annotated[float, Interval(ge=0.0, le=1.0)]
Grey = Annotated[float, Interval(ge=0.0, le=255.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLimits:
    """What `companion doctor` asks of the autopilot and the link to it."""

    listen_s: Annotated[float, Interval(ge=5.5, le=600.0)] = 6.0  # message rates need two periods of 2.5 s
    round_trip_most_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.05  # of TIMESYNC, median
    lost_most: Share = 0.02  # of the messages sent
    clock_rate_most: Annotated[float, Interval(ge=0.0, le=0.1)] = 0.01  # difference of the two clocks' rates
    version_least: tuple[int, int] = (1, 14)  # of PX4
    battery_least: Share = 0.3
    transmitter: bool = True  # a pilot's transmitter must be heard


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraLimits:
    """What it asks of the camera and its picture."""

    rate_least_hz: Annotated[float, Interval(gt=0.0, le=1000.0)] = 15.0
    gap_most_s: Annotated[float, Interval(gt=0.0, le=10.0)] = 0.25  # between two pictures
    mean_least: Grey = 25.0  # grey level
    mean_most: Grey = 230.0
    contrast_least: Grey = 5.0  # standard deviation of the grey levels
    clipped_most: Share = 0.3  # of the pixels, black or burnt out
    blur_most: Share = 0.6  # 0 sharp, 1 blurred; 0.55 is a hard edge smeared over 2 px (standard deviation)
    reprojection_most_px: Annotated[float, Interval(gt=0.0, le=100.0)] = 1.5  # of the pad's corners: calibration fits
    tilt_most_deg: Annotated[float, Interval(gt=0.0, le=45.0)] = 2.0  # of the mount against the autopilot's level


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingLimits:
    """What it asks of the ranging input, where there is one."""

    rate_least_hz: Annotated[float, Interval(gt=0.0, le=10000.0)] = 8.0  # of all anchors; a DWM1001 gives four at 10 Hz
    unusable_most: Share = 0.2  # of the ranges and messages
    anchors_least: Annotated[int, Interval(ge=1, le=8)] = 4  # heard, or all where the survey has fewer
    silence_most_s: Annotated[float, Interval(gt=0.0, le=60.0)] = 1.0  # since the last range


@dataclass(frozen=True, slots=True, kw_only=True)
class ComputerLimits:
    """What it asks of this computer."""

    disk_free_least_gb: Annotated[float, Interval(ge=0.0, le=100000.0)] = 5.0  # where recordings go
    load_most: Share = 0.8  # of the processors' time, while looking
    clock_step_most_s: Annotated[float, Interval(gt=0.0, le=10.0)] = 0.05  # of the wall clock against the steady one


@dataclass(frozen=True, slots=True, kw_only=True)
class PreflightParameters:
    """What must be in order before a flight."""

    autopilot: WantedParameters = field(default_factory=WantedParameters)  # before each arming too, else refused
    rover: WantedRoverParameters = field(default_factory=WantedRoverParameters)  # the same of a rover
    free_flyer: WantedFreeFlyerParameters = field(default_factory=WantedFreeFlyerParameters)  # the same of a free-flyer
    vehicle: VehicleLimits = field(default_factory=VehicleLimits)  # link, clock, estimator
    camera: CameraLimits = field(default_factory=CameraLimits)  # rate, exposure, sharpness, mount
    ranging: RangingLimits = field(default_factory=RangingLimits)  # rate, anchors heard
    computer: ComputerLimits = field(default_factory=ComputerLimits)  # disk, clock, load
