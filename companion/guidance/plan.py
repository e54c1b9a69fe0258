"""What the mission asks of the guidance."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class FollowUntil(Enum):
    """What ends station-keeping."""

    TARGET_STOPPED = "target_stopped"
    TIME = "time"


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchPlan:
    """Where and how long to look for the target."""

    height_m: float = 4.0  # above the take-off point
    radius_m: float = 10.0  # of the spiral around the place where the target is expected
    timeout_s: float = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowPlan:
    """Station-keeping above the target."""

    height_m: float = 3.0  # feet above the pad
    until: FollowUntil = FollowUntil.TARGET_STOPPED
    for_s: float = 0.0  # with TIME: how long; with TARGET_STOPPED: at least this long
    at_most_s: float = 180.0
    match_heading: bool = True


class SwitchingPolicy(Enum):
    """What decides when to leave the way there for a place above the pad, and whether to settle there."""

    FIXED = "fixed"  # distances
    MARKOV = "markov"  # Parikh et al., Algorithm 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TransitPlan:
    """Flying to where the pad was surveyed, before it is seen."""

    height_m: float = 4.0  # above the take-off point: never lower before the pad is seen
    by_ranges: bool = True  # ranges are expected; otherwise odometry alone


@dataclass(frozen=True, slots=True, kw_only=True)
class LandPlan:
    """Landing on the target."""

    policy: SwitchingPolicy = SwitchingPolicy.MARKOV
    deviate_at_m: float = 3.0  # horizontal distance at which a fixed policy leaves the way there

    max_attempts: int = 3
    by_autopilot: bool = False  # by the autopilot's precision landing, which is told where the pad is


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundPlan:
    """Meeting a target, or following it, on the ground."""

    standoff_m: float = 1.25  # of the vehicle's origin behind the target's reference point
    until: FollowUntil = FollowUntil.TARGET_STOPPED
    for_s: float = 0.0  # on station: with TIME how long; with TARGET_STOPPED at least this long
    at_most_s: float = 180.0
    keeps_station: bool = False  # to follow is the purpose, not only to meet


@dataclass(frozen=True, slots=True, kw_only=True)
class LostPlan:
    """What to do when the target is out of sight."""

    coast_s: float = 4.0  # fly on by the prediction
    hold_s: float = 5.0  # then stand still
    search_s: float = 60.0  # then search around the place where it should be
    no_camera_s: float = 60.0  # without any camera frames: stand still instead of all that
    then_return: bool = False  # and at last fly home, by the autopilot's Return; else its Hold


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """The whole mission as the guidance sees it."""

    takeoff_height_m: float = 4.0
    transit: TransitPlan | None = None  # None: the pad is near enough to be found by the search
    search: SearchPlan = field(default_factory=SearchPlan)
    follow: FollowPlan | None = None
    land: LandPlan | None = field(default_factory=LandPlan)
    ground: GroundPlan | None = None  # for a vehicle on the ground: what is done, instead of take-off, follow and land
    hold_s: float = 0.0  # with nothing to land on: stand still this long at the end
    lost: LostPlan = field(default_factory=LostPlan)
