"""How fast a vehicle may come up behind a target that may brake at any moment.

It is to stand no nearer than r_least when both have stopped. With r the range, a its own braking, d the time until a
target that brakes is seen to and the own brakes answer, u the speed at which the target drives away and b what the
target brakes with at most, the ways that are left say how fast it may be:

    ahead (v d + v^2 / 2a) <= r - r_least + u^2 / 2b

where `ahead` is the cosine of the target's bearing: the share of the way that leads to the target. A target that comes
nearer leaves no more way than one that stands, and takes away none: driving round it is the planner's matter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppingParameters:
    """What it must be able to do at any moment."""

    # [m] from the target's reference point where both have stopped: nearer, no tag is whole in the picture;
    nearest_m: Annotated[float, Gt(0.0), Le(20.0)] = 0.95
    nearer_m: Annotated[float, Gt(0.0), Le(20.0)] = 0.20  # or so much nearer than its place, where that is less
    delay_s: Annotated[float, Gt(0.0), Le(2.0)] = 0.30  # from the target's braking to its own,
    target_braking_mps2: Annotated[float, Gt(0.0), Le(20.0)] = 1.5  # the target brakes no harder
    ahead_least: Annotated[float, Gt(0.0), Le(1.0)] = 0.2  # a target farther to the side is not driven up to


def fastest(
    *, gap: float, standoff: float, ahead: float, away: float, braking: float, parameters: StoppingParameters
) -> float:
    """Give the highest speed [m/s] from which it still stops in time, 0 where there is none.

    Args:
        gap: distance between the two [m].
        standoff: distance between its place and the target [m].
        ahead: cosine of the target's bearing.
        away: the target's speed away from it [m/s], below zero towards it.
        braking: its own deceleration [m/s^2], above zero.
        parameters: of the rule.
    """
    p = parameters
    if ahead < p.ahead_least:
        return math.inf
    left = max(away, 0.0) ** 2 / (2.0 * p.target_braking_mps2)
    way = (gap - min(p.nearest_m, standoff - p.nearer_m) + left) / ahead
    if way <= 0.0:
        return 0.0
    slow = braking * p.delay_s
    return math.sqrt(slow * slow + 2.0 * braking * way) - slow
