"""An approach begins with a look: from a place where the target is in the picture of a vehicle that no longer leans."""

from __future__ import annotations

import math

import numpy as np
import pytest
from guidance_views import GEAR, track, view

from companion.guidance.flying import goal_of
from companion.guidance.goals import Goal
from companion.guidance.machine import Guidance
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, LostPlan, SearchPlan
from companion.guidance.view import View
from companion.messages.decision import Mode
from companion.messages.target import TargetPose

P = GuidanceParameters()
HEIGHT = 4.0  # [m] of the feet above the pad
IN_VIEW = HEIGHT / P.approach.look_slope
PAD_DOWN = HEIGHT + GEAR


class Standing:
    """A forecast of a pad that stands."""

    t, horizon, reset_counter = 0.0, 6.0, 0

    def __init__(self, pad_ned: np.ndarray) -> None:
        self._pad = pad_ned

    def at(self, t: float) -> TargetPose:
        return TargetPose(
            t=t,
            position_ned=self._pad,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.eye(4),
        )


def look(t: float, north: float, east: float, *, age: float = 0.05, fused: int = 50, **more) -> View:
    """Give what a level vehicle at the origin, turned north, knows of a pad [m]."""
    pad = np.array([north, east, PAD_DOWN])
    known = track(t, x=north, y=east, z=PAD_DOWN, age=age, position_ned=pad, fused=fused)
    return view(t, track=known, prediction=Standing(pad), **more)


def found(seen: View) -> Guidance:
    """Give a guidance that searches, and finds the target at once."""
    guidance = Guidance(FlightPlan(search=SearchPlan(height_m=HEIGHT), lost=LostPlan(coast_s=4.0)), P)
    guidance._c.memory.mode = Mode.SEARCH
    guidance._c.memory.search_started = guidance._c.memory.centred_at = seen.t
    assert guidance.update(seen).mode is Mode.APPROACH
    return guidance


def place_of(goal: Goal | None, t: float) -> np.ndarray:
    assert goal is not None
    here, later = goal.at(t), goal.at(t + 3.0)
    assert here.position_ned == pytest.approx(later.position_ned)  # it is a place to stand at
    return here.position_ned


def searched(then: float, north: float, east: float, **more) -> np.ndarray | None:
    """Give the place (2,) [m] to which a vehicle goes that glimpsed a target 3 m north once, a while ago and from afar.

    Args:
        then: the instant [s]; the glimpse was at 1 s.
        north: where the vehicle is then [m].
        east: likewise.

    Returns:
        None: it flies the spiral.
    """
    guidance = Guidance(FlightPlan(search=SearchPlan(height_m=HEIGHT)), P)
    memory = guidance._c.memory
    memory.mode, memory.origin_ned = Mode.SEARCH, np.array([0.0, 0.0, HEIGHT])
    memory.search_started, memory.search_budget = 0.0, 100.0
    memory.centred_at = memory.spiral_started = 0.0  # it has long been on its spiral
    assert guidance.update(look(1.0, 3.0, 0.0, fused=1)).mode is Mode.SEARCH
    later = view(then, position=(north, east, 0.0))
    assert guidance.update(later).mode is Mode.SEARCH
    goal = goal_of(guidance._c, later, 0.02)
    assert goal is not None
    here, there = goal.at(then), goal.at(then + 3.0)
    return here.position_ned[:2] if np.array_equal(here.position_ned, there.position_ned) else None


def test_where_a_target_was_glimpsed_the_search_goes_first_and_begins_its_spiral_there() -> None:
    assert searched(2.0, 0.3, 0.0) == pytest.approx([3.0, 0.0])
    assert searched(3.5, 2.0, -0.4) == pytest.approx([3.0, 0.0])
    assert searched(4.0, 2.7, 0.2) is None


def test_a_place_that_cannot_be_reached_is_not_waited_for() -> None:
    """The fence may be in the way."""
    assert searched(8.0, 0.3, 0.0) == pytest.approx([3.0, 0.0])
    assert searched(12.0, 0.3, 0.0) is None


@pytest.mark.parametrize("bearing", np.linspace(-math.pi, math.pi, 7))
def test_a_target_glimpsed_at_the_edge_is_looked_at_from_nearer(bearing: float) -> None:
    seen = look(1.0, 3.4 * math.cos(bearing), 3.4 * math.sin(bearing))
    place = place_of(goal_of(found(seen)._c, seen, 0.02), 1.0)
    way = 3.4 - IN_VIEW
    assert place == pytest.approx([way * math.cos(bearing), way * math.sin(bearing), 0.0])


def test_a_target_well_in_the_picture_is_looked_at_from_where_the_swing_of_the_search_ends() -> None:
    seen = look(1.0, 1.0, 0.3, velocity=(0.5, -0.5, 0.1))
    place = place_of(goal_of(found(seen)._c, seen, 0.02), 1.0)
    assert place == pytest.approx([0.3, -0.3, 0.0])


def test_swinging_away_from_a_target_it_comes_back_to_where_it_sees_it() -> None:
    """The way that it still swings is made up for: it is the place of rest that counts."""
    seen = look(1.0, 0.0, 1.5, velocity=(0.0, -0.9, 0.0))
    place = place_of(goal_of(found(seen)._c, seen, 0.02), 1.0)
    assert place == pytest.approx([0.0, 1.5 - IN_VIEW, 0.0])


def test_the_place_moves_on_with_a_target_that_drives_out_of_the_picture() -> None:
    seen = look(1.0, 1.5, 0.0)
    guidance = found(seen)
    assert place_of(goal_of(guidance._c, seen, 0.02), 1.0) == pytest.approx([0.0, 0.0, 0.0])
    then = look(2.0, 2.5, 0.0)
    assert place_of(goal_of(guidance._c, then, 0.02), 2.0) == pytest.approx([2.5 - IN_VIEW, 0.0, 0.0])


def looks_for(north: float) -> float:
    """Give how long [s] a target that stays so far ahead of the vehicle [m] is looked at from a standing goal."""
    seen = look(0.0, north, 0.0)
    guidance, t = found(seen), 0.0
    while t < 20.0:
        goal = goal_of(guidance._c, look(t, north, 0.0), 0.02)
        if goal is None or goal.relative:
            return t
        assert guidance.update(look(t, north, 0.0)).mode is Mode.APPROACH  # it does not turn to reorienting either
        t += 0.05
    return math.inf


def test_the_look_ends_when_the_target_is_in_the_picture_and_at_the_latest_after_a_while() -> None:
    a = P.approach
    assert looks_for(IN_VIEW - 0.2) == pytest.approx(a.look_s, abs=0.06)
    assert looks_for(IN_VIEW + a.look_near_m - 0.01) == pytest.approx(a.look_s, abs=0.06)
    assert looks_for(IN_VIEW + a.look_near_m + 0.01) == pytest.approx(a.look_most_s, abs=0.06)


def test_a_target_that_stays_out_of_sight_is_lost_as_ever() -> None:
    guidance = found(look(0.0, 3.4, 0.0))
    for k in range(1, 39):
        assert guidance.update(look(0.1 * k, 3.4, 0.0, age=0.1 * k)).mode is Mode.APPROACH
    assert guidance.update(look(4.1, 3.4, 0.0, age=4.1)).mode is Mode.HOLD


def test_it_goes_there_gently() -> None:
    """A vehicle that leans towards the target looks away from it."""
    seen = look(1.0, 3.4, 0.0)
    goal = goal_of(found(seen)._c, seen, 0.02)
    assert goal is not None
    assert goal.gentle
