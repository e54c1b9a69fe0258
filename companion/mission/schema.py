"""What a mission file may hold. Units stand in the key names; the comment beside a key is what editors show."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Interval, Len, MinLen

from companion.documents import Example

Height = Annotated[float, Interval(gt=0.0, le=120.0)]
Duration = Annotated[float, Interval(ge=0.0, le=3600.0)]
Positive = Annotated[float, Gt(0.0)]


Metres = Annotated[float, Interval(ge=-1000.0, le=1000.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Surveyed:
    """Where the pad was surveyed, seen from where the vehicle stands before the take-off, and how well."""

    north_m: Metres  # of the body origin of the standing vehicle
    east_m: Metres
    down_m: Metres = 0.0  # of the landing point below the ground on which the vehicle stands; negative: above it
    heading_deg: Annotated[float, Interval(ge=-360.0, le=360.0)]  # of the pad, from north
    # standard deviation of each coordinate: 0.5 m is a measuring tape, or GNSS averaged for a minute
    position_std_m: Annotated[float, Interval(gt=0.0, le=10.0)] = 0.5
    heading_std_deg: Annotated[float, Interval(gt=0.0, le=60.0)] = 10.0  # a hand-held compass


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What to land on."""

    pad: Annotated[
        Path, Example("../config/pads/landing_pad_0p8.yaml")
    ]  # file that describes the pad's tags; counts from the mission's folder
    surveyed: Surveyed | None = None  # where it stands, for a pad that cannot be seen from the start: step transit


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """Only for `companion sim`; `companion fly` ignores it."""

    world: Annotated[str, MinLen(1)] = "static_pad"  # name of a built-in world, or the path of a world file
    # mean wind instead of the world's own, turbulence and gusts in proportion; 0: calm; left out: the world's own
    wind_mps: Annotated[float, Interval(ge=0.0, le=20.0)] | None = None
    # length of the camera's dropouts, in a world that has them, instead of its own; 0: none; left out: the world's own
    dropout_s: Annotated[float, Interval(ge=0.0, le=60.0)] | None = None
    # time between two pictures at least; 0: as fast as the camera is; left out: the world's own
    interval_s: Annotated[float, Interval(ge=0.0, le=10.0)] | None = None
    # share of the pictures in which the target is somewhere else; left out: the world's own
    corrupted_fraction: Annotated[float, Interval(ge=0.0, le=1.0)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of this mission: they can only tighten those of the configuration. What is left out is as configured."""

    speed_mps: Positive | None = None  # horizontal speed over the ground
    speed_up_mps: Positive | None = None  # climb speed
    speed_down_mps: Annotated[float, Ge(0.28)] | None = None  # descent speed; slower PX4 never says "landed"
    acceleration_mps2: Positive | None = None  # horizontal acceleration
    closing_speed_mps: Positive | None = None  # speed towards the target, relative to it
    height_m: Positive | None = None  # above the take-off point
    radius_m: Positive | None = None  # horizontal distance from the take-off point


class Output(Enum):
    """Who flies the landing."""

    OFFBOARD = "offboard"
    LANDING_TARGET = "landing_target"


class AfterSearch(Enum):
    """What to do when the lost target is not found again."""

    HOLD = "hold"
    RETURN = "return"


@dataclass(frozen=True, slots=True, kw_only=True)
class OnTargetLost:
    """What to do, one after the other, when the target is out of sight."""

    coast_s: Annotated[float, Interval(ge=0.0, le=30.0)] = 4.0  # fly on by the prediction for this long
    hold_s: Duration = 5.0  # then stand still for this long
    search_s: Duration = 60.0  # then search around the place where it should be for this long
    no_camera_s: Duration = 60.0  # without any camera frames searching is pointless: stand still for this long instead
    then: AfterSearch = AfterSearch.HOLD  # at last: hold (stand still) or return (fly home and land), by the autopilot


@dataclass(frozen=True, slots=True, kw_only=True)
class Takeoff:
    """Arm and climb."""

    height_m: Height = 4.0  # above the take-off point


class Coarse(Enum):
    """What the vehicle goes by while the pad cannot be seen."""

    RANGES = "ranges"  # ultra-wideband ranges to anchors around the pad
    ODOMETRY = "odometry"  # the autopilot's own estimate alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Transit:
    """Fly to where the pad was surveyed (target.surveyed), until the policy leaves the way for a place above it."""

    by: Coarse = Coarse.RANGES  # ranges (needs `ranging` in the configuration) or odometry
    height_m: Height = 4.0  # above the take-off point: never lower before the pad is seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Fly a spiral until the target is seen; on the ground it stands and looks."""

    height_m: Height = 4.0  # above the take-off point
    radius_m: Annotated[float, Interval(gt=0.0, le=500.0)] = 10.0  # of the spiral
    timeout_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 120.0  # not found by then: the mission ends


class FollowUntil(Enum):
    """What ends the following."""

    TARGET_STOPPED = "target_stopped"
    TIME = "time"


Standoff = Annotated[float, Interval(ge=0.0, le=20.0)]  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Intercept:
    """Go to a place behind the target, at its heading, and stop there when it has stopped; a step on the ground."""

    standoff_m: Standoff = 1.25  # of the body origin behind the target's reference point
    at_most_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 180.0  # behind it, then go on, whatever the target does


@dataclass(frozen=True, slots=True, kw_only=True)
class Follow:
    """Keep station: above the target in the air, behind it on the ground."""

    height_m: Height | None = None  # in the air: feet above the pad; left out: 3 m
    standoff_m: Standoff | None = None  # on the ground: behind the target's reference point; says that it is there
    until: FollowUntil | None = None  # target_stopped or time; left out: time where for_s is given, else target_stopped
    for_s: Duration = 0.0  # with time: how long; with target_stopped: at least this long
    at_most_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 180.0  # then go on, whatever the target does
    match_heading: bool = True  # turn with the pad

    @property
    def ends(self) -> FollowUntil:
        """What ends the following, `until` resolved."""
        if self.until is not None:
            return self.until
        return FollowUntil.TIME if self.for_s > 0.0 else FollowUntil.TARGET_STOPPED


class Policy(Enum):
    """What decides when to switch."""

    FIXED = "fixed"
    MARKOV = "markov"
    OPTIMAL = "optimal"


@dataclass(frozen=True, slots=True, kw_only=True)
class Land:
    """Align above the pad, descend inside a cone, touch down, disarm."""

    # how the modes are switched (docs/components/guidance.md): fixed (distances), markov (Parikh et al., Algorithm 1);
    # optimal is known for dockings only
    policy: Policy = Policy.MARKOV
    # with fixed: horizontal distance at which the way there is left for the place above the pad; left out: 3 m
    deviate_at_m: Annotated[float, Interval(ge=0.5, le=20.0)] | None = None
    max_attempts: Annotated[int, Interval(ge=1, le=20)] = 3  # descents begun before the mission is given up
    # Descent while high; slower than 0.28 m/s PX4 never says "landed". Left out: as configured.
    descent_mps: Annotated[float, Interval(ge=0.28, le=2.0)] | None = None
    cone_half_angle_deg: Annotated[float, Interval(ge=2.0, le=60.0)] | None = None  # left out: as configured


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """Stand still, then end the mission where the vehicle is, with the autopilot in Hold."""

    for_s: Annotated[float, Ge(0.0)] = 10.0  # how long


Step = Takeoff | Transit | Search | Intercept | Follow | Land | Hold


@dataclass(frozen=True, slots=True, kw_only=True)
class StepEntry:
    """One step: exactly one of these keys."""

    takeoff: Takeoff | None = None  # arm and climb
    transit: Transit | None = None  # fly to where the pad was surveyed, until it is seen
    search: Search | None = None  # fly a spiral until the target is seen; on the ground it stands and looks
    intercept: Intercept | None = None  # drive to a place behind the target and stop there
    follow: Follow | None = None  # keep station above the target, or behind it
    land: Land | None = None  # land on the target
    hold: Hold | None = None  # stand still and end there

    @property
    def step(self) -> Step:
        """The step itself."""
        for step in (
            self.takeoff,
            self.transit,
            self.search,
            self.intercept,
            self.follow,
            self.land,
            self.hold,
        ):
            if step is not None:
                return step
        raise ValueError("a step needs one of the keys takeoff, transit, search, intercept, follow, land, hold")


STEP_TYPES: dict[str, type[Step]] = {
    "takeoff": Takeoff,
    "transit": Transit,
    "search": Search,
    "intercept": Intercept,
    "follow": Follow,
    "land": Land,
    "hold": Hold,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionDocument:
    """A mission file, as written."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80), Example("land on the pad")]  # for people: shown in the results
    config: Annotated[
        Path, Example("../config/x500_sim.yaml")
    ]  # the vehicle's configuration; counts from the mission's folder
    target: Target  # what to land on
    # what to do, in this order
    steps: Annotated[tuple[StepEntry, ...], MinLen(1), Example("[takeoff, search, land]")]
    # offboard: the companion flies the landing; landing_target: the autopilot does, told where the pad is
    output: Output = Output.OFFBOARD
    simulation: Simulation = field(default_factory=Simulation)  # only for `companion sim`
    limits: Limits = field(default_factory=Limits)  # tighter limits for this mission
    on_target_lost: OnTargetLost = field(default_factory=OnTargetLost)  # what to do when the target is out of sight


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """A checked mission: paths resolved, steps in order."""

    source: str  # the file, as the user named it
    name: str
    config: Path  # the configuration
    pad: Annotated[Path, Example("../config/pads/landing_pad_0p8.yaml")]  # the pad
    world: str  # of the simulation: a built-in name, or a path
    wind_mps: float | None  # [m/s] mean wind of the simulation; None: the world's own
    dropout_s: float | None  # [s] length of the simulated camera's dropouts; None: the world's own
    interval_s: float | None  # [s] between two simulated pictures at least; None: the world's own
    corrupted_fraction: (
        float | None
    )  # share of simulated pictures that show the target elsewhere; None: the world's own
    limits: Limits
    on_target_lost: OnTargetLost
    output: Output
    steps: tuple[Step, ...]
    surveyed: Surveyed | None = None  # where the pad stands

    @property
    def transit(self) -> Transit | None:
        """The way to a pad that cannot be seen from the start."""
        return next((step for step in self.steps if isinstance(step, Transit)), None)

    @property
    def on_ground(self) -> bool:
        """Whether it is a mission for a vehicle that stays on the ground."""
        return is_ground_mission(self.steps)


def is_ground_mission(steps: tuple[Step, ...]) -> bool:
    """Say whether steps are those of a vehicle on the ground: they intercept, or follow at a standoff."""
    return any(
        isinstance(step, Intercept) or (isinstance(step, Follow) and step.standoff_m is not None) for step in steps
    )
