"""The autopilot: commander, navigator and controllers around one estimate, stepped with the physics."""

import json
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.vehicle.battery import Battery
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.ekf_resets import EstimateHealth
from sitl_stub.vehicle.estimator import Estimator
from sitl_stub.vehicle.faults import Fault, Faults
from sitl_stub.vehicle.flight_control import OFF, FlightControl
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.navigator import Navigator
from sitl_stub.vehicle.position_control import NO_SETPOINT, TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.rigid_body import RigidBody
from sitl_stub.vehicle.system_state import Surroundings

POSITION_CONTROL_INTERVAL = 0.010
"""Position control runs at 100 Hz, as PX4's does."""
OFFBOARD_TAKEOFF_AGE = 1.0
"""Only a setpoint younger than this [s] may start a take-off."""
REBOOT_TIME = 2.0
"""From the order to reboot until the autopilot's clock starts [s]."""
CLOCK_OFFSET = (20.0, 200.0)
CLOCK_DRIFT = 40e-6


@cache
def _default_parameters() -> dict[str, float | int]:
    text = (Path(__file__).parent / "px4_parameters.json").read_text(encoding="utf-8")
    values: dict[str, float | int] = json.loads(text)
    return values


@dataclass(frozen=True, slots=True, kw_only=True)
class BootClock:
    """The autopilot's clock: it started earlier than the simulation and runs a little fast or slow."""

    offset: float
    rate: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "BootClock":
        """Draw offset and drift."""
        return cls(offset=float(rng.uniform(*CLOCK_OFFSET)), rate=1.0 + float(rng.uniform(-CLOCK_DRIFT, CLOCK_DRIFT)))

    def at(self, t: float) -> float:
        """Time since boot [s] at simulation time `t` [s]."""
        return self.offset + self.rate * t


class Autopilot:
    """Everything between the MAVLink links and the rotors.

    `reset_rng` is for what only faults need (the direction of drift without GNSS).
    """

    def __init__(
        self,
        vehicle: VehicleConfig,
        body: RigidBody,
        faults: Faults,
        estimator_rng: np.random.Generator,
        reset_rng: np.random.Generator,
        clock: BootClock,
    ) -> None:
        self.parameters: dict[str, float | int] = dict(_default_parameters())
        unknown = set(vehicle.autopilot) - set(self.parameters)
        if unknown:
            raise ValueError(f"vehicle {vehicle.name}: unknown autopilot parameters {sorted(unknown)}")
        self.parameters.update(vehicle.autopilot)
        self._rotors_stop = vehicle.body.rotors_stop_on_termination
        self.body = body
        self.faults = faults
        self.clock = clock
        self.estimator = Estimator(vehicle.estimator, body, estimator_rng)
        self.estimate = self.estimator.estimate
        self.estimate_health = EstimateHealth(reset_rng)
        if not faults.gnss:
            self.estimate_health.without_position()
        self.battery = Battery(self.parameters)
        self.t = 0.0
        self.mode_count = 0
        """Mode changes so far: CURRENT_MODE is sent at once after one."""
        self.boot_count = 0
        """Reboots so far: links then forget what they were told."""
        self.running_from = 0.0
        """Simulation time [s] at which the last boot is over; before, motors and links are silent."""
        self.origin: Vector = (0.0, 0.0, 0.0)
        """Origin of the local frame [m], ned, from where it was at the first boot."""
        self._start()

    def _start(self) -> None:
        """Set up what begins anew with every boot."""
        self.surroundings = Surroundings(estimate=self.estimate_health, battery=self.battery)
        booted_at = self.t - self.boot_time
        self.commander = Commander(self.parameters, self.faults, self.surroundings, self.t, booted_at=booted_at)
        self.navigator = Navigator(self.parameters)
        self.control = FlightControl(self.parameters)
        self._offboard_setpoint = NO_SETPOINT
        self._offboard_setpoint_time = -math.inf
        self._mode = self.commander.mode
        self._armed = False
        self._position_time = self._position_due = self.t

    @property
    def landed(self) -> bool:
        """Whether the land detector is in its last stage."""
        return self.control.land_detector.landed

    @property
    def boot_time(self) -> float:
        """The autopilot's own time [s]."""
        return self.clock.at(self.t)

    @property
    def running(self) -> bool:
        """Whether the autopilot has booted."""
        return self.t >= self.running_from

    def range_reading(self) -> float:
        """One reading of the range finder [m]."""
        return self.estimate.range_down + self.estimator.range_noise()

    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""
        self.control.configure()

    def offboard_setpoint(self, setpoint: TrajectorySetpoint) -> None:
        """Take a setpoint from a companion; it is flown only in OFFBOARD, but always counts as signal."""
        self.commander.setpoint_arrived(
            position=_any(setpoint.position), velocity=_any(setpoint.velocity), acceleration=_any(setpoint.acceleration)
        )
        if self.commander.mode is Mode.OFFBOARD:
            self._offboard_setpoint = setpoint
            self._offboard_setpoint_time = self.t

    def landing_target(self, north: float, east: float, down: float) -> None:
        """Take a place of the landing target in the local frame; it is stamped with its arrival.

        PX4 maps the sender's stamp only where the sender answers its TIMESYNC, and counts the arrival otherwise.
        """
        pose = LandingTargetPose(t=self.boot_time, north=north, east=east, down=down)
        self.navigator.precision_landing.target_seen(pose)

    def inject(self, fault: Fault) -> None:
        """Put a fault in now; its time is not looked at."""
        if self.faults.apply(fault):
            return
        value = fault.value
        if fault.name == "position_jump" and isinstance(value, tuple):
            self.estimate_health.jump(value)
        elif fault.name == "heading_jump" and isinstance(value, float):
            self.estimate_health.turn(math.radians(value))
        elif fault.name == "battery" and isinstance(value, float):
            self.battery.set(0.01 * value)
        elif fault.name in ("kill", "unkill"):
            self.commander.request_kill(fault.name == "kill")
        elif fault.name == "reboot":
            self.reboot()

    def reboot(self) -> None:
        """Restart, also in flight: the motors stop, and nothing is known of what was before but the parameters."""
        self.running_from = self.t + REBOOT_TIME
        self.clock = BootClock(offset=-self.clock.rate * self.running_from, rate=self.clock.rate)
        self.boot_count += 1
        self.control.commands = list(OFF)

    def _boot(self) -> None:
        """The reboot is over: the local frame begins where the vehicle is now."""
        estimate = self.estimate
        self.origin = (
            self.origin[0] + estimate.north,
            self.origin[1] + estimate.east,
            self.origin[2] + estimate.down,
        )
        self.estimate_health.start(self.t, self.origin)
        self.battery.held = False
        self._start()

    def step(self, t: float, dt: float) -> list[float]:
        """Advance to `t` [s] by `dt` [s] with the body's present state; returns rotor commands 0 to 1."""
        was_running, self.t = self.running, t
        estimate = self.estimator.step(dt, self.body)
        self.estimate_health.apply(estimate)
        if not self.running:
            return OFF
        if not was_running:
            self._boot()
        self.estimate_health.step(t, dt, gnss=self.faults.gnss, vision=self.faults.vision)
        if self.estimate_health.resets:
            self._follow_resets()
        commander = self.commander
        self.battery.step(dt, armed=commander.armed)
        self.surroundings.landed, self.surroundings.position = self.landed, estimate.position
        commander.step(t)
        self._follow_mode()
        if t + 1e-9 >= self._position_due:
            elapsed = min(max(t - self._position_time, 0.002), 0.04)
            self._position_time = t
            self._position_due = max(self._position_due + POSITION_CONTROL_INTERVAL, t)
            self._position_control(elapsed)
        if commander.killed or (commander.mode is Mode.TERMINATION and self._rotors_stop):
            return OFF
        if commander.mode is Mode.TERMINATION:
            return self.control.commands
        return self.control.rate_step(estimate, armed=commander.armed, dt=dt)

    def _follow_resets(self) -> None:
        """Move stored setpoints along when the estimator jumps, as PX4 does; new ones are taken as they are."""
        for step, velocity_step in self.estimate_health.resets:
            self._offboard_setpoint = _moved(self._offboard_setpoint, step)
            self.navigator.follow_reset(step)
            self.control.follow_reset(velocity_step)
        self.estimate_health.resets.clear()

    def _follow_mode(self) -> None:
        commander = self.commander
        if commander.armed and not self._armed:
            self.navigator.home = self.surroundings.home = self.estimate.position
        self._armed = self.navigator.armed = commander.armed
        commander.notices.extend(self.navigator.take_notices())
        if commander.mode is self._mode:
            return
        self._mode = commander.mode
        self.mode_count += 1
        self.navigator.leave()
        if self._mode is Mode.OFFBOARD:
            # PX4 stops until the first setpoint after the switch
            self._offboard_setpoint = TrajectorySetpoint(velocity=(0.0, 0.0, 0.0))

    def _position_control(self, dt: float) -> None:
        commander, estimate = self.commander, self.estimate
        if commander.mode is Mode.OFFBOARD:
            setpoint = self._offboard_setpoint
            fresh = self.t - self._offboard_setpoint_time < OFFBOARD_TAKEOFF_AGE
            wants = commander.armed and fresh and _climbs(setpoint, estimate.down)
        else:
            self.navigator.t = self.boot_time
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


def _climbs(setpoint: TrajectorySetpoint, down: float) -> bool:
    """Whether an offboard setpoint asks to go up (mc_pos_control: want_takeoff). NaN compares false."""
    return setpoint.position[2] < down or setpoint.velocity[2] < 0.0 or setpoint.acceleration[2] < 0.0


def _any(vector: Vector) -> bool:
    """Whether any component is set."""
    return vector[0] == vector[0] or vector[1] == vector[1] or vector[2] == vector[2]


def _moved(setpoint: TrajectorySetpoint, step: Vector) -> TrajectorySetpoint:
    p0, p1, p2 = setpoint.position
    return replace(setpoint, position=(p0 + step[0], p1 + step[1], p2 + step[2]))
