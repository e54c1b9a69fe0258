"""The autopilot: commander and controllers around one estimate, stepped with the physics.

`Autopilot` is what all vehicles share; each kind of vehicle has a subclass with its controllers.
"""

import json
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.vehicle.attitude_setpoints import AttitudeTarget
from sitl_stub.vehicle.battery import Battery
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.ekf_resets import EstimateHealth
from sitl_stub.vehicle.estimator import Estimator
from sitl_stub.vehicle.faults import Fault, Faults
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.position_control import NO_SETPOINT, TrajectorySetpoint
from sitl_stub.vehicle.precision_landing import LandingTargetPose
from sitl_stub.vehicle.system_state import Surroundings

CONTROL_INTERVAL = 0.010
"""Position control runs at 100 Hz, as PX4's does."""
REBOOT_TIME = 2.0
"""From the order to reboot until the autopilot's clock starts [s]."""
CLOCK_OFFSET = (20.0, 200.0)
CLOCK_DRIFT = 40e-6


@cache
def _parameter_list(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "px4_parameters.json").read_text(encoding="utf-8"))
    return document


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


class Autopilot(ABC):
    """Everything between the MAVLink links and the actuators.

    `reset_rng` is for what only faults need (the direction of drift without GNSS).
    """

    commander_type: ClassVar[type[Commander]] = Commander
    """The commander of this kind of vehicle."""
    parameter_folder: ClassVar[Path | None] = None
    """Where a px4_parameters.json says which parameters this kind lacks (`without`) and has other `values` of."""

    def __init__(
        self,
        vehicle: VehicleFile,
        body: Body,
        faults: Faults,
        estimator_rng: np.random.Generator,
        reset_rng: np.random.Generator,
        clock: BootClock,
    ) -> None:
        self.parameters: dict[str, float | int] = self.default_parameters()
        unknown = set(vehicle.autopilot) - set(self.parameters)
        if unknown:
            raise ValueError(f"vehicle {vehicle.name}: unknown autopilot parameters {sorted(unknown)}")
        self.parameters.update(vehicle.autopilot)
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
        """Set up what begins anew with every boot; each kind of vehicle adds its controllers."""
        self.surroundings = Surroundings(estimate=self.estimate_health, battery=self.battery)
        booted_at = self.t - self.boot_time
        self.commander = self.commander_type(
            self.parameters, self.faults, self.surroundings, self.t, booted_at=booted_at
        )
        self._offboard_setpoint = NO_SETPOINT
        self._offboard_setpoint_time = -math.inf
        self._mode = self.commander.mode
        self._armed = False
        self._control_time = self._control_due = self.t

    def default_parameters(self) -> dict[str, float | int]:
        """Names and values of the parameters before the vehicle file changes some."""
        values: dict[str, float | int] = dict(_parameter_list(Path(__file__).parent))
        if self.parameter_folder is not None:
            own = _parameter_list(self.parameter_folder)
            for name in own["without"]:
                values.pop(name, None)
            values |= own["values"]
        return values

    # what each kind of vehicle does its own way

    @property
    @abstractmethod
    def landed(self) -> bool:
        """Whether the land detector is in its last stage."""

    @property
    @abstractmethod
    def landing(self) -> bool:
        """Whether a mode is coming down, or driving home, for good (EXTENDED_SYS_STATE says LANDING)."""

    @abstractmethod
    def parameter_changed(self) -> None:
        """Take over a parameter that was set from outside."""

    @abstractmethod
    def _target_seen(self, pose: LandingTargetPose) -> None:
        """Take where the target of a precision landing is."""

    @abstractmethod
    def _take_notices(self) -> list[Notice]:
        """Take what the automatic modes had to say since the last call."""

    @abstractmethod
    def _entered_mode(self) -> None:
        """React to another mode in force."""

    @abstractmethod
    def _follow_reset(self, step: Vector, velocity_step: Vector) -> None:
        """Move what is stored along with a jump of the estimated position [m] and velocity [m/s]."""

    @abstractmethod
    def _control(self, dt: float) -> None:
        """One step of control at 100 Hz, `dt` [s] after the last."""

    @abstractmethod
    def _actuate(self, dt: float) -> list[float]:
        """Commands to the body's actuators at every physics step."""

    @abstractmethod
    def _stop_actuators(self) -> list[float]:
        """Commands that stop all actuators: killed, or not booted."""

    @abstractmethod
    def _terminate_actuators(self) -> list[float]:
        """Commands of a terminated flight."""

    # what all share

    @property
    def home(self) -> Vector:
        """Where the vehicle was armed: Return goes there [m], local frame."""
        return self.surroundings.home

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

    def offboard_setpoint(self, setpoint: TrajectorySetpoint) -> None:
        """Take a setpoint from a companion; it is flown only in OFFBOARD, but always counts as signal."""
        self.commander.setpoint_arrived(
            position=_any(setpoint.position), velocity=_any(setpoint.velocity), acceleration=_any(setpoint.acceleration)
        )
        if self.commander.mode is Mode.OFFBOARD:
            self._offboard_setpoint = setpoint
            self._offboard_setpoint_time = self.t

    def attitude_target(self, target: AttitudeTarget) -> None:  # noqa: B027 - most kinds need none
        """Take an attitude setpoint: only the kinds of vehicles that fly on it do."""

    def landing_target(self, north: float, east: float, down: float) -> None:
        """Take a place of the landing target in the local frame; it is stamped with its arrival.

        PX4 maps the sender's stamp only where the sender answers its TIMESYNC, and counts the arrival otherwise.
        """
        pose = LandingTargetPose(t=self.boot_time, north=north, east=east, down=down)
        self._target_seen(pose)

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
        """Advance to `t` [s] by `dt` [s] with the body's present state; returns its actuators' commands."""
        was_running, self.t = self.running, t
        estimate = self.estimator.step(dt, self.body)
        self.estimate_health.apply(estimate)
        if not self.running:
            return self._stop_actuators()
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
        if t + 1e-9 >= self._control_due:
            elapsed = min(max(t - self._control_time, 0.002), 0.04)
            self._control_time = t
            self._control_due = max(self._control_due + CONTROL_INTERVAL, t)
            self._control(elapsed)
        if commander.killed:
            return self._stop_actuators()
        if commander.mode is Mode.TERMINATION:
            return self._terminate_actuators()
        return self._actuate(dt)

    def _follow_resets(self) -> None:
        """Move stored setpoints along when the estimator jumps, as PX4 does; new ones are taken as they are."""
        for step, velocity_step in self.estimate_health.resets:
            self._offboard_setpoint = _moved(self._offboard_setpoint, step)
            self._follow_reset(step, velocity_step)
        self.estimate_health.resets.clear()

    def _follow_mode(self) -> None:
        commander = self.commander
        if commander.armed and not self._armed:
            self.surroundings.home = self.estimate.position
        self._armed = commander.armed
        commander.notices.extend(self._take_notices())
        if commander.mode is self._mode:
            return
        self._mode = commander.mode
        self.mode_count += 1
        self._entered_mode()
        if self._mode is Mode.OFFBOARD:
            # PX4 stops until the first setpoint after the switch
            self._offboard_setpoint = TrajectorySetpoint(velocity=(0.0, 0.0, 0.0))


def _any(vector: Vector) -> bool:
    """Whether any component is set."""
    return vector[0] == vector[0] or vector[1] == vector[1] or vector[2] == vector[2]


def _moved(setpoint: TrajectorySetpoint, step: Vector) -> TrajectorySetpoint:
    p0, p1, p2 = setpoint.position
    return replace(setpoint, position=(p0 + step[0], p1 + step[1], p2 + step[2]))
