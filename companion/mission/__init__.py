"""Missions: what a mission file may hold, reading and checking it, and what it means to the guidance."""

from companion.mission.checks import Envelope, check_envelope, check_vehicle
from companion.mission.load import load_mission, mission_from, mission_schema, named_file, named_world, open_mission
from companion.mission.plan import flight_plan
from companion.mission.schema import (
    AfterSearch,
    Follow,
    FollowUntil,
    Hold,
    Intercept,
    Land,
    Limits,
    Mission,
    OnTargetLost,
    Output,
    Search,
    Step,
    Surveyed,
    Takeoff,
    Transit,
)

__all__ = [
    "AfterSearch",
    "Envelope",
    "Follow",
    "FollowUntil",
    "Hold",
    "Intercept",
    "Land",
    "Limits",
    "Mission",
    "OnTargetLost",
    "Output",
    "Search",
    "Step",
    "Surveyed",
    "Takeoff",
    "Transit",
    "check_envelope",
    "check_vehicle",
    "flight_plan",
    "load_mission",
    "mission_from",
    "mission_schema",
    "named_file",
    "named_world",
    "open_mission",
]
