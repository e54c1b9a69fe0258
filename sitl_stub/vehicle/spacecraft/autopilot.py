"""The free-flyer's autopilot: PX4 with its spacecraft module, and the messages that only it sends."""

import math
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.truth import Vector
from sitl_stub.vehicle.attitude_setpoints import AttitudeTarget
from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.position_control import TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.spacecraft.control import STEERED, TURNED, AttitudeSetpoint, Loops, SpacecraftControl
from sitl_stub.vehicle.spacecraft.thrusters import COUNT
from sitl_stub.vehicle.telemetry import Telemetry

DUTY_OUTPUT = 10_000
"""PWM_AUX_MAXn of the ATMOS airframe: what SERVO_OUTPUT_RAW says of a valve that is always open."""


class SpacecraftAutopilot(Autopilot):
    """PX4 on a planar spacecraft. It starts no land detector, so it counts as landed for ever."""

    parameter_folder = Path(__file__).parent

    def _start(self) -> None:
        super()._start()
        self.control = SpacecraftControl(self.parameters)
        self._duties = [0.0] * COUNT
        self._offboard_loops = STEERED

    @property
    def landed(self) -> bool:
        """True: the commander starts with "landed", and nobody ever tells it otherwise."""
        return True

    @property
    def landing(self) -> bool:
        """False: nothing lands."""
        return False

    @property
    def duties(self) -> list[float]:
        """Present commands of the thrusters, 0 to 1."""
        return self._duties

    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""
        self.control.configure()

    def offboard_setpoint(self, setpoint: TrajectorySetpoint) -> None:
        """Take a position, velocity or acceleration setpoint: it counts as signal, but never reaches the module."""
        super().offboard_setpoint(setpoint)
        position = any(map(math.isfinite, setpoint.position))
        self._offboard_loops = STEERED | Loops.POSITION if position else STEERED

    def attitude_target(self, target: AttitudeTarget) -> None:
        """Take an attitude setpoint from a companion; it is flown only in OFFBOARD, but always counts as signal."""
        self.commander.setpoint_arrived(position=False, velocity=False, acceleration=False)
        self._offboard_loops = TURNED if target.attitude is None else STEERED
        if self.commander.mode is not Mode.OFFBOARD:
            return
        if target.attitude is not None:
            thrust = target.thrust_body or (0.0, 0.0, 0.0)
            self.control.setpoint = AttitudeSetpoint(attitude=target.attitude, thrust=thrust)
        elif target.yaw_rate is not None:
            self.control.turn_at(target.yaw_rate)

    def _target_seen(self, pose: LandingTargetPose) -> None:
        """A spacecraft has no precision landing."""

    def _take_notices(self) -> list[Notice]:
        return []

    def _entered_mode(self) -> None:
        """Nothing begins anew: each loop keeps what it had until somebody sets it."""

    def _follow_reset(self, step: Vector, velocity_step: Vector) -> None:
        """Only held places move with the estimate; they are set anew with every message or stick."""

    def _control(self, dt: float) -> None:
        commander = self.commander
        if not commander.armed:
            return
        if commander.mode is Mode.OFFBOARD:
            self.control.by_offboard(self._offboard_loops, self.estimate)
        else:
            self.control.by_mode(commander.mode, self.estimate, commander.sticks, dt)

    def _actuate(self, dt: float) -> list[float]:
        self._duties = self.control.duties(self.estimate, armed=self.commander.armed, dt=dt)
        return self._duties

    def _stop_actuators(self) -> list[float]:
        self._duties = [0.0] * COUNT
        return self._duties

    def _terminate_actuators(self) -> list[float]:
        return self._stop_actuators()


class SpacecraftTelemetry(Telemetry):
    """Adds the valves and the attitude setpoint to what every vehicle sends."""

    def __init__(self, autopilot: SpacecraftAutopilot) -> None:
        super().__init__(autopilot)
        self._spacecraft = autopilot
        self.makers[mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET] = self.attitude_target

    def servo_output_raw(self) -> Any:
        """SERVO_OUTPUT_RAW: duties of the eight valves, 0 to 10000."""
        outputs = [round(DUTY_OUTPUT * duty) for duty in self._spacecraft.duties]
        return mavlink.MAVLink_servo_output_raw_message(self._microseconds() & 0xFFFFFFFF, 0, *outputs)

    def throttle(self) -> float:
        """Size of the wanted thrust, 0 to 1."""
        return min(1.0, math.hypot(*self._spacecraft.control.setpoint.thrust))

    def attitude_target(self) -> Any:
        """ATTITUDE_TARGET: attitude, turn rate and size of the thrust that are followed."""
        control = self._spacecraft.control
        return mavlink.MAVLink_attitude_target_message(
            self._milliseconds(), 0, control.setpoint.attitude, 0.0, 0.0, control.yaw_rate, self.throttle()
        )
