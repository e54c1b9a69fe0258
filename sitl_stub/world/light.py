"""Uneven light: bright and dim areas, a soft shadow on the ground, and an exposure that wanders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sitl_stub.world.documents import FRACTION, NOT_NEGATIVE, POSITIVE, Bounds, Section

_SHADOW_REACH = 4.0  # [m] the shadow's middle line passes the world's origin within this distance


@dataclass(frozen=True, slots=True, kw_only=True)
class LightConfig:
    """The `light:` mapping of a world file."""

    level: float = 0.85  # brightness: grey level of a white surface over 255, where the light is mean
    unevenness: float = 0.15  # share by which wide areas are brighter or dimmer
    shadow: float = 0.35  # share of light that the shadow takes
    shadow_width: float = 1.5  # [m]
    shadow_softness: float = 0.35  # [m] width of the shadow's edges
    wander: float = 0.06  # standard deviation of the logarithm of the exposure
    wander_time: float = 4.0  # [s] correlation time

    @classmethod
    def read(cls, section: Section) -> LightConfig:
        """Read the `light:` mapping of a world file."""
        default = cls()
        config = cls(
            level=section.number("level", default.level, Bounds(above=0.0, high=10.0)),
            unevenness=section.number("unevenness", default.unevenness, FRACTION),
            shadow=section.number("shadow", default.shadow, FRACTION),
            shadow_width=section.number("shadow_width_m", default.shadow_width, POSITIVE),
            shadow_softness=section.number("shadow_softness_m", default.shadow_softness, POSITIVE),
            wander=section.number("wander", default.wander, NOT_NEGATIVE),
            wander_time=section.number("wander_time_s", default.wander_time, POSITIVE),
        )
        section.finish()
        return config


class Light:
    """One drawn light."""

    def __init__(self, config: LightConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        heading, phase, shadow_heading, shadow_offset = rng.random(4)
        wavelength = 6.0 + 8.0 * float(rng.random())  # [m] of bright and dim areas
        self._wave_north = 2.0 * math.pi * math.cos(2.0 * math.pi * heading) / wavelength
        self._wave_east = 2.0 * math.pi * math.sin(2.0 * math.pi * heading) / wavelength
        self._phase = 2.0 * math.pi * float(phase)
        self._shadow_normal = (math.cos(math.pi * shadow_heading), math.sin(math.pi * shadow_heading))
        self._shadow_offset = _SHADOW_REACH * (2.0 * float(shadow_offset) - 1.0)
        self._wander = float(rng.standard_normal())
        self._t = 0.0

    def exposure(self, t: float) -> float:
        """Give the factor on the brightness at `t` [s]; called in order."""
        config = self._config
        keep = math.exp(-max(0.0, t - self._t) / config.wander_time)
        self._t = t
        self._wander = keep * self._wander + math.sqrt(1.0 - keep * keep) * float(self._rng.standard_normal())
        return config.level * math.exp(config.wander * self._wander)

    def on_ground(self, north: npt.NDArray[np.float64], east: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Give the light, mean 1 outside the shadow, on points of the ground [m]."""
        config = self._config
        wave = 1.0 + config.unevenness * np.sin(self._wave_north * north + self._wave_east * east + self._phase)
        across = np.abs(self._shadow_normal[0] * north + self._shadow_normal[1] * east - self._shadow_offset)
        edge = np.clip((across - 0.5 * config.shadow_width) / config.shadow_softness + 0.5, 0.0, 1.0)
        light: npt.NDArray[np.float64] = wave * (1.0 - config.shadow * (1.0 - edge * edge * (3.0 - 2.0 * edge)))
        return light
