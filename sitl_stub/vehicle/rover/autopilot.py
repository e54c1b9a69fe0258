"""The rover's autopilot: drive control, land detector and navigation home, and the messages of a rover."""

import math
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.truth import Vector
from sitl_stub.vehicle import notices
from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.modes import AUTO, Mode
from sitl_stub.vehicle.navigator import SEA_LEVEL
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.rover.controllers import Motion
from sitl_stub.vehicle.rover.drive_control import LOOPS, DriveControl, offboard_loops
from sitl_stub.vehicle.rover.land_detector import RoverLandDetector
from sitl_stub.vehicle.system_state import BY_COMMAND, Result
from sitl_stub.vehicle.telemetry import Telemetry

LANDING = frozenset({Mode.AUTO_RTL, Mode.AUTO_LAND, Mode.DESCEND})
"""Modes that show landed state LANDING: Return drives straight to a landing."""


class RoverCommander(Commander):
    """A commander that always lets a ground vehicle disarm (PX4: is_ground_vehicle)."""

    def request_disarm(self, *, force: bool, reason: int = BY_COMMAND) -> Result:  # noqa: ARG002
        """Disarm, also while driving."""
        return super().request_disarm(force=True, reason=reason)


class RoverAutopilot(Autopilot):
    """PX4 on a rover with Ackermann steering."""

    commander_type = RoverCommander
    parameter_folder = Path(__file__).parent

    def _start(self) -> None:
        super()._start()
        self.drive = DriveControl(self.parameters)
        self._land_detector = RoverLandDetector()
        self._goal_due = True
        self._notices: list[Notice] = []

    @property
    def landed(self) -> bool:
        """Whether the rover counts as landed."""
        return self._land_detector.landed

    @property
    def landing(self) -> bool:
        """Whether Return drives home, or Land is in force."""
        return self.commander.armed and self.commander.mode in LANDING

    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""
        self.drive.configure()

    def motion(self) -> Motion:
        """What the controllers know: estimated motion, with small rates and speeds taken for standing still."""
        estimate, parameters = self.estimate, self.parameters
        cosine, sine = math.cos(estimate.yaw), math.sin(estimate.yaw)
        forward = cosine * estimate.v_north + sine * estimate.v_east
        speed = math.copysign(math.hypot(estimate.v_north, estimate.v_east), forward)
        turning = abs(estimate.r) > math.radians(parameters["RO_YAW_RATE_TH"])
        return Motion(
            place=(estimate.north, estimate.east),
            yaw=estimate.yaw,
            yaw_rate=estimate.r if turning else 0.0,
            speed=speed if abs(speed) > parameters["RO_SPEED_TH"] else 0.0,
        )

    def _target_seen(self, pose: LandingTargetPose) -> None:
        """A rover has no precision landing."""

    def _take_notices(self) -> list[Notice]:
        said, self._notices = self._notices, []
        return said

    def _entered_mode(self) -> None:
        self._goal_due = True

    def _follow_reset(self, step: Vector, velocity_step: Vector) -> None:  # noqa: ARG002
        self.drive.position.follow_reset(self.motion().place)

    def _control(self, dt: float) -> None:
        commander, drive, mode = self.commander, self.drive, self.commander.mode
        motion = self.motion()
        loops = offboard_loops(self._offboard_setpoint) if mode is Mode.OFFBOARD else LOOPS[mode]
        if drive.begin(loops, armed=commander.armed):
            if mode is Mode.OFFBOARD:
                drive.by_offboard(self._offboard_setpoint, motion)
            elif mode in AUTO:
                self._navigate(mode, motion)
            else:
                drive.by_mode(mode, motion, commander.sticks)
            drive.run(motion, dt)
        else:
            self._goal_due = True
        self._land_detector.update(
            mode,
            armed=commander.armed,
            home_distance=math.dist(motion.place, self.home[:2]),
            acceptance_radius=self.parameters["NAV_ACC_RAD"],
            dt=dt,
        )

    def _navigate(self, mode: Mode, motion: Motion) -> None:
        """Give Hold its place and Return its home, once; the other automatic modes have no goal on a rover."""
        if not self._goal_due or mode not in (Mode.AUTO_LOITER, Mode.AUTO_RTL):
            return
        self._goal_due = False
        if mode is Mode.AUTO_RTL:
            height = self.parameters["RTL_RETURN_ALT"]
            self._notices += [notices.RETURN_LANDS, notices.return_starts(SEA_LEVEL + height, height)]
        goal = motion.place if mode is Mode.AUTO_LOITER else (self.home[0], self.home[1])
        self.drive.position.acceptance_radius = self.parameters["NAV_ACC_RAD"]
        self.drive.position.drive_to(goal, motion.place)

    def _actuate(self, dt: float) -> list[float]:  # noqa: ARG002
        actuators = self.drive.actuators
        return [actuators.steering, actuators.throttle]

    def _stop_actuators(self) -> list[float]:
        return [0.0, 0.0]

    def _terminate_actuators(self) -> list[float]:
        return self._stop_actuators()


class RoverTelemetry(Telemetry):
    """Adds steering and throttle to what every vehicle sends; a rover has no attitude and position targets."""

    def __init__(self, autopilot: RoverAutopilot) -> None:
        super().__init__(autopilot)
        self._rover = autopilot

    def servo_output_raw(self) -> Any:
        """SERVO_OUTPUT_RAW: steering on the first output, throttle on the second, 1500 is neutral."""
        actuators, armed = self._rover.drive.actuators, self._autopilot.commander.armed
        steering, throttle = (1500 + int(500 * part) for part in (actuators.steering, actuators.throttle))
        outputs = (steering, throttle) if armed else (1500, 1500)
        return mavlink.MAVLink_servo_output_raw_message(
            self._microseconds() & 0xFFFFFFFF, 0, *outputs, 0, 0, 0, 0, 0, 0
        )

    def throttle(self) -> float:
        """Throttle setpoint, 0 to 1."""
        return abs(self._rover.drive.actuators.throttle)
