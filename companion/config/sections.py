"""The sections of a configuration that belong to no algorithm: the vehicle, its link, its camera, the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Interval, MinLen

from companion.geometry.rotations import rotation_from_euler
from companion.geometry.transform import RigidTransform
from companion.link.parameters import LinkParameters
from companion.vehicles.free_flyer import FreeFlyerParameters
from companion.vehicles.multicopter import MulticopterParameters
from companion.vehicles.rover import RoverParameters

Degrees = Annotated[float, Interval(ge=-180.0, le=180.0)]
Positive = Annotated[float, Interval(gt=0.0, le=3600.0)]
Offset = Annotated[float, Interval(ge=-10.0, le=10.0)]

# A camera that looks straight down with the top of its picture towards the nose (docs/frames-and-units.md).
_FRD_FROM_DOWNWARD = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


class VehicleType(Enum):
    """Kinds of vehicle that can be flown."""

    MULTICOPTER = "multicopter"
    ROVER = "rover"
    FREE_FLYER = "free_flyer"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSection:
    """The vehicle."""

    type: VehicleType = VehicleType.MULTICOPTER  # an autopilot that reports another type is refused
    # of a multicopter: limits and size
    multicopter: MulticopterParameters = field(default_factory=MulticopterParameters)
    rover: RoverParameters = field(default_factory=RoverParameters)  # of a rover: limits, size and drive train
    # of a planar free-flyer: limits, size and control
    free_flyer: FreeFlyerParameters = field(default_factory=FreeFlyerParameters)


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningSection:
    """MAVLink 2 signing, by a key that the autopilot has too."""

    key_file: Path | None = None  # 32 bytes or 64 hexadecimal digits; counts from this file's folder; none: no signing
    link_id: Annotated[int, Interval(ge=0, le=255)] = 1  # of the companion's link


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSection:
    """MAVLink to the autopilot."""

    url: Annotated[str, MinLen(1)] = "udp://127.0.0.1:14540"  # udp:// (to listen on), tcp://, serial://
    # udp://address:port of a ground station that the autopilot does not forward to; it is only sent to
    ground_station: Annotated[str, MinLen(1)] | None = None
    mavlink: LinkParameters = field(default_factory=LinkParameters)  # ids, rates, patience
    signing: SigningSection = field(default_factory=SigningSection)  # what comes without the right key is not heard


@dataclass(frozen=True, slots=True, kw_only=True)
class MountSection:
    """Where the camera sits, and how it is turned from looking straight down with the picture's top to the nose."""

    # optical centre: forward, right, down of the body origin
    position_frd_m: tuple[Offset, Offset, Offset] = (0.0, 0.0, 0.0)
    roll_deg: Degrees = 0.0  # then turned about the body's x axis
    pitch_deg: Degrees = 0.0  # about y: positive looks further forward
    yaw_deg: Degrees = 0.0  # about z: positive turns the picture's top to the right

    @property
    def frd_from_cam(self) -> RigidTransform:
        """The camera's place on the vehicle."""
        turn = rotation_from_euler(
            math.radians(self.roll_deg), math.radians(self.pitch_deg), math.radians(self.yaw_deg)
        )
        return RigidTransform(rotation=turn @ _FRD_FROM_DOWNWARD, translation=np.array(self.position_frd_m))


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSection:
    """The camera: downward on a multicopter, ahead on a vehicle that stays on the ground."""

    source: Annotated[str, MinLen(1)]  # URL, device such as /dev/video0, or file of a video
    calibration: Path  # OpenCV or ROS calibration file; counts from this file's folder
    latency_s: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0  # from the middle of the exposure to the arrival
    mount: MountSection = field(default_factory=MountSection)  # where it sits


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSection:
    """What is written down of each flight."""

    directory: Path = Path("recordings")  # counts from the current directory
    frames: bool = True  # camera pictures too; about 10 MB for each second at 640x480 and 30 Hz, uncompressed


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSection:
    """How the operator reaches a flight: `companion ctl`."""

    socket: Path = Path("/tmp/companion.sock")  # a Unix socket that the program makes, for its own user only


@dataclass(frozen=True, slots=True, kw_only=True)
class EngagementSection:
    """From the start of the program to the take-off."""

    vehicle_timeout_s: Positive = 10.0  # the first heartbeat must have come by then
    ready_s: Positive = 1.0  # telemetry must have been good for this long before the guardian engages
    ready_timeout_s: Positive = 60.0  # the autopilot's estimate must be valid this long after its first heartbeat
    offboard_timeout_s: Positive = 10.0  # the autopilot must be in OFFBOARD by then
    arm_tries: Annotated[int, Interval(ge=1, le=10)] = 3
    arm_interval_s: Positive = 2.0  # between tries
