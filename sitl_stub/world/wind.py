"""Wind: a mean, turbulence, and single gusts; all from one generator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.world.documents import NOT_NEGATIVE, POSITIVE, Bounds, Interval, Section

_BLOCK = 512  # normal numbers drawn at once
_FULL_TURN = Interval(-math.pi, math.pi)
_MEAN = Interval(3.0, 3.0)
_GUST = Interval(0.5, 2.0)
_GUST_LENGTH = Interval(1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class WindConfig:
    """Strength and character of the wind; all zero strengths make a calm.

    The turbulence's strengths are those of MIL-F-8785C at low altitude (5 m, mean wind 3 m/s): vertical deviation a
    tenth of the mean wind, horizontal ones twice that. Its times are the scale lengths over the mean wind, the
    horizontal one shortened from 12 s to what works hardest on a small multirotor.
    """

    mean: Interval = _MEAN  # [m/s] horizontal mean
    direction: Interval = _FULL_TURN  # [rad] the direction the air moves towards, from north
    turbulence: float = 0.6  # [m/s] standard deviation of each horizontal component
    turbulence_time: float = 4.0  # [s] correlation time of the horizontal components
    vertical_turbulence: float = 0.3  # [m/s] standard deviation
    vertical_time: float = 1.7  # [s] correlation time
    gust: Interval = _GUST  # [m/s] peak of a single gust
    gust_length: Interval = _GUST_LENGTH  # [s] from begin to end
    gust_interval: float = 12.0  # [s] mean time between the end of a gust and the next; inf: none

    @classmethod
    def read(cls, section: Section) -> WindConfig:
        """Read the `wind:` mapping of a world file."""
        default = cls()
        direction = section.interval("direction_deg", Interval(-180.0, 180.0), Bounds(low=-360.0, high=360.0))
        mean = section.interval("mean_mps", default.mean, Bounds(low=0.0, high=30.0))
        gusts = section.boolean("gusts", True)
        config = cls(
            mean=mean,
            direction=Interval(math.radians(direction.low), math.radians(direction.high)),
            turbulence=section.number("turbulence_mps", default.turbulence, NOT_NEGATIVE),
            turbulence_time=section.number("turbulence_time_s", default.turbulence_time, POSITIVE),
            vertical_turbulence=section.number("vertical_turbulence_mps", default.vertical_turbulence, NOT_NEGATIVE),
            vertical_time=section.number("vertical_time_s", default.vertical_time, POSITIVE),
            gust=section.interval("gust_mps", default.gust, NOT_NEGATIVE),
            gust_length=section.interval("gust_length_s", default.gust_length, POSITIVE),
            gust_interval=section.number("gust_interval_s", default.gust_interval, POSITIVE) if gusts else math.inf,
        )
        section.finish()
        return config

    @classmethod
    def of_mean(cls, mean: float) -> WindConfig:
        """Give a wind of this mean [m/s], its turbulence and gusts in proportion, as MIL-F-8785C has them; 0: calm.

        Strengths grow with the mean, the turbulence's times shrink with it; at 3 m/s it is the default wind.
        """
        if mean == 0.0:
            return CALM
        default = cls()
        ratio = mean / default.mean.low
        return cls(
            mean=Interval(mean, mean),
            turbulence=ratio * default.turbulence,
            turbulence_time=default.turbulence_time / ratio,
            vertical_turbulence=ratio * default.vertical_turbulence,
            vertical_time=default.vertical_time / ratio,
            gust=Interval(ratio * default.gust.low, ratio * default.gust.high),
        )


CALM = WindConfig(
    mean=Interval(0.0, 0.0), turbulence=0.0, vertical_turbulence=0.0, gust=Interval(0.0, 0.0), gust_interval=math.inf
)


class Wind:
    """The wind at the vehicle.

    Mean, plus an Ornstein-Uhlenbeck process per axis (the first-order Dryden form, discretised exactly:
    `x(t + dt) = a x(t) + sigma sqrt(1 - a^2) n`, `a = exp(-dt / T)`), plus single gusts of the form
    `peak (1 - cos(2 pi s)) / 2` (MIL-F-8785C), along a drawn direction.
    """

    def __init__(self, config: WindConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._normals: list[float] = []
        speed, direction = config.mean.draw(rng), config.direction.draw(rng)
        self.mean_speed = speed
        """The mean drawn for this flight [m/s]."""
        self.mean_ned: Vector = (speed * math.cos(direction), speed * math.sin(direction), 0.0)
        self._direction = direction
        start = rng.standard_normal(3)
        self._north = config.turbulence * float(start[0])
        self._east = config.turbulence * float(start[1])
        self._down = config.vertical_turbulence * float(start[2])
        self._dt = -1.0
        self._horizontal = self._vertical = (1.0, 0.0)
        self._t = 0.0
        self._gust_begin = self._gust_end = 0.0
        self._gust_north = self._gust_east = 0.0
        self._plan_gust()

    def _plan_gust(self) -> None:
        config, rng = self._config, self._rng
        wait = float(rng.exponential()) * config.gust_interval if math.isfinite(config.gust_interval) else math.inf
        self._gust_begin = self._gust_end + wait
        self._gust_end = self._gust_begin + config.gust_length.draw(rng)
        peak = config.gust.draw(rng)
        direction = self._direction + 0.5 * float(rng.standard_normal())
        self._gust_north, self._gust_east = peak * math.cos(direction), peak * math.sin(direction)

    def step(self, dt: float) -> Vector:
        """Move on by `dt` [s] and give the air's velocity over ground [m/s], frame ned."""
        if dt != self._dt:
            config = self._config
            self._dt = dt
            self._horizontal = _ou(dt, config.turbulence_time, config.turbulence)
            self._vertical = _ou(dt, config.vertical_time, config.vertical_turbulence)
        if not self._normals:
            self._normals = self._rng.standard_normal(3 * _BLOCK).tolist()
        normals = self._normals
        keep, noise = self._horizontal
        self._north = keep * self._north + noise * normals.pop()
        self._east = keep * self._east + noise * normals.pop()
        keep, noise = self._vertical
        self._down = keep * self._down + noise * normals.pop()
        self._t += dt
        north, east = self.mean_ned[0] + self._north, self.mean_ned[1] + self._east
        if self._t > self._gust_begin:
            if self._t >= self._gust_end:
                self._plan_gust()
            else:
                part = (self._t - self._gust_begin) / (self._gust_end - self._gust_begin)
                share = 0.5 * (1.0 - math.cos(2.0 * math.pi * part))
                north += share * self._gust_north
                east += share * self._gust_east
        return north, east, self._down


def _ou(dt: float, time_constant: float, sigma: float) -> tuple[float, float]:
    keep = math.exp(-dt / time_constant)
    return keep, sigma * math.sqrt(1.0 - keep * keep)
