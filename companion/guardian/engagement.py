"""What speaks against engaging."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.guardian.parameters import GuardianParameters
from companion.guardian.situation import distressed
from companion.messages.ownship import FlightMode, LandedState, VehicleStatus

# In the air the vehicle is taken over only from a mode in which it holds its place by itself.
_STEADY_MODES = frozenset(
    {
        FlightMode.OFFBOARD,
        FlightMode.AUTO_LOITER,
        FlightMode.AUTO_TAKEOFF,
        FlightMode.AUTO_MISSION,
        FlightMode.AUTO_FOLLOW,
        FlightMode.POSCTL,
        FlightMode.ALTCTL,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Circumstances:
    """What is known when the operator engages."""

    status: VehicleStatus
    mode_engaged: FlightMode | None  # that the operator saw; None: not known
    ownship_age: float  # [s] infinite where there is none
    speed: float  # [m/s] of the vehicle
    outside: float  # [m] beyond the fence, negative inside


def obstacle(c: Circumstances | None, parameters: GuardianParameters) -> str:
    """Say what speaks against engaging; empty where nothing does. None: no status has come at all."""
    if c is None or not c.status.connected:
        return "there is no heartbeat from the autopilot"
    return next((say(c) for applies, say in _OBSTACLES if applies(c, parameters)), "")


Applies = Callable[[Circumstances, GuardianParameters], bool]


def _flying_unsteadily(c: Circumstances, _: GuardianParameters) -> bool:
    return c.status.armed and c.status.mode not in _STEADY_MODES


def _neither_flying_nor_disarmed(c: Circumstances, _: GuardianParameters) -> bool:
    return c.status.armed and c.status.landed is not LandedState.IN_AIR


# The first that applies is the answer.
_OBSTACLES: tuple[tuple[Applies, Callable[[Circumstances], str]], ...] = (
    (
        lambda c, _: c.mode_engaged not in (None, c.status.mode),
        lambda c: f"somebody has changed the mode to {c.status.mode.value}",
    ),
    (
        lambda c, _: distressed(c.status, was_armed=False),
        lambda c: f"the autopilot reports {c.status.system_status.name} in mode {c.status.mode.value}",
    ),
    (
        lambda c, _: not c.status.estimate_valid,
        lambda _: "the autopilot's position estimate is not usable",
    ),
    (
        lambda c, p: not c.ownship_age <= p.ownship_stale,
        lambda c: (
            "the own position is not known"
            if math.isinf(c.ownship_age)
            else f"the own position is {c.ownship_age:.2f} s old: is ODOMETRY slow, or a computer overloaded?"
        ),
    ),
    (
        lambda c, _: c.outside > 0.0,
        lambda c: f"the vehicle is {c.outside:.1f} m outside of the fence: bring it inside first",
    ),
    (
        _flying_unsteadily,
        lambda c: f"the vehicle flies in mode {c.status.mode.value}: switch to Hold or Position first",
    ),
    (
        _neither_flying_nor_disarmed,
        lambda c: f"the vehicle is armed and its landed state is {c.status.landed.name}: hover, or disarm, first",
    ),
    (
        lambda c, p: c.status.armed and c.speed > p.engage_speed,
        lambda c: f"the vehicle moves at {c.speed:.1f} m/s: hover first",
    ),
)
