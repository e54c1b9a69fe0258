"""What the pipeline takes in and gives out in one step, and what it needs from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from companion.geometry.transform import RigidTransform
from companion.guardian.handover import Stage
from companion.messages.decision import Mode
from companion.messages.perception import CameraFrame, PadObservation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inbox:
    """What arrived since the last step."""

    datagrams: Sequence[tuple[float, bytes]] = ()  # from the autopilot with their time of arrival [s], oldest first
    observations: Sequence[PadObservation] = ()  # answers to detection requests
    ranges: Sequence[tuple[float, bytes]] = ()  # from the ranging radio with their time of arrival [s], oldest first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outbox:
    """What is to be sent."""

    datagrams: Sequence[bytes] = ()  # to the autopilot
    ground: Sequence[bytes] = ()  # to the ground station's own address, where there is one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionRequest:
    """A frame to be searched for the pad: slow work, done outside the step."""

    frame: CameraFrame
    predicted: RigidTransform | None  # cam_from_pad expected at capture; None: search the whole frame


class MissionState(Enum):
    """How the mission stands."""

    WAITING = "waiting"  # for the vehicle
    STANDBY = "standby"  # for the operator, at the beginning or after somebody has taken the vehicle
    RUNNING = "running"
    LANDED = "landed"
    HELD = "held"  # reached its end in the air, as the mission asked
    ABORTED = "aborted"
    REFUSED = "refused"  # the autopilot would not arm or fly
    WRONG_VEHICLE = "wrong vehicle"  # one that this program does not fly
    NO_VEHICLE = "no vehicle"  # no heartbeat within the time
    LOST = "lost"  # the heartbeat stopped during the mission


_STAGES = {
    MissionState.WAITING: Stage.WAITING,
    MissionState.STANDBY: Stage.STANDBY,
    MissionState.RUNNING: Stage.RUNNING,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStatus:
    """The mission's state, for progress displays and the end of the run."""

    state: MissionState
    mode: Mode
    reason: str  # of the last change, in plain words
    t: float  # [s] of the last change

    @property
    def stage(self) -> Stage:
        """How far it is."""
        return _STAGES.get(self.state, Stage.ENDED)

    @property
    def ended(self) -> bool:
        """Whether nothing more will be flown."""
        return self.stage is Stage.ENDED

    @property
    def vehicle_missing(self) -> bool:
        """Whether it ended because there was no vehicle, the wrong one, or one that was lost."""
        return self.state in (MissionState.WRONG_VEHICLE, MissionState.NO_VEHICLE, MissionState.LOST)
