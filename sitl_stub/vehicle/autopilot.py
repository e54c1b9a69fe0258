"""The autopilot: commander and controllers around one estimate, stepped with the physics.

`Autopilot` is what all vehicles share; each kind of vehicle has a subclass with its controllers.
"""

import json
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.estimator import Estimator
from sitl_stub.vehicle.faults import Faults
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.position_control import NO_SETPOINT, TrajectorySetpoint

if TYPE_CHECKING:
    from sitl_stub.vehicle.telemetry import Telemetry

CONTROL_INTERVAL = 0.010
"""Position control runs at 100 Hz, as PX4's does."""
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


class Autopilot(ABC):
    """Everything between the MAVLink links and the actuators."""

    commander_type: ClassVar[type[Commander]] = Commander
    """The commander of this kind of vehicle."""

    def __init__(
        self,
        vehicle: VehicleFile,
        body: Body,
        faults: Faults,
        estimator_rng: np.random.Generator,
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
        self.home: Vector = (0.0, 0.0, 0.0)
        """Where the vehicle was armed: Return goes there [m], local frame."""
        self.t = 0.0
        self.battery = 1.0
        self.mode_count = 0
        """Mode changes so far: CURRENT_MODE is sent at once after one."""
        self._start()

    def _start(self) -> None:
        """Set up what begins anew with every boot; each kind of vehicle adds its controllers."""
        self.commander = self.commander_type(self.parameters, self.faults.refuse_arming)
        self._offboard_setpoint = NO_SETPOINT
        self._offboard_setpoint_time = -math.inf
        self._mode = self.commander.mode
        self._armed = False
        self._control_time = 0.0
        self._control_due = 0.0

    # what each kind of vehicle does its own way

    def default_parameters(self) -> dict[str, float | int]:
        """Names and values of the parameters before the vehicle file changes some."""
        return dict(_default_parameters())

    @abstractmethod
    def telemetry(self) -> "Telemetry":
        """Make what turns this autopilot's state into messages."""

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
    def _entered_mode(self) -> None:
        """React to another mode in force."""

    @abstractmethod
    def _control(self, dt: float) -> None:
        """One step of control at 100 Hz, `dt` [s] after the last."""

    @abstractmethod
    def _actuate(self, dt: float) -> list[float]:
        """Commands to the body's actuators at every physics step."""

    @abstractmethod
    def _stop_actuators(self) -> list[float]:
        """Commands of a terminated flight."""

    # what all share

    @property
    def boot_time(self) -> float:
        """The autopilot's own time [s]."""
        return self.clock.at(self.t)

    def range_reading(self) -> float:
        """One reading of the range finder [m]."""
        return self.estimate.range_down + self.estimator.range_noise()

    def offboard_setpoint(self, setpoint: TrajectorySetpoint) -> None:
        """Take a setpoint from a companion; it is flown only in OFFBOARD, but always counts as signal."""
        self.commander.setpoint_arrived()
        if self.commander.mode is Mode.OFFBOARD:
            self._offboard_setpoint = setpoint
            self._offboard_setpoint_time = self.t

    def step(self, t: float, dt: float) -> list[float]:
        """Advance to `t` [s] by `dt` [s] with the body's present state; returns its actuators' commands."""
        self.t = t
        self.estimator.step(dt, self.body)
        commander = self.commander
        commander.step(t, landed=self.landed)
        self._follow_mode()
        if t + 1e-9 >= self._control_due:
            elapsed = min(max(t - self._control_time, 0.002), 0.04)
            self._control_time = t
            self._control_due = max(self._control_due + CONTROL_INTERVAL, t)
            self._control(elapsed)
        if commander.armed:
            self.battery = max(0.0, self.battery - dt / BATTERY_TIME * (not self.landed))
        if commander.mode is Mode.TERMINATION:
            return self._stop_actuators()
        return self._actuate(dt)

    def _follow_mode(self) -> None:
        commander = self.commander
        if commander.armed and not self._armed:
            self.home = self.estimate.position
        self._armed = commander.armed
        if commander.mode is self._mode:
            return
        self._mode = commander.mode
        self.mode_count += 1
        self._entered_mode()
        if self._mode is Mode.OFFBOARD:
            # PX4 stops until the first setpoint after the switch
            self._offboard_setpoint = TrajectorySetpoint(velocity=(0.0, 0.0, 0.0))
