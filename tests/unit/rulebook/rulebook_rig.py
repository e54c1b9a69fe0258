"""The companion's link and guardian against the simulated PX4, in memory, at 50 Hz."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.guardian.guardian import Guardian
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.parameters import GuardianParameters
from companion.link.autopilot_link import AutopilotLink
from companion.link.parameters import LinkParameters
from companion.messages.guardian import GuardianState
from companion.messages.motion import MotionState
from companion.messages.ownship import FlightMode
from companion.vehicles.multicopter import Multicopter
from sitl_stub.simulation import Simulation
from sitl_stub.truth import GROUND, Truth, VehicleTruth
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.mavlink_io import split_frames

DT = 0.02
CALM = (0.0, 0.0, 0.0)


@dataclass
class EmptyWorld:
    """Flat ground, no wind, no camera; it plays all parts of a world itself."""

    @property
    def targets(self) -> "EmptyWorld":
        return self

    @property
    def wind(self) -> "Calm":
        return Calm()

    @property
    def camera(self) -> "Blind":
        return Blind()

    @property
    def ranging(self) -> None:
        return None

    def start(self, seeds: np.random.SeedSequence, camera: str, parameters: Mapping[str, Any]) -> "EmptyWorld":
        return self

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        pass

    def truths(self) -> tuple[()]:
        return ()

    def surface_under(self, north: float, east: float) -> tuple[float, str, tuple[float, float, float], float]:
        return (0.0, GROUND, CALM, 0.0)


class Calm:
    def step(self, dt: float) -> tuple[float, float, float]:
        return CALM


class Blind:
    def step(self, t: float, truth: Truth) -> None:
        pass

    def frames(self, t: float) -> list[Any]:
        return []


@dataclass(frozen=True)
class StandStill:
    """A plan to stay where the vehicle is, in the frame of one reset counter."""

    here: MotionState
    reset_counter: int
    t_start: float = -1e9
    t_end: float = 1e9
    t_expiry: float = 1e9

    def at(self, t: float) -> MotionState:
        return self.here


@dataclass(frozen=True)
class Ahead(StandStill):
    """A plan to go north at 1 m/s from where the vehicle was at `since` [s]."""

    since: float = 0.0

    def at(self, t: float) -> MotionState:
        velocity = np.array([1.0, 0.0, 0.0])
        return replace(
            self.here, position_ned=self.here.position_ned + (t - self.since) * velocity, velocity_ned=velocity
        )


@dataclass
class Rig:
    """Everything between the guardian and the vehicle's rotors."""

    simulation: Simulation = field(default_factory=lambda: Simulation(EmptyWorld(), still_vehicle(), 1))
    planning: bool = False

    def __post_init__(self) -> None:
        self.link = AutopilotLink(LinkParameters())
        self.guardian = Guardian(GuardianParameters(), HolonomicShaper(Multicopter().limits))
        self.parser = mavlink.MAVLink(None)
        self.sent: list[tuple[float, Any]] = []
        self.ownship: Any = None
        self.trajectory: Any = None
        self.out: Any = None
        self.out_log: list[Any] = []

    @property
    def t(self) -> float:
        return self.simulation.t

    @property
    def mode(self) -> str:
        return str(self.simulation.autopilot.commander.mode.name)

    def of(self, kind: str) -> list[Any]:
        return [message for _, message in self.sent if message.get_type() == kind]

    def send(self, datagram: bytes) -> None:
        for frame in split_frames(datagram):
            self.sent.append((self.t, self.parser.decode(bytearray(frame))))
        self.simulation.receive("onboard", datagram)

    def tick(self) -> None:
        self.simulation.advance(self.t + DT)
        for datagram in self.simulation.transmit("onboard"):
            self.link.receive(datagram, self.t)
        states = self.link.take_ownship()
        self.ownship = states[-1] if states else self.ownship
        if self.planning and (self.trajectory is None or self.trajectory.reset_counter != self.ownship.reset_counter):
            self.trajectory = self._stand_still()
        self.out = self.guardian.tick(self.t, self.ownship, self.link.status(self.t), self.trajectory, None)
        self.out_log.append(self.out)
        if self.out.setpoint is not None:
            self.send(self.link.setpoint(self.out.setpoint, self.t))
        if self.out.request is not None:
            self.link.request_mode(self.out.request.mode, self.t)
        for datagram in self.link.poll(self.t):
            self.send(datagram)

    def _stand_still(self) -> StandStill:
        here = MotionState(
            position_ned=self.ownship.position_ned,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=self.simulation.autopilot.estimate.yaw,
            yaw_rate=0.0,
        )
        return StandStill(here, self.ownship.reset_counter)

    def run(self, seconds: float, until: Any = None) -> float:
        start = self.t
        while self.t < start + seconds - 1e-9:
            self.tick()
            if until is not None and until():
                break
        return self.t - start

    def in_offboard(self) -> "Rig":
        """Armed, flying in Hold at 2.5 m by the ground station's hand, then engaged and following a plan."""
        self.run(3.0)
        self.command(22)
        self.command(400, 1.0)
        self.run(20.0, lambda: self.mode == "AUTO_LOITER" and not self.simulation.autopilot.landed)
        self.run(3.0)
        self.guardian.engage(self.t)
        self.run(5.0, lambda: self.out.state is GuardianState.HOLDING)
        assert self.out.state is GuardianState.HOLDING, self.out
        assert self.mode == "OFFBOARD"
        self.planning = True
        self.run(0.5)
        assert self.out.state is GuardianState.FOLLOWING, self.out
        return self

    def command(self, number: int, *parameters: float) -> None:
        """A command of the ground station."""
        values = (*parameters, *([0.0] * (7 - len(parameters))))
        ground = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *values)
        self.simulation.receive("ground", bytes(message.pack(ground)))

    def ground_mode(self, mode: FlightMode) -> None:
        """A mode that the ground station asks for."""
        sub = {FlightMode.AUTO_LOITER: 3, FlightMode.AUTO_LAND: 6, FlightMode.AUTO_RTL: 5}[mode]
        self.command(176, 1.0, 4.0, float(sub))


def still_vehicle() -> VehicleConfig:
    """An X500 whose estimate does not wander."""
    config = VehicleConfig.load("x500")
    return replace(config, estimator=replace(config.estimator, enabled=False))
