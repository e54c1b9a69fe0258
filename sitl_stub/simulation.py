"""One simulated flight in memory: world, vehicle and autopilot in lockstep, no clock, no sockets."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from sitl_stub.truth import TargetTruth, Truth, Vector, VehicleTruth
from sitl_stub.vehicle.autopilot import BootClock
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.faults import Fault, Faults
from sitl_stub.vehicle.kinds import kind_of
from sitl_stub.vehicle.mavlink_io import PORTS, Links, Port

if TYPE_CHECKING:
    from sitl_stub.world.camera import Frame

STEP = 0.004
"""Physics step [s]."""
CameraKind = Literal["rendered", "corners"]


class WorldTargets(Protocol):
    """The platforms of a running world."""

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        """Move all platforms on to `t` [s]."""

    def truths(self) -> tuple[TargetTruth, ...]:
        """Give the platforms' states."""

    def surface_under(self, north: float, east: float) -> tuple[float, str, Vector, float]:
        """Give down coordinate, name, velocity there, and yaw rate of what lies under a point."""


class WorldWind(Protocol):
    """The wind of a running world."""

    @property
    def mean_speed(self) -> float:
        """Mean of the horizontal wind [m/s], drawn at the start."""

    def step(self, dt: float) -> Vector:
        """Move on by `dt` [s] and give the air's velocity [m/s], ned."""


class WorldCamera(Protocol):
    """The camera of a running world."""

    def step(self, t: float, truth: Truth) -> None:
        """Look at the world at `t` [s]."""

    def frames(self, t: float) -> "Sequence[Frame]":
        """Give the frames whose delivery time has come."""


class WorldRanging(Protocol):
    """The ranging radios of a running world."""

    def step(self, truth: Truth, antenna_frd: Vector) -> None:
        """Measure what is due, from the vehicle's antenna [m], forward, right, down of the body origin."""

    def take(self, t: float) -> list[bytes]:
        """Take the packets that have arrived."""


class RunningWorld(Protocol):
    """A world with its dice thrown."""

    @property
    def targets(self) -> WorldTargets:
        """Platforms."""

    @property
    def wind(self) -> WorldWind:
        """Moving air."""

    @property
    def camera(self) -> WorldCamera:
        """The vehicle's camera."""

    @property
    def ranging(self) -> WorldRanging | None:
        """Its ranging radios; None: there are none."""


class World(Protocol):
    """A world file, ready to be started."""

    def start(
        self, seeds: np.random.SeedSequence, camera: CameraKind, camera_parameters: Mapping[str, Any]
    ) -> RunningWorld:
        """Throw the dice."""


class Simulation:
    """A vehicle in a world. Same arguments, same bytes out for the same bytes in.

    `faults` are words as `Fault.parse` takes them; those with a time happen then. Simulation time starts at 0 with the
    vehicle at rest on the ground at the world's origin, its autopilot booted and its estimate valid.
    """

    def __init__(
        self,
        world: World,
        vehicle: VehicleFile,
        seed: int,
        camera: CameraKind = "corners",
        *,
        faults: Sequence[str] = (),
    ) -> None:
        world_seeds, start_seeds, estimator_seeds, reset_seeds = np.random.SeedSequence(seed).spawn(4)
        dice = np.random.default_rng(start_seeds)
        low, high = vehicle.start_heading_deg
        heading = float(np.radians(dice.uniform(low, high)))
        self.t = 0.0
        """Simulation time [s]."""
        self._steps = 0
        self._world = world.start(world_seeds, camera, vehicle.camera)
        self._antenna = vehicle.antenna_frd_m
        kind = kind_of(vehicle)
        self.body = kind.body(vehicle, heading)
        self.autopilot = kind.autopilot(
            vehicle,
            self.body,
            Faults.parse(faults),
            np.random.default_rng(estimator_seeds),
            np.random.default_rng(reset_seeds),
            BootClock.draw(dice),
        )
        self._faults = sorted(map(Fault.parse, faults), key=lambda fault: fault.t)
        for fault in [f for f in self._faults if f.t == 0.0]:
            self.inject(fault)
        self._faults = [f for f in self._faults if f.t > 0.0]
        self._links = Links(self.autopilot, kind.telemetry(self.autopilot))
        self._truth = self._look()

    def advance(self, until: float) -> None:
        """Run physics up to `until` [s], in whole steps; never beyond."""
        world, body, autopilot, links = self._world, self.body, self.autopilot, self._links
        targets, wind, camera, ranging = world.targets, world.wind, world.camera, world.ranging
        last = int(until / STEP + 1e-6)
        while self._steps < last:
            self._steps += 1
            self.t = t = self._steps * STEP
            targets.step(t, self._truth.vehicle)
            air = wind.step(STEP)
            while self._faults and self._faults[0].t <= t:
                autopilot.inject(self._faults.pop(0))
            body.step(STEP, autopilot.step(t, STEP), air, targets.surface_under)
            self._truth = truth = self._look()
            camera.step(t, truth)
            if ranging is not None:
                ranging.step(truth, self._antenna)
            links.step()

    def inject(self, fault: Fault | str) -> None:
        """Put a fault in, now or at its time; a word is read by `Fault.parse`, which raises `FaultError`."""
        if isinstance(fault, str):
            fault = Fault.parse(fault)
        if fault.t <= self.t:
            self.autopilot.inject(fault)
        else:
            self._faults = sorted([*self._faults, fault], key=lambda f: f.t)

    def receive(self, port: Port, datagram: bytes) -> None:
        """Hand a datagram to the autopilot; it acts on it at once, answers come with the next step."""
        if port not in PORTS:
            raise ValueError(f"port {port!r}: expected one of {PORTS}")
        self._links[port].receive(datagram)

    def transmit(self, port: Port) -> list[bytes]:
        """Take the datagrams sent since the last call, one MAVLink frame each. The first call opens the telemetry."""
        return self._links[port].take()

    def frames(self) -> "Sequence[Frame]":
        """Take the camera frames that have been delivered since the last call."""
        return self._world.camera.frames(self.t)

    def ranges(self) -> list[bytes]:
        """Take the packets of the ranging radio that have arrived since the last call."""
        ranging = self._world.ranging
        return [] if ranging is None else ranging.take(self.t)

    @property
    def mean_wind(self) -> float:
        """Mean of the horizontal wind [m/s] in this flight."""
        return self._world.wind.mean_speed

    def truth(self) -> Truth:
        """Give the true state at `t`."""
        return self._truth

    def _look(self) -> Truth:
        body = self.body
        vehicle = VehicleTruth(
            t=self.t,
            position_ned=body.position,
            velocity_ned=body.velocity,
            quaternion=body.quaternion,
            angular_velocity_frd=(body.p, body.q, body.r),
            acceleration_ned=body.acceleration,
            feet_in_contact=body.gear.count,
            surface=body.gear.surface,
            armed=self.autopilot.commander.armed,
        )
        return Truth(t=self.t, vehicle=vehicle, targets=self._world.targets.truths())
