"""The rover's controllers: position, speed, heading, yaw rate, actuators (PX4's rover_ackermann, lib/rover_control).

Each holds its state and the parameters it needs; NaN is "no setpoint". Angles in rad, clockwise from north.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sitl_stub.vehicle.rover.loops import EPSILON, ProportionalIntegral, SlewRate, clamp, wrap
from sitl_stub.vehicle.rover.pursuit import Point, target_bearing

NAN = math.nan
NOWHERE: Point = (NAN, NAN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What the controllers know of the rover's motion, from the estimate."""

    place: Point
    """North and east [m]."""
    yaw: float
    yaw_rate: float
    """[rad/s]; zero below RO_YAW_RATE_TH."""
    speed: float
    """Along the body [m/s], below zero in reverse; zero below RO_SPEED_TH."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """What limits the turn, from the autopilot's parameters."""

    wheel_base: float
    """[m]"""
    steering_max: float
    """Angle of the front wheels [rad]."""
    yaw_rate_max: float
    """[rad/s]"""
    full_speed: float
    """Speed at full throttle [m/s]."""

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Geometry":
        """Take it from the autopilot's parameters."""
        return cls(
            wheel_base=parameters["RA_WHEEL_BASE"],
            steering_max=parameters["RA_MAX_STR_ANG"],
            yaw_rate_max=math.radians(parameters["RO_YAW_RATE_LIM"]),
            full_speed=parameters["RO_MAX_THR_SPEED"],
        )

    @property
    def complete(self) -> bool:
        """Whether the controllers can work (PX4's sanity checks)."""
        return min(self.wheel_base, self.steering_max, self.yaw_rate_max, self.full_speed) >= EPSILON

    def yaw_rate_at(self, speed: float) -> float:
        """Greatest possible yaw rate [rad/s] at a speed [m/s]."""
        return min(abs(speed) * math.tan(self.steering_max) / self.wheel_base, self.yaw_rate_max)

    @property
    def slowest_turn(self) -> float:
        """Speed [m/s] at which full steering just gives the greatest yaw rate."""
        return self.wheel_base * self.yaw_rate_max / math.tan(self.steering_max)


class PositionControl:
    """Drives to a goal: how fast, and in which direction."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.acceptance_radius = 0.0
        """[m]; NAV_ACC_RAD once an automatic mode has driven, zero until then (as in PX4, also in OFFBOARD)."""
        self.configure(parameters)
        self.reset()

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over the autopilot's parameters."""
        self._geometry = Geometry.of(parameters)
        self._speed_limit = parameters["RO_SPEED_LIM"]
        self._deceleration, self._jerk = parameters["RO_DECEL_LIM"], parameters["RO_JERK_LIM"]
        self._slow_in_turns = parameters["RO_SPEED_RED"]
        self._lookahead_gain = parameters["PP_LOOKAHD_GAIN"]
        self._lookahead_range = (parameters["PP_LOOKAHD_MIN"], parameters["PP_LOOKAHD_MAX"])

    def reset(self) -> None:
        """Forget the goal."""
        self.goal = self.start = NOWHERE
        self._cruise = self._speed_limit
        self._stopped = False

    def drive_to(self, goal: Point, place: Point, *, start: Point = NOWHERE, cruise: float = NAN) -> None:
        """Set a goal [m] to stop at, on the line from `start`, or from `place` (here) when there is none.

        `cruise` is the speed [m/s] on the way, below zero in reverse; NaN: RO_SPEED_LIM.
        """
        self.goal = goal
        self.start = start if all(map(math.isfinite, start)) else place
        self._cruise = cruise if math.isfinite(cruise) else self._speed_limit
        self._stopped = False

    def follow_reset(self, place: Point) -> None:
        """The estimate has jumped to `place` [m]: a rover that has arrived stays where it is."""
        if self._stopped:
            self.goal = place

    def update(self, motion: Motion) -> tuple[float, float] | None:
        """Speed [m/s] and yaw [rad] to drive with; None without a goal."""
        if not all(map(math.isfinite, self.goal)):
            return None
        distance = math.dist(self.goal, motion.place)
        if distance <= self.acceptance_radius:
            if not self._stopped and abs(motion.speed) < EPSILON:
                self._stopped = True
                self.goal = motion.place
            return (0.0, motion.yaw)
        speed = self._cruise
        if self._deceleration > EPSILON and self._jerk > EPSILON:
            speed = min(stopping_speed(distance, self._deceleration, self._jerk), speed)
        lookahead = clamp(self._lookahead_gain * abs(speed), *self._lookahead_range)
        bearing = target_bearing(self.goal, self.start, motion.place, lookahead)
        if self._slow_in_turns > EPSILON:
            most = self._speed_in_turn(abs(wrap(bearing - motion.yaw)))
            speed = clamp(speed, -most, most)
        return (speed, bearing if speed > -EPSILON else wrap(bearing + math.pi))

    def _speed_in_turn(self, course_error: float) -> float:
        full = self._geometry.full_speed
        reduction = clamp(self._slow_in_turns * course_error / math.pi, 0.0, 1.0)
        return clamp(full * (1.0 - reduction), self._geometry.slowest_turn, full)


def stopping_speed(distance: float, deceleration: float, jerk: float) -> float:
    """Speed [m/s] from which a stop in `distance` [m] is possible (math::trajectory::computeMaxSpeedFromDistance)."""
    b = 4.0 * deceleration * deceleration / jerk
    return max(0.5 * (-b + math.sqrt(b * b + 8.0 * deceleration * distance)), 0.0)


class SpeedControl:
    """Throttle for a speed: feed-forward from the speed at full throttle, plus P and I."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._ramp = SlewRate()
        self._loop = ProportionalIntegral()
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over the autopilot's parameters."""
        self._limit, self._full = parameters["RO_SPEED_LIM"], parameters["RO_MAX_THR_SPEED"]
        self._acceleration, self._deceleration = parameters["RO_ACCEL_LIM"], parameters["RO_DECEL_LIM"]
        self._loop.proportional_gain = parameters["RO_SPEED_P"]
        self._loop.integral_gain = parameters["RO_SPEED_I"]

    def reset(self) -> None:
        """Begin afresh."""
        self._loop.integral = 0.0
        self._ramp.value = 0.0

    def update(self, wanted: float, measured: float, dt: float) -> float:
        """Throttle -1 to 1 for a speed [m/s]."""
        wanted = clamp(wanted, -self._limit, self._limit)
        rate = self._acceleration if abs(wanted) >= abs(measured) else self._deceleration
        ramped = self._ramp.approach(wanted, measured, rate, dt)
        throttle = clamp(ramped / self._full, -1.0, 1.0)
        if abs(ramped) > EPSILON:
            throttle += self._loop.update(ramped - measured, dt)
        else:
            self._loop.integral = 0.0
        return clamp(throttle, -1.0, 1.0)


class HeadingControl:
    """Yaw rate for a heading."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._ramp = SlewRate()
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over the autopilot's parameters."""
        self._geometry = Geometry.of(parameters)
        self._gain = parameters["RO_YAW_P"]

    def update(self, wanted: float, yaw: float, speed: float, dt: float) -> float:
        """Yaw rate [rad/s] towards `wanted` [rad]; `speed` [m/s] as the throttle makes it."""
        wanted, most = wrap(wanted), self._geometry.yaw_rate_max
        rate = self._geometry.yaw_rate_at(speed)
        ramp = self._ramp
        if rate > EPSILON:
            ramp.update(ramp.value + wrap(wanted - ramp.value), rate, dt)
            if abs(wrap(ramp.value - yaw)) > abs(wrap(wanted - yaw)):
                ramp.value = wanted
        else:
            ramp.value = wanted
        return clamp(self._gain * wrap(ramp.value - yaw), -most, most)


class YawRateControl:
    """Steering for a yaw rate: the bicycle's geometry, plus P and I when driving forwards."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._ramp = SlewRate()
        self._loop = ProportionalIntegral()
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over the autopilot's parameters."""
        self._geometry = Geometry.of(parameters)
        self._acceleration = math.radians(parameters["RO_YAW_ACCEL_LIM"])
        self._correction = parameters["RO_YAW_RATE_CORR"]
        self._speed_threshold = parameters["RO_SPEED_TH"]
        self._loop.proportional_gain = parameters["RO_YAW_RATE_P"]
        self._loop.integral_gain = parameters["RO_YAW_RATE_I"]

    def reset(self) -> None:
        """Begin afresh."""
        self._loop.integral = 0.0

    def update(self, wanted: float, measured: float, speed: float, dt: float) -> float:
        """Steering -1 to 1 for a yaw rate [rad/s]; `speed` [m/s] as the throttle makes it, signed."""
        if abs(speed) <= self._speed_threshold:
            self._loop.integral = 0.0
            return 0.0
        geometry, ramp = self._geometry, self._ramp
        most = geometry.yaw_rate_at(speed)
        goal = clamp(wanted, -most, most)
        if self._acceleration > EPSILON:
            if abs(ramp.value - measured) > abs(goal - measured):
                ramp.value = measured
            ramp.update(goal, self._acceleration, dt)
        else:
            ramp.value = goal
        angle = math.atan(ramp.value * geometry.wheel_base / speed) * self._correction
        if speed > 0.0:
            angle += self._loop.update(ramp.value - measured, dt)
        return clamp(angle / geometry.steering_max, -1.0, 1.0)


class ActuatorControl:
    """Limits how fast throttle and steering change."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._motor, self._servo = SlewRate(), SlewRate()
        self.throttle = self.steering = 0.0
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over the autopilot's parameters."""
        full = parameters["RO_MAX_THR_SPEED"]
        per_speed = 1.0 / full if full > EPSILON else 0.0
        self._acceleration = parameters["RO_ACCEL_LIM"] * per_speed
        self._deceleration = parameters["RO_DECEL_LIM"] * per_speed
        angle = parameters["RA_MAX_STR_ANG"]
        self._steering_rate = math.radians(parameters["RA_STR_RATE_LIM"]) / angle if angle > EPSILON else 0.0

    def update(self, throttle: float, steering: float, dt: float) -> None:
        """Follow both setpoints, -1 to 1; one that is NaN leaves its actuator as it is."""
        if math.isfinite(throttle):
            rate = self._acceleration if abs(throttle) > abs(self.throttle) else self._deceleration
            self.throttle = self._motor.approach(throttle, self.throttle, rate, dt)
        if math.isfinite(steering):
            if self._steering_rate > EPSILON:
                if abs(self._servo.value - self.steering) > abs(steering - self.steering):
                    self._servo.value = self.steering
                self._servo.update(steering, self._steering_rate, dt)
            else:
                self._servo.value = steering
            self.steering = self._servo.value

    def stop(self) -> None:
        """Cut both at once."""
        self.throttle = self.steering = 0.0
