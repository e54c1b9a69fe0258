"""The platforms of a world: where they stand, when they start, how they move, what lies under a point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sitl_stub.truth import GROUND, TargetTruth, Vector, VehicleTruth
from sitl_stub.world.documents import Interval
from sitl_stub.world.motion import MotionConfig, make_body, make_driver
from sitl_stub.world.pads import Pad

_MOVING_SPEED = 1e-3  # [m/s]
_MOVING_TURN_RATE = 1e-3  # [rad/s]

Surface = tuple[float, str, Vector, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class StartCondition:
    """When a platform begins to move: the vehicle has been above a height and near, without a break, for a time."""

    vehicle_above: float  # [m] above the ground; -inf: anywhere
    after: float  # [s]
    vehicle_within: float = math.inf  # [m] of its middle, horizontally; inf: anywhere

    @property
    def timed(self) -> bool:
        """Whether the time alone counts."""
        return not math.isfinite(self.vehicle_above) and not math.isfinite(self.vehicle_within)


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetConfig:
    """One platform of a world file."""

    name: str
    pad: Pad
    height: float  # [m] top surface above the ground; 0 for a body, which stands on it
    sides: bool  # whether the platform has visible sides down to the ground; never so for a body: it has faces
    north: Interval  # [m] board centre at the start
    east: Interval  # [m]
    heading: Interval  # [rad] of the board's x
    starts: StartCondition
    motion: MotionConfig


class Target:
    """One platform in motion. The board's centre is the point that drives; the landing point rides on it."""

    def __init__(self, config: TargetConfig, rng: np.random.Generator) -> None:
        self.config = config
        self._body = make_body(
            config.motion,
            north=config.north.draw(rng),
            east=config.east.draw(rng),
            heading=config.heading.draw(rng),
            rng=rng,
        )
        self._duration = config.motion.duration.draw(rng) if math.isfinite(config.motion.duration.high) else math.inf
        self._driver = make_driver(config.motion, rng) if config.motion.kind != "static" else None
        self._half = (0.5 * config.pad.size[0], 0.5 * config.pad.size[1])
        self._t = 0.0
        self._condition_since: float | None = None
        self._t_start: float | None = None
        self._cos = math.cos(self._body.heading)
        self._sin = math.sin(self._body.heading)
        self._truth: TargetTruth | None = None

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        """Move on to `t` [s]."""
        dt = t - self._t
        self._t = t
        self._truth = None
        driver = self._driver
        if driver is None or dt <= 0.0:
            return
        if self._t_start is None:
            if not self._condition_met(t, vehicle):
                return
            self._t_start = t
        body = self._body
        elapsed = t - self._t_start
        if elapsed < self._duration:
            speed, turn_rate = driver.command(elapsed)
            body.drive(dt, speed, turn_rate)
        else:
            body.stop(dt)
        self._cos = math.cos(body.heading)
        self._sin = math.sin(body.heading)

    def _condition_met(self, t: float, vehicle: VehicleTruth) -> bool:
        starts = self.config.starts
        away = math.dist(vehicle.position_ned[:2], (self._body.north, self._body.east))
        if -vehicle.position_ned[2] < starts.vehicle_above or away > starts.vehicle_within:
            self._condition_since = None
            return False
        if self._condition_since is None:
            self._condition_since = 0.0 if starts.timed else t
        return t - self._condition_since >= starts.after

    def truth(self) -> TargetTruth:
        """Give the state at the newest step."""
        if self._truth is None:
            body, pad = self._body, self.config.pad
            x, y = pad.landing_point
            north, east = self._cos * x - self._sin * y, self._sin * x + self._cos * y
            velocity_north, velocity_east = self._velocity(north, east)
            self._truth = TargetTruth(
                t=self._t,
                name=self.config.name,
                position_ned=(body.north + north, body.east + east, -self.config.height),
                yaw=body.heading + pad.landing_heading,
                velocity_ned=(velocity_north, velocity_east, 0.0),
                yaw_rate=body.turn_rate,
                half_size=self._half,
                moving=abs(body.speed) > _MOVING_SPEED or abs(body.turn_rate) > _MOVING_TURN_RATE,
                started=self._t_start is not None,
            )
        return self._truth

    def _velocity(self, north: float, east: float) -> tuple[float, float]:
        """Give the velocity of the point that is `north`, `east` [m] of the board's centre."""
        speed, turn_rate = self._body.speed, self._body.turn_rate
        return speed * self._cos - turn_rate * east, speed * self._sin + turn_rate * north

    def surface(self, north: float, east: float) -> Surface | None:
        """Give the top surface where the platform lies under the point, else None; see `Targets.surface_under`.

        A body has no top to stand on.
        """
        if self.config.pad.faces:
            return None
        d_north, d_east = north - self._body.north, east - self._body.east
        if (
            abs(self._cos * d_north + self._sin * d_east) > self._half[0]
            or abs(self._cos * d_east - self._sin * d_north) > self._half[1]
        ):
            return None
        velocity_north, velocity_east = self._velocity(d_north, d_east)
        return -self.config.height, self.config.name, (velocity_north, velocity_east, 0.0), self._body.turn_rate


class Targets:
    """All platforms of a world."""

    _GROUND: Surface = (0.0, GROUND, (0.0, 0.0, 0.0), 0.0)

    def __init__(self, configs: Sequence[TargetConfig], rng: np.random.Generator) -> None:
        self._targets = tuple(Target(config, own) for config, own in zip(configs, rng.spawn(len(configs)), strict=True))

    def step(self, t: float, vehicle: VehicleTruth) -> None:
        """Move all platforms on to `t` [s]; `vehicle` decides whether waiting ones start."""
        for target in self._targets:
            target.step(t, vehicle)

    def truths(self) -> tuple[TargetTruth, ...]:
        """Give the states at the newest step, in the order of the world file."""
        return tuple([target.truth() for target in self._targets])

    def surface_under(self, north: float, east: float) -> Surface:
        """Give what lies under a point [m], frame ned.

        Returns the surface's down coordinate [m], its name ("ground" where there is no platform), the velocity of the
        surface in that very point (turning included) [m/s] in ned, and its turn rate [rad/s].
        """
        best = self._GROUND
        for target in self._targets:
            surface = target.surface(north, east)
            if surface is not None and surface[0] <= best[0]:
                best = surface
        return best
