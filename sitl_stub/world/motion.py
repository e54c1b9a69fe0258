"""How a platform moves: commanded speed and turn rate, followed with a lag by a unicycle or along a sine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sitl_stub.world.documents import NOT_NEGATIVE, POSITIVE, Interval, Section

KINDS = ("static", "straight", "stop_and_go", "random", "sine")
_STANDING_SPEED = 1e-3  # [m/s] below this a stopping platform stands
_STANDING_TURN_RATE = 1e-3  # [rad/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionConfig:
    """What a platform is told to do from its start to its stop."""

    kind: str  # one of KINDS
    speed: Interval  # [m/s]
    turn_rate: Interval  # [rad/s]
    period: float  # [s] random: how long a drawn command is held
    go: Interval  # [s] stop_and_go: length of a drive
    pause: Interval  # [s] stop_and_go: length of a pause
    wavelength: Interval  # [m] sine: along its axis
    peak_to_peak: Interval  # [m] sine: across its axis
    phase: Interval  # [rad] sine: where on it the platform starts; 0 crosses the axis towards its right
    duration: Interval  # [s] from start to stop
    lag: float  # [s] time constant with which speed and turn rate follow their command
    acceleration: float  # [m/s^2] bound while driving
    turn_acceleration: float  # [rad/s^2] bound while driving
    stop_deceleration: float  # [m/s^2] of the final stop
    stop_turn_deceleration: float  # [rad/s^2] of the final stop

    @classmethod
    def read(cls, section: Section) -> MotionConfig:
        """Read the `motion:` mapping of a world file."""
        kind = section.choice("kind", KINDS, "static")
        random, going, sine = kind == "random", kind == "stop_and_go", kind == "sine"
        unlimited = Interval(math.inf, math.inf)
        still = Interval(0.0, 0.0)
        speed = section.interval("speed_mps", bounds=NOT_NEGATIVE) if kind != "static" else still
        phase = section.interval("phase_deg", Interval(-180.0, 180.0)) if sine else still
        config = cls(
            kind=kind,
            speed=speed,
            turn_rate=section.interval("turn_rate_radps", still) if kind not in ("static", "sine") else still,
            period=section.number("period_s", 0.1, POSITIVE) if random else 0.1,
            go=section.interval("go_s", Interval(3.0, 6.0), POSITIVE) if going else unlimited,
            pause=section.interval("pause_s", Interval(1.0, 3.0), POSITIVE) if going else still,
            wavelength=section.interval("wavelength_m", bounds=POSITIVE) if sine else unlimited,
            peak_to_peak=section.interval("peak_to_peak_m", bounds=NOT_NEGATIVE) if sine else still,
            phase=Interval(math.radians(phase.low), math.radians(phase.high)),
            duration=section.interval("duration_s", unlimited, POSITIVE) if kind != "static" else unlimited,
            lag=section.number("lag_s", 0.05, POSITIVE),
            acceleration=section.number("acceleration_mps2", 10.0 if random else 0.5, POSITIVE),
            turn_acceleration=section.number("turn_acceleration_radps2", 40.0 if random else 1.0, POSITIVE),
            stop_deceleration=section.number("stop_deceleration_mps2", 1.0, POSITIVE),
            stop_turn_deceleration=section.number("stop_turn_deceleration_radps2", 4.0, POSITIVE),
        )
        section.finish()
        return config


class Driver(Protocol):
    """Gives the commands of one platform."""

    def command(self, elapsed: float) -> tuple[float, float]:
        """Give speed [m/s] and turn rate [rad/s] at `elapsed` [s] since the platform's start; called in order."""


class SteadyDriver:
    """One speed and one turn rate, drawn once: straight where the turn rate is zero, else a circle."""

    def __init__(self, config: MotionConfig, rng: np.random.Generator) -> None:
        self._command = (config.speed.draw(rng), config.turn_rate.draw(rng))

    def command(self, elapsed: float) -> tuple[float, float]:  # noqa: ARG002 - the driver's interface
        """Give the drawn command."""
        return self._command


class RandomDriver:
    """Every period a new speed and a new turn rate, uniform in their ranges (Patel et al., section 4)."""

    def __init__(self, config: MotionConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._drawn = 0
        self._command = (0.0, 0.0)

    def command(self, elapsed: float) -> tuple[float, float]:
        """Give the command held during the period that `elapsed` lies in."""
        wanted = int(elapsed / self._config.period + 1e-9) + 1
        while self._drawn < wanted:
            self._command = (self._config.speed.draw(self._rng), self._config.turn_rate.draw(self._rng))
            self._drawn += 1
        return self._command


class StopAndGoDriver:
    """Drives and pauses in turn, each drive with its own speed and turn rate."""

    def __init__(self, config: MotionConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._until = 0.0
        self._driving = False
        self._command = (0.0, 0.0)

    def command(self, elapsed: float) -> tuple[float, float]:
        """Give the command of the drive or pause that `elapsed` lies in."""
        while elapsed >= self._until:
            self._driving = not self._driving
            if self._driving:
                self._until += self._config.go.draw(self._rng)
                self._command = (self._config.speed.draw(self._rng), self._config.turn_rate.draw(self._rng))
            else:
                self._until += self._config.pause.draw(self._rng)
                self._command = (0.0, 0.0)
        return self._command


def make_driver(config: MotionConfig, rng: np.random.Generator) -> Driver:
    """Make the driver that `config` describes."""
    if config.kind == "random":
        return RandomDriver(config, rng)
    if config.kind == "stop_and_go":
        return StopAndGoDriver(config, rng)
    return SteadyDriver(config, rng)


class Body(Protocol):
    """A platform in motion."""

    north: float  # [m]
    east: float  # [m]
    heading: float  # [rad] from north, clockwise, not wrapped
    speed: float  # [m/s]
    turn_rate: float  # [rad/s]

    def drive(self, dt: float, speed: float, turn_rate: float) -> None:
        """Follow a command for `dt` [s]."""

    def stop(self, dt: float) -> None:
        """Brake for `dt` [s]."""


class Unicycle:
    """A platform that drives along its heading.

    `speed' = (command - speed) / lag`, bounded, likewise the turn rate; `north' = speed cos(heading)`,
    `east' = speed sin(heading)`, integrated with the middle values of each step.
    """

    def __init__(self, config: MotionConfig, north: float, east: float, heading: float) -> None:
        self.north = north  # [m]
        self.east = east  # [m]
        self.heading = heading  # [rad] from north, clockwise, not wrapped
        self.speed = 0.0  # [m/s]
        self.turn_rate = 0.0  # [rad/s]
        self._config = config

    def drive(self, dt: float, speed: float, turn_rate: float) -> None:
        """Follow a command for `dt` [s]."""
        config = self._config
        self._move(
            dt,
            _followed(self.speed, speed, dt=dt, lag=config.lag, most=config.acceleration),
            _followed(self.turn_rate, turn_rate, dt=dt, lag=config.lag, most=config.turn_acceleration),
        )

    def stop(self, dt: float) -> None:
        """Brake for `dt` [s]."""
        if self.speed == 0.0 and self.turn_rate == 0.0:
            return
        config = self._config
        self._move(
            dt,
            _towards_zero(self.speed, config.stop_deceleration * dt, _STANDING_SPEED),
            _towards_zero(self.turn_rate, config.stop_turn_deceleration * dt, _STANDING_TURN_RATE),
        )

    def _move(self, dt: float, speed: float, turn_rate: float) -> None:
        mean_speed = 0.5 * (self.speed + speed)
        turned = 0.5 * (self.turn_rate + turn_rate) * dt
        middle = self.heading + 0.5 * turned
        self.north += mean_speed * math.cos(middle) * dt
        self.east += mean_speed * math.sin(middle) * dt
        self.heading += turned
        self.speed = speed
        self.turn_rate = turn_rate


class SineCart:
    """A platform that drives along a sine, heading along it.

    `y = A sin(2 pi x / L + phase)`, x along the axis, y to its right. Its speed along the path follows the command as a
    unicycle's does; its turn rate is the path's curvature times that, so the path is exact at any speed and through
    the last stop. `x' = speed / sqrt(1 + y'(x)^2)`, integrated with the middle slope of each step.
    """

    def __init__(
        self, config: MotionConfig, north: float, east: float, heading: float, rng: np.random.Generator
    ) -> None:
        self.north = north  # [m]
        self.east = east  # [m]
        self.heading = heading  # [rad] from north, clockwise, not wrapped
        self.speed = 0.0  # [m/s]
        self.turn_rate = 0.0  # [rad/s]
        self._config = config
        self._amplitude = 0.5 * config.peak_to_peak.draw(rng)
        self._wave_number = math.tau / config.wavelength.draw(rng)
        self._phase = config.phase.draw(rng)
        self._along = 0.0  # [m] x
        self._axis = heading - math.atan(self._slope(0.0))
        self._cos, self._sin = math.cos(self._axis), math.sin(self._axis)
        across = self._amplitude * math.sin(self._phase)
        self._origin = north + self._sin * across, east - self._cos * across

    def drive(self, dt: float, speed: float, turn_rate: float) -> None:  # noqa: ARG002 - the path tells the turn
        """Follow a commanded speed for `dt` [s]."""
        config = self._config
        self._move(dt, _followed(self.speed, speed, dt=dt, lag=config.lag, most=config.acceleration))

    def stop(self, dt: float) -> None:
        """Brake for `dt` [s], along the sine."""
        if self.speed != 0.0:
            self._move(dt, _towards_zero(self.speed, self._config.stop_deceleration * dt, _STANDING_SPEED))

    def _move(self, dt: float, speed: float) -> None:
        way = 0.5 * (self.speed + speed) * dt
        half = 0.5 * way / math.hypot(1.0, self._slope(self._along))
        self._along += way / math.hypot(1.0, self._slope(self._along + half))
        across = self._amplitude * math.sin(self._wave_number * self._along + self._phase)
        slope = self._slope(self._along)
        bend = -self._wave_number * self._wave_number * across
        self.north = self._origin[0] + self._cos * self._along - self._sin * across
        self.east = self._origin[1] + self._sin * self._along + self._cos * across
        self.heading = self._axis + math.atan(slope)
        self.speed = speed
        self.turn_rate = speed * bend / (1.0 + slope * slope) ** 1.5

    def _slope(self, along: float) -> float:
        return self._amplitude * self._wave_number * math.cos(self._wave_number * along + self._phase)


def make_body(config: MotionConfig, *, north: float, east: float, heading: float, rng: np.random.Generator) -> Body:
    """Make the body that moves as `config` describes; `north`, `east` [m] and `heading` [rad] at the start."""
    if config.kind == "sine":
        return SineCart(config, north, east, heading, rng)
    return Unicycle(config, north, east, heading)


def _followed(value: float, command: float, *, dt: float, lag: float, most: float) -> float:
    """Follow a command for `dt` [s] with a time constant `lag` [s], changing by at most `most` a second."""
    change = (command - value) * (1.0 - math.exp(-dt / lag))
    return value + min(most * dt, max(-most * dt, change))


def _towards_zero(value: float, step: float, standing: float) -> float:
    if abs(value) <= max(step, standing):
        return 0.0
    return value - math.copysign(step, value)
