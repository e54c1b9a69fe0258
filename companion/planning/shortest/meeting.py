"""When a car can be at a place that moves: the time to a pose by four models, and the earliest meeting by any."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

from annotated_types import Ge, Gt, Le

from companion.planning.shortest.car import Car, travel_time
from companion.planning.shortest.dubins import dubins_path
from companion.planning.shortest.path import Pose
from companion.planning.shortest.reeds_shepp import reeds_shepp_path

_LONGEST = 0.5  # [s] between two instants looked at,
_SHORTEST = 0.1  # [s] and the shortest
_HALVINGS = 4  # of the bracket


class Reach(Protocol):
    """The time that a car needs to a pose."""

    def time_to(self, goal: Pose, *, speed: float, speed_end: float) -> float:
        """Give the time [s]; infinite where it cannot be reached.

        Args:
            goal: (x, y, heading) in the frame of the car.
            speed: present speed [m/s], negative backwards.
            speed_end: of the goal along its heading [m/s], negative backwards.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class CircleReach:
    """A circle of radius v_max t (Patel et al., "De-coupled Position and Orientation"): no heading counts."""

    car: Car

    def time_to(self, goal: Pose, *, speed: float, speed_end: float) -> float:  # noqa: ARG002
        """See `Reach.time_to`; no speed but the highest counts."""
        return math.hypot(goal[0], goal[1]) / self.car.speed_forward


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperReach:
    """r_eff(t) = v_max t cos(alpha / 2) with alpha the bearing of the goal (Patel et al., eq. 4)."""

    car: Car

    def time_to(self, goal: Pose, *, speed: float, speed_end: float) -> float:  # noqa: ARG002
        """See `Reach.time_to`: the t at which r_eff is the distance; heading at the goal and speeds do not count."""
        distance = math.hypot(goal[0], goal[1])
        if distance == 0.0:
            return 0.0
        share = math.cos(0.5 * math.atan2(goal[1], goal[0]))
        return distance / (self.car.speed_forward * share) if share > 0.0 else math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class DubinsReach:
    """The shortest path forward, at bounded acceleration."""

    car: Car

    def time_to(self, goal: Pose, *, speed: float, speed_end: float) -> float:
        """See `Reach.time_to`."""
        return travel_time(self.car, dubins_path(self.car, goal), speed=speed, speed_end=speed_end)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReedsSheppReach:
    """The best path forward and back, at bounded acceleration."""

    car: Car

    def time_to(self, goal: Pose, *, speed: float, speed_end: float) -> float:
        """See `Reach.time_to`."""
        path = reeds_shepp_path(self.car, goal, speed=speed, speed_end=speed_end)
        return travel_time(self.car, path, speed=speed, speed_end=speed_end)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetingParameters:
    """How it is foreseen where a rover meets its moving place."""

    # none: the place as it will be at each instant of the plan; circle, paper: the radii of Patel et al.; dubins: paths
    # forward; reeds_shepp: forward and back
    reach: Literal["none", "circle", "paper", "dubins", "reeds_shepp"] = "reeds_shepp"
    horizon_s: Annotated[float, Gt(0.0), Le(60.0)] = 12.0  # no meeting later than this is looked for
    gear_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.5  # standing between driving forward and back


def make_reach(name: str, car: Car) -> Reach | None:
    """Make what `MeetingParameters.reach` names, None for "none".

    Raises:
        ValueError: the name is unknown.
    """
    kinds: dict[str, Callable[..., Reach]] = {
        "circle": CircleReach,
        "paper": PaperReach,
        "dubins": DubinsReach,
        "reeds_shepp": ReedsSheppReach,
    }
    if name == "none":
        return None
    if name not in kinds:
        raise ValueError(f"unknown reach {name!r}: one of none, {', '.join(kinds)}")
    return kinds[name](car=car)


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """When a moving place can be reached."""

    elapsed: float  # [s] from now on
    needed: float  # [s] that the car needs to where the place is then
    feasible: bool  # False: not within the horizon, which `elapsed` is then


def earliest_meeting(needed: Callable[[float], float], horizon: float, *, first: float = 0.0) -> Meeting:
    """Find the smallest t* from `first` on with needed(t*) <= t* (Patel et al., "Finding the Interception Point").

    What is lacking, needed(t) - t, shrinks by at most two seconds in a second where the place is slower than the car:
    so the scan steps on by half of it, between 0.1 and 0.5 s, and halves the bracket of the first crossing. Shortest
    paths jump; a moment shorter than a step may be passed over. Where there is none, t* is the horizon, so that it is
    tried all the same, with the most time for planning anew.

    Args:
        needed: gives the time [s] to the place as it will be after a time [s].
        horizon: [s] how far ahead to look.
        first: [s] a meeting before this is of no interest.
    """
    before, now = first, first
    time = needed(now)
    while time > now:
        if now >= horizon:
            return Meeting(elapsed=horizon, needed=time, feasible=False)
        before, now = now, min(horizon, now + min(max(0.5 * (time - now), _SHORTEST), _LONGEST))
        time = needed(now)
    for _ in range(_HALVINGS if now > first else 0):
        middle = 0.5 * (before + now)
        there = needed(middle)
        if there > middle:
            before = middle
        else:
            now, time = middle, there
    return Meeting(elapsed=now, needed=time, feasible=True)
