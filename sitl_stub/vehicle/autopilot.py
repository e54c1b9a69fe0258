"""The autopilot: commander, navigator and controllers around one estimate, stepped with the physics."""

import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.estimator import Estimator
from sitl_stub.vehicle.faults import Faults
from sitl_stub.vehicle.flight_control import OFF, FlightControl
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.navigator import Navigator
from sitl_stub.vehicle.position_control import NO_SETPOINT, TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.rigid_body import RigidBody

POSITION_CONTROL_INTERVAL = 0.010
"""Position control runs at 100 Hz, as PX4's does."""
OFFBOARD_TAKEOFF_AGE = 1.0
"""Only a setpoint younger than this [s] may start a take-off."""
BATTERY_TIME = 1500.0
"""A full battery lasts so long in the air [s]."""
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
    """Everything between the MAVLink links and the rotors."""

    def __init__(
        self,
        vehicle: VehicleConfig,
        body: RigidBody,
        faults: Faults,
        estimator_rng: np.random.Generator,
        clock: BootClock,
    ) -> None:
        self.parameters: dict[str, float | int] = dict(_default_parameters())
        unknown = set(vehicle.autopilot) - set(self.parameters)
        if unknown:
            raise ValueError(f"vehicle {vehicle.name}: unknown autopilot parameters {sorted(unknown)}")
        self.parameters.update(vehicle.autopilot)
        self.body = body
        self.faults = faults
        self.clock = clock
        self.estimator = Estimator(vehicle.estimator, body, estimator_rng)
        self.estimate = self.estimator.estimate
        self.commander = Commander(self.parameters, faults.refuse_arming)
        self.navigator = Navigator(self.parameters)
        self.control = FlightControl(self.parameters)
        self.t = 0.0
        self.battery = 1.0
        self.mode_count = 0
        """Mode changes so far: CURRENT_MODE is sent at once after one."""
        self._offboard_setpoint = NO_SETPOINT
        self._offboard_setpoint_time = -math.inf
        self._mode = self.commander.mode
        self._armed = False
        self._position_time = 0.0
        self._position_due = 0.0

    @property
    def landed(self) -> bool:
        """Whether the land detector is in its last stage."""
        return self.control.land_detector.landed

    @property
    def boot_time(self) -> float:
        """The autopilot's own time [s]."""
        return self.clock.at(self.t)

    def range_reading(self) -> float:
        """One reading of the range finder [m]."""
        return self.estimate.range_down + self.estimator.range_noise()

    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""
        self.control.configure()

    def offboard_setpoint(self, setpoint: TrajectorySetpoint) -> None:
        """Take a setpoint from a companion; it is flown only in OFFBOARD, but always counts as signal."""
        self.commander.setpoint_arrived()
        if self.commander.mode is Mode.OFFBOARD:
            self._offboard_setpoint = setpoint
            self._offboard_setpoint_time = self.t

    def landing_target(self, north: float, east: float, down: float) -> None:
        """Take a place of the landing target in the local frame; it is stamped with its arrival.

        PX4 maps the sender's stamp only where the sender answers its TIMESYNC, and counts the arrival otherwise.
        """
        pose = LandingTargetPose(t=self.boot_time, north=north, east=east, down=down)
        self.navigator.precision_landing.target_seen(pose)

    def step(self, t: float, dt: float) -> list[float]:
        """Advance to `t` [s] by `dt` [s] with the body's present state; returns rotor commands 0 to 1."""
        self.t = t
        estimate = self.estimator.step(dt, self.body)
        commander = self.commander
        commander.step(t, landed=self.landed)
        self._follow_mode()
        if t + 1e-9 >= self._position_due:
            elapsed = min(max(t - self._position_time, 0.002), 0.04)
            self._position_time = t
            self._position_due = max(self._position_due + POSITION_CONTROL_INTERVAL, t)
            self._position_control(elapsed)
        if commander.armed:
            self.battery = max(0.0, self.battery - dt / BATTERY_TIME * (not self.landed))
        if commander.mode is Mode.TERMINATION:
            return OFF
        return self.control.rate_step(estimate, armed=commander.armed, dt=dt)

    def _follow_mode(self) -> None:
        commander = self.commander
        if commander.armed and not self._armed:
            self.navigator.home = self.estimate.position
        self._armed = commander.armed
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
                commander.mode, estimate, commander.sticks, in_air=not self.landed and commander.armed, dt=dt
            )
            wants = wants and commander.armed
            if self.navigator.takeoff_done and commander.intended is Mode.AUTO_TAKEOFF:
                commander.request_mode(Mode.AUTO_LOITER)
        self.control.position_step(estimate, setpoint, armed=commander.armed, wants_takeoff=wants, dt=dt)


def _climbs(setpoint: TrajectorySetpoint, down: float) -> bool:
    """Whether an offboard setpoint asks to go up (mc_pos_control: want_takeoff). NaN compares false."""
    return setpoint.position[2] < down or setpoint.velocity[2] < 0.0 or setpoint.acceleration[2] < 0.0
