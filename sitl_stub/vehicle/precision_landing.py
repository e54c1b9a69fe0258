"""PX4's precision landing (navigator/precland.cpp), mode AUTO.PRECLAND: it always looks for the target ("required").

start → horizontal approach → descend above target → final approach, with search and fallback beside the way. Runs at
the navigator's 20 Hz; what it gives is flown by the navigator under the limits of all automatic modes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from sitl_stub.vehicle.estimator import Estimate

INTERVAL = 0.05
"""Between steps [s]."""
SETTLE_TIME = 2.0
"""Above the target, or at the start point without a target, for so long [s]."""
SEARCH_SETTLE_TIME = 1.0
"""At the height at which the search has found the target [s]."""
SEARCH_MARGIN = 1.0
"""How much farther the search climbs [m] once the target is seen, so as not to stop abruptly."""
NEAR_TIMEOUT = 0.5
"""Close to the ground a target older than this [s] is lost: the landing then ends without it."""
FALLBACK_WARNING = "Precland: switching to fallback"


class State(Enum):
    """PrecLandState."""

    START = "start"
    HORIZONTAL_APPROACH = "horizontal approach"
    DESCEND_ABOVE_TARGET = "descend"
    FINAL_APPROACH = "final approach"
    SEARCH = "search"
    FALLBACK = "fallback"
    DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class LandingTargetPose:
    """What LANDING_TARGET brought, as PX4 keeps it."""

    t: float
    """Time stamp [s], autopilot's time."""
    north: float
    east: float
    down: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """The position setpoint: where to fly, and whether to land there."""

    north: float
    east: float
    down: float
    """Height to hold [m, ned]; without meaning while landing."""
    land: bool


class PrecisionLanding:
    """State machine of one precision landing after the other. Its times are the autopilot's boot time [s]."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.state = State.START
        self.history: list[State] = []
        """States of this landing, in order."""
        self._pose: LandingTargetPose | None = None
        self._updated = False
        self._waypoint = Waypoint(north=0.0, east=0.0, down=0.0, land=False)
        self._searches = 0
        self._reached: float | None = None
        self._acquired: float | None = None
        self._entered = 0.0
        self._approach_down = 0.0
        self._slew: tuple[tuple[float, float], tuple[float, float], float] | None = None
        self._due = -math.inf

    def target_seen(self, pose: LandingTargetPose) -> None:
        """Take a landing target; one that comes before the mode counts at its first step."""
        self._pose = pose
        self._updated = True

    def begin(self, t: float, estimate: Estimate) -> None:
        """Enter the mode at `t` [s], where the vehicle is."""
        self._waypoint = Waypoint(north=estimate.north, east=estimate.east, down=estimate.down, land=False)
        self._searches = 0
        self._slew = None
        self._due = t
        self.history = []
        self._to_start(t)

    def waypoint(self, t: float, estimate: Estimate, *, landed: bool) -> Waypoint:
        """Give the position setpoint at `t` [s]."""
        if t + 1e-9 >= self._due:
            self._due = max(self._due + INTERVAL, t)
            self._step(t, estimate, landed)
        return self._waypoint

    def _step(self, t: float, estimate: Estimate, landed: bool) -> None:
        if landed and self.state is not State.DONE:
            self._enter(State.DONE, t)
        if self.state is State.START:
            self._run_start(t, estimate)
        elif self.state is State.HORIZONTAL_APPROACH:
            self._run_horizontal_approach(t, estimate)
        elif self.state is State.DESCEND_ABOVE_TARGET:
            self._run_descend(t, estimate)
        elif self.state is State.SEARCH:
            self._run_search(t, estimate)
        self._updated = False

    # what each state does

    def _run_start(self, t: float, estimate: Estimate) -> None:
        if self._to_horizontal_approach(t, estimate):
            return
        away = math.hypot(self._waypoint.north - estimate.north, self._waypoint.east - estimate.east)
        if away >= self._parameters["NAV_ACC_RAD"]:
            return
        if self._reached is None:
            self._reached = t
        if self._parameters["PLD_SRCH_TOUT"] <= 0.0:
            self._to_fallback(t, estimate)
        elif t - self._reached > SETTLE_TIME:
            self._to_search(t)

    def _run_horizontal_approach(self, t: float, estimate: Estimate) -> None:
        pose = self._pose
        if pose is None or not self._keeps_approaching(t, estimate):
            self._lost(t, estimate)
            return
        if self._updated and self._above(pose, estimate):
            if self._reached is None:
                self._reached = t
            if t - self._reached > SETTLE_TIME:
                self._enter(State.DESCEND_ABOVE_TARGET, t)
                return
        north, east = self._slewed(pose.north, pose.east, t, estimate)
        self._waypoint = Waypoint(north=north, east=east, down=self._approach_down, land=False)

    def _run_descend(self, t: float, estimate: Estimate) -> None:
        pose, final = self._pose, self._near_ground(t, estimate)
        usable = pose is not None and t - pose.t < NEAR_TIMEOUT if final else self._valid(t)
        if pose is not None and usable:
            self._waypoint = Waypoint(north=pose.north, east=pose.east, down=self._approach_down, land=True)
        elif final:
            self._enter(State.FINAL_APPROACH, t)
        else:
            self._lost(t, estimate)

    def _run_search(self, t: float, estimate: Estimate) -> None:
        if self._acquired is None and self._updated and self._valid(t):
            self._acquired = t
            down = max(estimate.down - SEARCH_MARGIN, self._waypoint.down)
            self._waypoint = Waypoint(north=self._waypoint.north, east=self._waypoint.east, down=down, land=False)
        settled = self._acquired is not None and t - self._acquired > SEARCH_SETTLE_TIME
        if settled and self._to_horizontal_approach(t, estimate):
            return
        if t - self._entered > self._parameters["PLD_SRCH_TOUT"]:
            self._to_fallback(t, estimate)

    # changes of state

    def _enter(self, state: State, t: float) -> None:
        self.state, self._entered = state, t
        self.history.append(state)

    def _to_start(self, t: float) -> bool:
        if self._searches > self._parameters["PLD_MAX_SRCH"]:
            return False
        self._searches += 1
        self._reached = None
        self._enter(State.START, t)
        return True

    def _to_horizontal_approach(self, t: float, estimate: Estimate) -> bool:
        if not (self._updated and self._valid(t)):
            return False
        self._approach_down = estimate.down
        self._reached = None
        self._enter(State.HORIZONTAL_APPROACH, t)
        return True

    def _to_search(self, t: float) -> None:
        down = -self._parameters["PLD_SRCH_ALT"]
        self._waypoint = Waypoint(north=self._waypoint.north, east=self._waypoint.east, down=down, land=False)
        self._acquired = None
        self._enter(State.SEARCH, t)

    def _to_fallback(self, t: float, estimate: Estimate) -> None:
        self._waypoint = Waypoint(north=estimate.north, east=estimate.east, down=estimate.down, land=True)
        self._enter(State.FALLBACK, t)

    def _lost(self, t: float, estimate: Estimate) -> None:
        """Stay here and look again; after too many times, land here."""
        self._waypoint = Waypoint(north=estimate.north, east=estimate.east, down=estimate.down, land=False)
        if not self._to_start(t):
            self._to_fallback(t, estimate)

    # conditions

    def _valid(self, t: float) -> bool:
        """Whether the target was seen within PLD_BTOUT; a stamp from the future counts as endlessly old (unsigned)."""
        return self._pose is not None and 0.0 <= t - self._pose.t <= self._parameters["PLD_BTOUT"]

    def _above(self, pose: LandingTargetPose, estimate: Estimate) -> bool:
        radius = self._parameters["PLD_HACC_RAD"]
        return abs(pose.north - estimate.north) < radius and abs(pose.east - estimate.east) < radius

    def _keeps_approaching(self, t: float, estimate: Estimate) -> bool:
        """On the way the last place is enough; having arrived there the target must be seen."""
        return self._pose is not None and (self._valid(t) or not self._above(self._pose, estimate))

    def _near_ground(self, t: float, estimate: Estimate) -> bool:
        pose = self._pose
        return pose is not None and self._valid(t) and pose.down - estimate.down < self._parameters["PLD_FAPPR_ALT"]

    def _slewed(self, north: float, east: float, t: float, estimate: Estimate) -> tuple[float, float]:
        """Move the setpoint under limits of speed and acceleration (PrecLand::slewrate)."""
        if self._slew is None:
            dt = INTERVAL
            here = (self._waypoint.north, self._waypoint.east)
            before = (here[0] - estimate.v_north * dt, here[1] - estimate.v_east * dt)
        else:
            here, before, last = self._slew
            dt = t - last
            if dt < 1e-6:
                return north, east
        acceleration = self._parameters["MPC_ACC_HOR"]
        goal = _within((north, east), here, self._parameters["MPC_XY_CRUISE"] * dt)
        ahead = (2.0 * here[0] - before[0], 2.0 * here[1] - before[1])
        goal = _within(goal, ahead, acceleration * dt * dt)
        away = math.hypot(here[0] - north, here[1] - east)
        goal = _within(goal, here, math.sqrt(acceleration * away) * dt)
        self._slew = (goal, here, t)
        return goal


def _within(point: tuple[float, float], centre: tuple[float, float], radius: float) -> tuple[float, float]:
    """Give the point nearest to `point` on the disc around `centre`."""
    x, y = point[0] - centre[0], point[1] - centre[1]
    distance = math.hypot(x, y)
    if distance <= radius:
        return point
    return centre[0] + x / distance * radius, centre[1] + y / distance * radius
