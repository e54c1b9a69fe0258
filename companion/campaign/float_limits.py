"""Whether a free-flyer kept to its limits: the thrust that was sent, and the true motion that came of it.

The tolerances are narrower than those in the air: no wind pushes it, and its odometry is wrong by millimetres a second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.campaign.limits import ExcessMonitor
from companion.campaign.truth import TargetSample, TruthSample
from companion.messages.motion import AnySetpoint
from companion.messages.thrust import AttitudeThrust

_SPEED_FACTOR, _SPEED_OFFSET = 1.15, 0.03  # [m/s] of true speeds: overshoot, and one pulse of the thrusters


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatLimits:
    """What a free-flyer must keep to."""

    speed: float  # [m/s] over the floor
    footprint_radius: float  # [m] the target's boards never come nearer
    clearance: Callable[[float, float], float]  # [m] from a place ahead and right of the target to its boards


class FloatMonitor(ExcessMonitor):
    """Watches a free-flyer's flight."""

    def __init__(self, limits: FloatLimits) -> None:
        super().__init__()
        self._limits = limits

    def setpoint(self, setpoint: AnySetpoint) -> None:
        """Check one setpoint as it was sent."""
        if isinstance(setpoint, AttitudeThrust):
            for part in setpoint.thrust_body.tolist():
                self._check("setpoint thrust", abs(part), 1.0, setpoint.t)
        else:
            self._check("setpoint form", math.inf, 0.0, setpoint.t)

    def truth(self, sample: TruthSample, target: TargetSample) -> None:
        """Check one sample of the true motion."""
        limits = self._limits
        speed = math.hypot(sample.velocity_ned[0], sample.velocity_ned[1])
        self._check("speed", speed, limits.speed, sample.t, _SPEED_FACTOR, _SPEED_OFFSET)
        north = sample.position_ned[0] - target.position_ned[0]
        east = sample.position_ned[1] - target.position_ned[1]
        cosine, sine = math.cos(target.yaw), math.sin(target.yaw)
        clear = limits.clearance(cosine * north + sine * east, cosine * east - sine * north)
        self._check("nearness to the target", limits.footprint_radius - clear, 0.0, sample.t)
