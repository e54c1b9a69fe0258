"""Setpoints of the autopilot's own modes: Hold, Return, Land, Precision landing, Take-off and flying by sticks."""

import math
from collections.abc import Mapping

from sitl_stub.truth import Vector
from sitl_stub.vehicle import notices
from sitl_stub.vehicle.auto_motion import AutoMotion, stopping_point
from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.modes import NEEDS_STICKS, Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.position_control import NAN, TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import PrecisionLanding
from sitl_stub.vehicle.smooth_motion import SmoothMotion, speed_towards
from sitl_stub.vehicle.sticks import Sticks

LOOK_INTERVAL = 0.05
"""How often the navigator looks whether a leg of Return is flown [s]; it goes on by one leg at a time."""
ARRIVED = 0.5
"""Height [m] around its goal at which a take-off counts as done."""
STOPPED = 0.05
"""Speed [m/s] of the smoothed setpoint below which braking is over."""
SEA_LEVEL = 489.4
"""Altitude of home above sea level [m]."""
LAND_SLOW_HEIGHT, LAND_CRAWL_HEIGHT, LAND_FAST_HEIGHT = 5.0, 1.0, 10.0


def return_height(away: float, parameters: Mapping[str, float]) -> float:
    """Height above home [m] of a return from `away` [m]: lower within RTL_MIN_DIST (RTL::computeReturnAltitude)."""
    highest, arrival = parameters["RTL_RETURN_ALT"], parameters["NAV_ACC_RAD"]
    if parameters["RTL_CONE_ANG"] <= 0.0:
        return highest
    if away <= arrival:
        return min(highest, 2.0 * away)
    if away > parameters["RTL_MIN_DIST"]:
        return highest
    cone = away / math.tan(math.radians(max(1.0, min(89.0, parameters["RTL_CONE_ANG"]))))
    return min(highest, max(cone, 2.0 * arrival))


class Navigator:
    """Makes the trajectory setpoint of the mode in force. Home is the origin of the local frame."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self._motion = SmoothMotion()
        self._auto = AutoMotion(parameters)
        self._mode: Mode | None = None
        self._hold: Vector | None = None
        self._yaw = 0.0
        self._leg = 0
        self._looked = 0.0
        self._return_height = 0.0
        self.home: Vector = (0.0, 0.0, 0.0)
        self.descending = False
        """Whether the mode is coming down for a landing (EXTENDED_SYS_STATE says LANDING)."""
        self.takeoff_done = False
        self.armed = False
        """Return and Land do nothing on a disarmed vehicle."""
        self._notices: list[Notice] = []
        self.precision_landing = PrecisionLanding(parameters)
        self.t = 0.0
        """Boot time [s]."""

    def take_notices(self) -> list[Notice]:
        """Hand out what there is to say."""
        said, self._notices = self._notices, []
        return said

    def follow_reset(self, step: Vector) -> None:
        """The estimator has moved its position by `step` [m]: what is held moves along."""
        self._auto.shift(step)
        self._motion.position = [p + s for p, s in zip(self._motion.position, step, strict=True)]
        if self._hold is not None:
            h0, h1, h2 = self._hold
            self._hold = (h0 + step[0], h1 + step[1], h2 + step[2])

    def setpoint(
        self, mode: Mode, estimate: Estimate, sticks: Sticks | None, *, in_air: bool, dt: float
    ) -> tuple[TrajectorySetpoint, bool]:
        """Setpoint of `mode` now, and whether it wants to take off; `sticks` None: no stick positions arrive."""
        if mode is not self._mode:
            self._enter(mode, estimate)
        if not in_air and mode is not Mode.AUTO_TAKEOFF:
            self._motion.start(estimate)
            self._auto.start(estimate)
            self._hold = None
        if mode is Mode.AUTO_TAKEOFF:
            return self._take_off(estimate, in_air, dt), True
        if mode is Mode.AUTO_LAND:
            return self._land(estimate, dt), False
        if mode is Mode.AUTO_PRECLAND:
            return self._land_precisely(estimate, in_air, dt), False
        if mode is Mode.AUTO_RTL and self.armed:
            return self._return(estimate, dt), False
        if mode in NEEDS_STICKS and sticks is not None:
            return self._by_sticks(mode, estimate, sticks, dt), sticks.up > 0.15
        if mode in NEEDS_STICKS or mode is Mode.DESCEND:
            return self._sink(), False
        return self._hold_here(estimate, dt), False

    def _enter(self, mode: Mode, estimate: Estimate) -> None:
        self._mode = mode
        self._motion.start(estimate)
        self._auto.start(estimate)
        self._hold = None
        self._yaw = estimate.yaw
        self._leg = 0
        self._looked = math.inf
        self.descending = mode is Mode.AUTO_LAND and self.armed
        if mode is Mode.AUTO_PRECLAND:
            self.precision_landing.begin(self.t, estimate)
        self.takeoff_done = False
        away = math.hypot(estimate.north - self.home[0], estimate.east - self.home[1])
        self._return_height = max(self.home[2] - estimate.down, return_height(away, self._parameters))
        if mode is Mode.AUTO_RTL and self.armed:
            self._notices.append(notices.return_starts(SEA_LEVEL + self._return_height, self._return_height))

    def leave(self) -> None:
        """Forget the mode: the next call starts afresh (OFFBOARD or termination is in force)."""
        self._mode = None
        self.descending = False

    def _limits(self, dt: float) -> dict[str, float]:
        parameters = self._parameters
        return {"acceleration_max": parameters["MPC_ACC_HOR"], "jerk_max": 2.0 * parameters["MPC_JERK_AUTO"], "dt": dt}

    def _horizontal(self, goal: Vector) -> tuple[float, float]:
        """Velocity towards `goal` that can still stop there."""
        parameters, position = self._parameters, self._motion.position
        x, y = goal[0] - position[0], goal[1] - position[1]
        distance = math.hypot(x, y)
        if distance < 1e-3:
            return (0.0, 0.0)
        limit = parameters["MPC_XY_CRUISE"]
        acceleration, jerk = parameters["MPC_ACC_HOR"], parameters["MPC_JERK_AUTO"]
        speed = min(speed_towards(distance, acceleration=acceleration, jerk=jerk, limit=limit), 0.9 * distance)
        return (x / distance * speed, y / distance * speed)

    def _vertical(self, goal_down: float) -> float:
        parameters = self._parameters
        distance = goal_down - self._motion.position[2]
        up = distance < 0.0
        limit = parameters["MPC_Z_V_AUTO_UP" if up else "MPC_Z_V_AUTO_DN"]
        acceleration = parameters["MPC_ACC_UP_MAX" if up else "MPC_ACC_DOWN_MAX"]
        jerk = parameters["MPC_JERK_AUTO"]
        speed = speed_towards(abs(distance), acceleration=acceleration, jerk=jerk, limit=limit)
        return math.copysign(min(speed, 0.9 * abs(distance)), distance)

    def _smoothed(self, *, free_height: bool = False, yaw: float | None = None) -> TrajectorySetpoint:
        motion = self._motion
        x, y, z = motion.position
        return TrajectorySetpoint(
            position=(x, y, NAN if free_height else z),
            velocity=(motion.velocity[0], motion.velocity[1], motion.velocity[2]),
            acceleration=(motion.acceleration[0], motion.acceleration[1], motion.acceleration[2]),
            yaw=self._yaw if yaw is None else yaw,
        )

    def _brake(self, axes: int) -> Vector:
        """Where to hold: decided once the setpoint has stopped in the first `axes` axes."""
        motion = self._motion
        if self._hold is None and max(map(abs, motion.velocity[:axes])) < STOPPED:
            self._hold = (motion.position[0], motion.position[1], motion.position[2])
        return self._hold if self._hold is not None else (motion.position[0], motion.position[1], motion.position[2])

    def _stopping_place(self, estimate: Estimate) -> Vector:
        """Where to hold: where the vehicle could stop, at the height at which that was asked first."""
        if self._hold is None:
            north, east = stopping_point(estimate, acceleration=self._parameters["MPC_ACC_HOR"])
            self._hold = (north, east, estimate.down)
        return self._hold

    def _automatic(self) -> TrajectorySetpoint:
        auto = self._auto
        return TrajectorySetpoint(
            position=auto.position, velocity=auto.velocity, acceleration=auto.acceleration, yaw=self._yaw
        )

    def _hold_here(self, estimate: Estimate, dt: float) -> TrajectorySetpoint:
        self._auto.step(self._stopping_place(estimate), estimate, dt)
        return self._automatic()

    def _land(self, estimate: Estimate, dt: float) -> TrajectorySetpoint:
        """Come down: the height setpoint goes on below the ground, until the thrust is gone."""
        held = self._stopping_place(estimate)
        self._auto.step((held[0], held[1], NAN), estimate, dt, down_rate=self._descent_rate(estimate))
        return self._automatic()

    def _land_precisely(self, estimate: Estimate, in_air: bool, dt: float) -> TrajectorySetpoint:
        """Fly to the waypoint of the precision landing, and come down where it says so."""
        waypoint = self.precision_landing.waypoint(self.t, estimate, landed=not in_air)
        self.descending = waypoint.land
        self._hold = (waypoint.north, waypoint.east, waypoint.down)
        return self._land(estimate, dt) if waypoint.land else self._hold_here(estimate, dt)

    def _sink(self) -> TrajectorySetpoint:
        """Come down level where the wind takes it: no position, or nobody at the sticks (FlightTaskFailsafe)."""
        rate = self._parameters["MPC_LAND_SPEED"]
        return TrajectorySetpoint(velocity=(NAN, NAN, rate), acceleration=(0.0, 0.0, NAN), yaw=self._yaw)

    def _descent_rate(self, estimate: Estimate) -> float:
        """Slower near the ground (MPC_LAND_ALT1 to ALT3), by the range to what is below."""
        parameters, height = self._parameters, estimate.range_down
        slow, fast = parameters["MPC_LAND_SPEED"], parameters["MPC_Z_V_AUTO_DN"]
        if height < LAND_CRAWL_HEIGHT:
            return parameters["MPC_LAND_CRWL"]
        share = (height - LAND_SLOW_HEIGHT) / (LAND_FAST_HEIGHT - LAND_SLOW_HEIGHT)
        return slow + max(0.0, min(1.0, share)) * (fast - slow)

    def _return(self, estimate: Estimate, dt: float) -> TrajectorySetpoint:
        """Climb, fly home, land from there, as RtlDirect does with RTL_LAND_DELAY 0."""
        parameters, home = self._parameters, self.home
        height = home[2] - self._return_height
        self._looked += dt
        if self._looked >= LOOK_INTERVAL:
            legs = 2 if math.isinf(self._looked) else 1  # it begins with the leg that fits
            self._looked = 0.0
            at_height = abs(estimate.down - height) < parameters["NAV_MC_ALT_RAD"]
            at_home = math.hypot(estimate.north - home[0], estimate.east - home[1]) < parameters["NAV_ACC_RAD"]
            for _ in range(legs):
                self._leg += (at_height, at_height and at_home, False)[self._leg]
        if self._leg == 2:
            if not self.descending:
                self._notices.append(notices.RETURN_LANDS)
            self._hold, self.descending = home, True
            return self._land(estimate, dt)
        place = self._stopping_place(estimate) if self._leg == 0 else home
        self._auto.step((place[0], place[1], height), estimate, dt)
        return self._automatic()

    def _take_off(self, estimate: Estimate, in_air: bool, dt: float) -> TrajectorySetpoint:
        goal = self.home[2] - self._parameters["MIS_TAKEOFF_ALT"]
        motion = self._motion
        if not in_air:
            motion.start(estimate)
            motion.velocity = [0.0, 0.0, -0.1]
        rate = max(self._vertical(goal), -self._parameters["MPC_TKO_SPEED"])
        motion.step((0.0, 0.0, rate), **self._limits(dt))
        self.takeoff_done = in_air and abs(estimate.down - goal) < ARRIVED and abs(estimate.v_down) < 0.3
        return self._smoothed()

    def _by_sticks(self, mode: Mode, estimate: Estimate, sticks: Sticks, dt: float) -> TrajectorySetpoint:
        parameters, motion = self._parameters, self._motion
        cosine, sine = math.cos(estimate.yaw), math.sin(estimate.yaw)
        north = cosine * sticks.forward - sine * sticks.right
        east = sine * sticks.forward + cosine * sticks.right
        up = sticks.up
        down = -up * parameters["MPC_Z_VEL_MAX_UP" if up > 0.0 else "MPC_Z_VEL_MAX_DN"]
        yaw_rate = sticks.yaw * math.radians(parameters["MPC_MAN_Y_MAX"])
        if yaw_rate:
            self._yaw = estimate.yaw
        full = parameters["MPC_VEL_MANUAL"]
        moving = bool(sticks.forward or sticks.right or down)
        if moving:
            self._hold = None
        held = self._brake(3)
        still = self._hold is not None and not moving
        wanted = (*self._horizontal(held), self._vertical(held[2])) if still else (full * north, full * east, down)
        motion.step(wanted, **self._limits(dt))
        smooth = self._smoothed(free_height=bool(down), yaw=NAN if yaw_rate else None)
        if mode is Mode.ALTCTL:
            tilt = 9.81 * math.tan(math.radians(parameters["MPC_MAN_TILT_MAX"]))
            return TrajectorySetpoint(
                position=(NAN, NAN, smooth.position[2]),
                velocity=(NAN, NAN, smooth.velocity[2]),
                acceleration=(tilt * north, tilt * east, NAN),
                yaw=smooth.yaw,
                yaw_rate=yaw_rate or NAN,
            )
        if down:
            motion.position[2] = estimate.down
        return TrajectorySetpoint(
            position=smooth.position,
            velocity=smooth.velocity,
            acceleration=smooth.acceleration,
            yaw=smooth.yaw,
            yaw_rate=yaw_rate or NAN,
        )
