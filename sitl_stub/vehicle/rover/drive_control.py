"""The rover's cascade: which controllers run in a mode, and what feeds them (RoverAckermann.cpp)."""

import math
from collections.abc import Mapping
from enum import Flag, auto

from sitl_stub.vehicle.modes import AUTO, Mode
from sitl_stub.vehicle.position_control import TrajectorySetpoint
from sitl_stub.vehicle.rover.controllers import (
    NAN,
    NOWHERE,
    ActuatorControl,
    Geometry,
    HeadingControl,
    Motion,
    PositionControl,
    SpeedControl,
    YawRateControl,
)
from sitl_stub.vehicle.rover.loops import EPSILON, dead_zone, sign, super_exponential
from sitl_stub.vehicle.rover.pursuit import Point
from sitl_stub.vehicle.sticks import Sticks

STEP_MAX = 0.010
"""The controllers never take a step for longer [s]."""


class Loops(Flag):
    """Which controllers a mode runs; the actuators' limits always run."""

    ACTUATORS = 0
    YAW_RATE = auto()
    HEADING = auto()
    SPEED = auto()
    POSITION = auto()


TURN = Loops.YAW_RATE | Loops.HEADING
ALL = TURN | Loops.SPEED | Loops.POSITION
LOOPS = {
    Mode.MANUAL: Loops.ACTUATORS,
    Mode.ACRO: Loops.YAW_RATE,
    Mode.STABILIZED: TURN,
    Mode.ALTCTL: TURN,
    Mode.POSCTL: ALL,
    Mode.TERMINATION: Loops.ACTUATORS,
    **dict.fromkeys(AUTO, ALL),
    Mode.DESCEND: TURN,
}
"""Loops of each mode but OFFBOARD, where they follow from the setpoint (commander: getVehicleControlMode)."""


def offboard_loops(setpoint: TrajectorySetpoint) -> Loops:
    """Loops of an offboard setpoint: the first of position, velocity and acceleration that it has any axis of."""
    if _any(setpoint.position):
        return ALL
    return TURN | Loops.SPEED if _any(setpoint.velocity) else TURN


def _any(vector: tuple[float, float, float]) -> bool:
    return any(value == value for value in vector)


class DriveControl:
    """All controllers of a rover and their setpoints; NaN: none. `begin`, a setpoint and `run` at 100 Hz."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.position = PositionControl(parameters)
        self._speed_control = SpeedControl(parameters)
        self._heading_control = HeadingControl(parameters)
        self._yaw_rate_control = YawRateControl(parameters)
        self.actuators = ActuatorControl(parameters)
        self._geometry = Geometry.of(parameters)
        self.speed = self.yaw = self.yaw_rate = NAN
        """Setpoints [m/s], [rad], [rad/s]."""
        self._throttle = self._steering = NAN
        self._loops = Loops.ACTUATORS
        self._driving = False
        self._forget_course()

    def configure(self) -> None:
        """Take over changed parameters."""
        self._geometry = Geometry.of(self._parameters)
        for part in (
            self.position,
            self._speed_control,
            self._heading_control,
            self._yaw_rate_control,
            self.actuators,
        ):
            part.configure(self._parameters)

    def _reset(self) -> None:
        self.position.reset()
        self._speed_control.reset()
        self._yaw_rate_control.reset()
        self.speed = self.yaw = self.yaw_rate = NAN
        self._forget_course()

    def _forget_course(self) -> None:
        self._held_yaw = NAN
        self._course: Point = NOWHERE
        self._course_start: Point = NOWHERE

    # setpoints of the modes

    def by_mode(self, mode: Mode, motion: Motion, sticks: Sticks) -> None:
        """Set what the mode wants; automatic modes and OFFBOARD have functions of their own."""
        if mode is Mode.MANUAL:
            self._throttle, self._steering = sticks.up, sticks.right
        elif mode is Mode.ACRO:
            self._throttle = sticks.up
            self.yaw_rate = self._stick_yaw_rate(sticks, dead=0.0)
        elif mode is Mode.STABILIZED:
            self._stabilized(motion, sticks)
        elif mode is Mode.POSCTL:
            self._position_mode(motion, sticks)

    def _stick_yaw_rate(self, sticks: Sticks, *, dead: float) -> float:
        """Yaw rate [rad/s] of the steering stick; its sign turns in reverse, as a car's does."""
        parameters = self._parameters
        shaped = super_exponential(
            dead_zone(sticks.right, dead), parameters["RO_YAW_EXPO"], parameters["RO_YAW_SUPEXPO"]
        )
        return sign(sticks.up) * self._geometry.yaw_rate_max * shaped

    def _stabilized(self, motion: Motion, sticks: Sticks) -> None:
        """Steering stick: yaw rate; centred: the heading is held."""
        self._throttle = sticks.up
        if abs(sticks.right) > EPSILON or abs(sticks.up) < EPSILON:
            self._held_yaw = self.yaw = NAN
            self.yaw_rate = self._stick_yaw_rate(sticks, dead=self._parameters["RO_YAW_STICK_DZ"])
        else:
            if not math.isfinite(self._held_yaw):
                self._held_yaw = motion.yaw
            self.yaw = self._held_yaw

    def _position_mode(self, motion: Motion, sticks: Sticks) -> None:
        """Speed by the throttle stick; steering stick: yaw rate; centred: the line on which the rover was."""
        speed = sticks.up * self._parameters["RO_SPEED_LIM"]
        if abs(sticks.right) > EPSILON or abs(speed) < EPSILON:
            self._course = NOWHERE
            self.speed, self.yaw = speed, NAN
            self.yaw_rate = self._stick_yaw_rate(sticks, dead=self._parameters["RO_YAW_STICK_DZ"])
            self.position.drive_to(NOWHERE, motion.place)
            return
        if not math.isfinite(self._course[0]):
            self._course = (math.cos(motion.yaw), math.sin(motion.yaw))
            self._course_start = motion.place
        start, course = self._course_start, self._course
        along = (motion.place[0] - start[0]) * course[0] + (motion.place[1] - start[1]) * course[1]
        # a goal that is never nearer than the farthest lookahead
        reach = sign(speed) * (abs(along) + self._parameters["PP_LOOKAHD_MAX"])
        goal = (start[0] + reach * course[0], start[1] + reach * course[1])
        self.position.drive_to(goal, motion.place, start=start, cruise=speed)

    def by_offboard(self, setpoint: TrajectorySetpoint, motion: Motion) -> None:
        """Position: drive there. Velocity: its length as speed, along its direction; never backwards, yaw ignored."""
        loops = offboard_loops(setpoint)
        if Loops.POSITION in loops:
            self.position.drive_to((setpoint.position[0], setpoint.position[1]), motion.place)
        elif Loops.SPEED in loops:
            north, east, _ = setpoint.velocity
            self.speed = math.hypot(north, east)
            self.yaw = math.atan2(east, north)

    # the loops

    def begin(self, loops: Loops, *, armed: bool) -> bool:
        """Begin a step: forget setpoints when other loops run than before. False: nothing is to be driven."""
        if loops != self._loops:
            self._loops = loops
            self._reset()
        if armed and self._geometry.complete:
            self._driving = True
            return True
        if self._driving:
            self._driving = False
            self._reset()
            self.actuators.stop()
        return False

    def run(self, motion: Motion, dt: float) -> None:
        """Run the loops of this step from position to actuators, `dt` [s] after the last."""
        dt, loops = min(dt, STEP_MAX), self._loops
        driven = self.actuators.throttle * self._geometry.full_speed
        if Loops.POSITION in loops:
            wanted = self.position.update(motion)
            if wanted is not None:
                self.speed, self.yaw = wanted
        if Loops.SPEED in loops and math.isfinite(self.speed):
            self._throttle = self._speed_control.update(self.speed, motion.speed, dt)
        if Loops.HEADING in loops and math.isfinite(self.yaw):
            self.yaw_rate = self._heading_control.update(self.yaw, motion.yaw, driven, dt)
        if Loops.YAW_RATE in loops and math.isfinite(self.yaw_rate):
            self._steering = self._yaw_rate_control.update(self.yaw_rate, motion.yaw_rate, driven, dt)
        self.actuators.update(self._throttle, self._steering, dt)
