"""What the planner hands to the guardian in one step."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from companion.messages.motion import Trajectory
from companion.messages.news import MissionNews
from companion.messages.ownship import FlightMode
from companion.messages.target import TargetPose


class Order(Enum):
    """What the mission asks of the guardian's side. It is done only where the guardian's side allows it."""

    READ_PARAMETERS = "read the autopilot's parameters that preflight judges"
    ENGAGE = "engage the guardian"
    ARM = "arm"
    FINISH = "the mission is over: give the vehicle back, or, disarmed, leave OFFBOARD"


class Stage(Enum):
    """How far the mission is."""

    WAITING = "waiting for the vehicle"
    STANDBY = "waiting for the operator"
    RUNNING = "running"
    ENDED = "over"


# Modes to which the guardian may give the vehicle.
RECEIVERS = (FlightMode.AUTO_LOITER, FlightMode.AUTO_RTL, FlightMode.AUTO_LAND, FlightMode.AUTO_PRECLAND)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Handover:
    """One step of the planner."""

    t: float  # [s] of the step
    stage: Stage
    reason: str  # of the mission's state, in plain words
    trajectory: Trajectory | None = None  # to be followed until it expires
    target: TargetPose | None = None  # where the target is about now, for the closing speed
    orders: frozenset[Order] = frozenset()  # each is to be done once
    receiver: FlightMode = FlightMode.AUTO_LOITER  # of the vehicle, when it is given back; one of RECEIVERS
    news: MissionNews = field(default_factory=MissionNews)  # to be passed on
