"""A bare world and a scripted client for tests of the vehicle half."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.simulation import Simulation
from sitl_stub.truth import GROUND, Truth, VehicleTruth
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.mavlink_io import split_frames

CALM = (0.0, 0.0, 0.0)


@dataclass
class BareTargets:
    """Flat ground, or one platform 0.8 m wide that moves north."""

    platform_top: float | None = None
    speed: float = 0.0
    north: float = 0.0
    t: float = 0.0

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        self.north += self.speed * (t - self.t)
        self.t = t

    def truths(self) -> tuple[()]:
        return ()

    def surface_under(self, north: float, east: float) -> tuple[float, str, tuple[float, float, float], float]:
        if self.platform_top is not None and abs(north - self.north) <= 0.4 and abs(east) <= 0.4:
            return (-self.platform_top, "pad", (self.speed, 0.0, 0.0), 0.0)
        return (0.0, GROUND, CALM, 0.0)


@dataclass
class SteadyWind:
    air: tuple[float, float, float] = CALM

    def step(self, dt: float) -> tuple[float, float, float]:
        return self.air


class NoCamera:
    def step(self, t: float, truth: Truth) -> None:
        pass

    def frames(self, t: float) -> list[Any]:
        return []


@dataclass
class BareWorld:
    """A world without dice."""

    targets: BareTargets = field(default_factory=BareTargets)
    wind: SteadyWind = field(default_factory=SteadyWind)
    camera: NoCamera = field(default_factory=NoCamera)
    ranging: None = None

    def start(self, seeds: np.random.SeedSequence, camera: str, camera_parameters: Mapping[str, Any]) -> "BareWorld":
        return self


def vehicle(*, wander: bool = True) -> VehicleConfig:
    from dataclasses import replace

    config = VehicleConfig.load("x500")
    return config if wander else replace(config, estimator=replace(config.estimator, enabled=False))


class Client:
    """Speaks MAVLink with the simulation in memory, as a companion at 50 Hz."""

    def __init__(self, simulation: Simulation, port: str = "onboard", *, kind: int = 18) -> None:
        self.simulation = simulation
        self.port = port
        self.kind = kind
        self.mav = mavlink.MAVLink(
            None, srcSystem=1 if port == "onboard" else 255, srcComponent=191 if port == "onboard" else 190
        )
        self.parser = mavlink.MAVLink(None)
        self.heard: dict[str, Any] = {}
        self.log: list[tuple[float, Any]] = []
        self.raw: list[bytes] = []
        self.stream: Callable[[float], dict[str, Any]] | None = None
        self.ticks = 0
        self.partners: list[Client] = []
        """Others at the same vehicle, whose heartbeats go on while this one lets time pass."""

    def send(self, message: Any) -> None:
        self.simulation.receive(self.port, bytes(message.pack(self.mav)))
        self.mav.seq = (self.mav.seq + 1) % 256

    def setpoint(self, *, position=None, velocity=None, acceleration=None, yaw=0.0, frame=1) -> dict[str, Any]:
        mask = (
            2048
            | (7 if position is None else 0)
            | (56 if velocity is None else 0)
            | (448 if acceleration is None else 0)
        )
        return {
            "p": position or (0, 0, 0),
            "v": velocity or (0, 0, 0),
            "a": acceleration or (0, 0, 0),
            "yaw": yaw,
            "mask": mask,
            "frame": frame,
        }

    def send_setpoint(self, s: dict[str, Any]) -> None:
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, s["frame"], s["mask"], *s["p"], *s["v"], *s["a"], s["yaw"], 0.0
        )
        self.send(message)

    def command(self, command: int, *parameters: float) -> list[int]:
        """Send a command and return the results acknowledged within 20 ms."""
        values = list(parameters) + [0.0] * (7 - len(parameters))
        before = len(self.log)
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *values))
        self.run(0.02)
        return [m.result for _, m in self.log[before:] if m.get_type() == "COMMAND_ACK" and m.command == command]

    def arm(self) -> list[int]:
        return self.command(400, 1)

    def mode(self, main: int, sub: int = 0) -> list[int]:
        return self.command(176, 1, main, sub)

    def run(self, duration: float, until: Callable[[], bool] | None = None) -> float:
        """Run at 50 Hz, streaming; return the time taken."""
        start = self.simulation.t
        while self.simulation.t < start + duration - 1e-9:
            if self.stream is not None:
                self.send_setpoint(self.stream(self.simulation.t))
            if self.ticks % 50 == 0:
                for client in (self, *self.partners):
                    client.send(mavlink.MAVLink_heartbeat_message(client.kind, 8, 0, 0, 4, 3))
            self.ticks += 1
            self.simulation.advance(self.simulation.t + 0.02)
            self.read()
            if until is not None and until():
                break
        return self.simulation.t - start

    def read(self) -> None:
        for datagram in self.simulation.transmit(self.port):
            self.raw.append(datagram)
            for frame in split_frames(datagram):
                if frame[7] | frame[8] << 8 == 410:
                    self.log.append((self.simulation.t, EventFrame(frame)))
                    continue
                message = self.parser.decode(bytearray(frame))
                self.heard[message.get_type()] = message
                self.log.append((self.simulation.t, message))

    def of(self, kind: str) -> list[Any]:
        return [m for _, m in self.log if m.get_type() == kind]

    @property
    def truth(self) -> VehicleTruth:
        return self.simulation.truth().vehicle

    def take_off(self, height: float = 3.0, yaw: float | None = None) -> None:
        """Arm and climb in OFFBOARD; leaves a position setpoint streaming."""
        self.run(0.1)
        heading = self.heard["ATTITUDE"].yaw if yaw is None else yaw
        goal = self.setpoint(position=(0.0, 0.0, -height), yaw=heading)
        self.stream = lambda t: goal
        self.run(0.5)
        assert self.mode(6) == [0, 0]
        assert self.arm() == [0]
        self.run(20.0, lambda: self.heard["LOCAL_POSITION_NED"].z < -height + 0.2)
        assert self.heard["LOCAL_POSITION_NED"].z < -height + 0.3


class EventFrame:
    """An EVENT message, decoded by hand."""

    def __init__(self, frame: bytes) -> None:
        import struct

        payload = frame[10 : 10 + frame[1]].ljust(53, b"\0")
        self.id, self.event_time_boot_ms, self.sequence = struct.unpack("<IIH", payload[:10])
        self.log_levels = payload[12]

    def get_type(self) -> str:
        return "EVENT"


def tilt(quaternion: tuple[float, float, float, float]) -> float:
    """Angle between the body's and the world's vertical [rad]."""
    _, x, y, _ = quaternion
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
