"""The multicopter's autopilot: navigator and flight control, and the messages only a multicopter sends."""

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.truth import Vector
from sitl_stub.vehicle.autopilot import Autopilot, BootClock
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.faults import Faults
from sitl_stub.vehicle.flight_control import OFF, FlightControl
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.navigator import Navigator
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.position_control import TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.telemetry import Telemetry

OFFBOARD_TAKEOFF_AGE = 1.0
"""Only a setpoint younger than this [s] may start a take-off."""


class MulticopterAutopilot(Autopilot):
    """PX4 on a quadrotor."""

    def __init__(
        self,
        vehicle: VehicleConfig,
        body: Body,
        faults: Faults,
        estimator_rng: np.random.Generator,
        reset_rng: np.random.Generator,
        clock: BootClock,
    ) -> None:
        super().__init__(vehicle, body, faults, estimator_rng, reset_rng, clock)
        self._rotors_stop = vehicle.body.rotors_stop_on_termination

    def _start(self) -> None:
        super()._start()
        self.navigator = Navigator(self.parameters)
        self.control = FlightControl(self.parameters)

    @property
    def landed(self) -> bool:
        """Whether the land detector is in its last stage."""
        return self.control.land_detector.landed

    @property
    def landing(self) -> bool:
        """Whether the navigator is coming down for a landing."""
        return self.navigator.descending

    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""
        self.control.configure()

    def reboot(self) -> None:
        """Restart, also in flight; the motors stop at once."""
        super().reboot()
        self.control.commands = list(OFF)

    def _target_seen(self, pose: LandingTargetPose) -> None:
        self.navigator.precision_landing.target_seen(pose)

    def _take_notices(self) -> list[Notice]:
        return self.navigator.take_notices()

    def _entered_mode(self) -> None:
        self.navigator.leave()

    def _follow_reset(self, step: Vector, velocity_step: Vector) -> None:
        self.navigator.follow_reset(step)
        self.control.follow_reset(velocity_step)

    def _control(self, dt: float) -> None:
        commander, estimate = self.commander, self.estimate
        if commander.mode is Mode.OFFBOARD:
            setpoint = self._offboard_setpoint
            fresh = self.t - self._offboard_setpoint_time < OFFBOARD_TAKEOFF_AGE
            wants = commander.armed and fresh and _climbs(setpoint, estimate.down)
        else:
            navigator = self.navigator
            navigator.home, navigator.t, navigator.armed = self.home, self.boot_time, commander.armed
            setpoint, wants = self.navigator.setpoint(
                commander.mode,
                estimate,
                commander.sticks if commander.sticks_alive else None,
                in_air=not self.landed and commander.armed,
                dt=dt,
            )
            wants = wants and commander.armed
            if self.navigator.takeoff_done and commander.intended is Mode.AUTO_TAKEOFF:
                commander.request_mode(Mode.AUTO_LOITER)
        self.control.position_step(estimate, setpoint, armed=commander.armed, wants_takeoff=wants, dt=dt)
        if not self.control.taking_off:
            # PX4 overwrites what it has with "no thrust": it takes off on one that comes after spooling up
            self._offboard_setpoint_time = -math.inf

    def _actuate(self, dt: float) -> list[float]:
        return self.control.rate_step(self.estimate, armed=self.commander.armed, dt=dt)

    def _stop_actuators(self) -> list[float]:
        return OFF

    def _terminate_actuators(self) -> list[float]:
        return OFF if self._rotors_stop else self.control.commands


def _climbs(setpoint: TrajectorySetpoint, down: float) -> bool:
    """Whether an offboard setpoint asks to go up (mc_pos_control: want_takeoff). NaN compares false."""
    return setpoint.position[2] < down or setpoint.velocity[2] < 0.0 or setpoint.acceleration[2] < 0.0


class MulticopterTelemetry(Telemetry):
    """Adds the outputs of flight control to what every vehicle sends."""

    def __init__(self, autopilot: MulticopterAutopilot) -> None:
        super().__init__(autopilot)
        self._multicopter = autopilot
        self.makers[mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET] = self.attitude_target
        self.makers[mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED] = self.position_target_local_ned

    def servo_output_raw(self) -> Any:
        """SERVO_OUTPUT_RAW of the four rotors."""
        armed = self._autopilot.commander.armed
        outputs = [1000 + int(1000 * command) if armed else 900 for command in self._multicopter.control.commands]
        return mavlink.MAVLink_servo_output_raw_message(
            self._microseconds() & 0xFFFFFFFF, 0, *outputs, 900, 900, 900, 900
        )

    def throttle(self) -> float:
        """Collective thrust setpoint, 0 to 1."""
        return self._multicopter.control.position.thrust

    def attitude_target(self) -> Any:
        """ATTITUDE_TARGET: the position controller's output."""
        control = self._multicopter.control
        return mavlink.MAVLink_attitude_target_message(
            self._milliseconds(), 0, control.position.attitude, *control.rate_setpoint, control.position.thrust
        )

    def position_target_local_ned(self) -> Any:
        """POSITION_TARGET_LOCAL_NED: the position controller's inner setpoint; NaN and mask where it has none."""
        control = self._multicopter.control
        setpoint: TrajectorySetpoint = control.setpoint
        velocity, acceleration = control.position.velocity, control.position.acceleration
        mask = 0
        for i, value in enumerate((*setpoint.position, *velocity)):
            if not math.isfinite(value):
                mask |= 1 << i
        return mavlink.MAVLink_position_target_local_ned_message(
            self._milliseconds(),
            1,
            mask,
            *setpoint.position,
            *velocity,
            *acceleration,
            control.position.yaw,
            control.position.yaw_rate,
        )
