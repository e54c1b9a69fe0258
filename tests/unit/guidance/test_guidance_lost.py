"""The target out of sight: a dead camera and a pad that is not in the picture get different answers."""

from __future__ import annotations

import numpy as np
import pytest
from guidance_views import track, view

from companion.guidance.conditions import why_lost
from companion.guidance.flying import goal_of
from companion.guidance.machine import Guidance
from companion.guidance.memory import Context, Memory
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, FollowPlan, LostPlan, SearchPlan
from companion.guidance.view import View, relative_state
from companion.messages.decision import Mode
from companion.messages.target import TargetPose, TargetTrack

P = GuidanceParameters()
PLAN = FlightPlan(
    search=SearchPlan(timeout_s=50.0), lost=LostPlan(coast_s=8.0, hold_s=5.0, search_s=20.0, no_camera_s=30.0)
)


class Still:
    """A forecast of a pad at rest 3 m below."""

    t, horizon, reset_counter = 0.0, 6.0, 0

    def at(self, t: float) -> TargetPose:
        return TargetPose(
            t=t,
            position_ned=np.array([0.0, 0.0, 3.2]),
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.eye(4),
        )


def seen(t: float, age: float, std: float = 0.05) -> TargetTrack:
    return track(
        t,
        z=3.2,
        age=age,
        covariance=np.diag([std**2, std**2, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01]),
        position_ned=np.array([0.0, 0.0, 3.2]),
        nis=4.0,
    )


def look(t: float, *, age: float, frame_age: float = 0.0, std: float = 0.05) -> View:
    return view(t, track=seen(t, age, std), prediction=Still(), t_frame=t - frame_age)


def guidance(mode: Mode, plan: FlightPlan = PLAN) -> Guidance:
    made = Guidance(plan, P)
    made._c.memory.mode, made._c.memory.t_entered = mode, 0.0
    made._c.memory.search_started, made._c.memory.search_budget = 0.0, plan.search.timeout_s
    return made


def run(made: Guidance, begin: float, end: float, *, frames_until: float = 1e9, frames_from: float = 1e9) -> list:
    """Step at 10 Hz with nothing in sight; frames come before and after the two instants."""
    switches, t = [], begin
    while t < end:
        t += 0.1
        alive = t <= frames_until or t >= frames_from
        now = view(t, t_frame=t if alive else frames_until)
        switched = made.update(now).switched
        if switched is not None:
            switches.append((round(t, 1), switched.mode, switched.reason))
    return switches


def reason(age: float, *, frame_age: float, std: float = 0.05, descending: bool = False) -> str | None:
    c, now = Context(plan=PLAN, parameters=P, memory=Memory(mode=Mode.FOLLOW)), look(20.0, age=age, frame_age=frame_age)
    now = look(20.0, age=age, frame_age=frame_age, std=std)
    assert now.track is not None
    return why_lost(c, now, relative_state(now, now.track, P.descent), descending=descending)


def test_the_mission_says_how_long_to_coast_and_the_text_why_it_ended() -> None:
    assert reason(7.9, frame_age=7.9) is None
    assert reason(7.9, frame_age=0.0) is None
    dead, hidden = reason(8.1, frame_age=8.0), reason(8.1, frame_age=0.0)
    assert dead is not None
    assert hidden is not None
    assert "no camera frames for 8.0 s" in dead
    assert "target not seen for 8.1 s, though frames come" in hidden


def test_an_uncertain_forecast_ends_a_descent_but_not_the_coasting() -> None:
    assert reason(3.0, frame_age=0.0, std=1.5) is None
    assert reason(0.1, frame_age=0.0, std=1.5) is not None
    assert reason(3.0, frame_age=0.0, std=1.5, descending=True) is not None


def test_a_covered_pad_is_held_for_and_then_searched() -> None:
    switches = run(guidance(Mode.HOLD), 0.0, 40.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [(Mode.SEARCH, 5), (Mode.ABORT, 25)]


def test_a_dead_camera_is_not_searched_with() -> None:
    switches = run(guidance(Mode.HOLD), 0.0, 40.0, frames_until=-1.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [(Mode.ABORT, 30)]
    assert "no camera frames" in switches[0][2]


@pytest.mark.parametrize("then_return", [False, True])
def test_a_dead_camera_ends_as_the_mission_says(then_return: bool) -> None:
    plan = FlightPlan(lost=LostPlan(no_camera_s=3.0, then_return=then_return))
    made = guidance(Mode.HOLD, plan)
    run(made, 0.0, 5.0, frames_until=-1.0)
    assert made.mode is Mode.ABORT
    assert made.wants_return is then_return


def test_a_camera_that_returns_has_time_to_show_the_pad_before_the_search() -> None:
    switches = run(guidance(Mode.HOLD), 0.0, 25.0, frames_until=-1.0, frames_from=14.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [(Mode.SEARCH, 19)]


def test_a_camera_that_comes_and_goes_is_soon_searched_with_whenever_it_comes() -> None:
    """Pictures for 3 s, none for 5 s, and so on: each return must not begin the hold anew."""
    made, switches = guidance(Mode.HOLD), []
    for begin in (0.0, 8.0, 16.0, 24.0):
        switches += run(made, begin, begin + 8.0, frames_until=begin + 3.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [
        (Mode.SEARCH, 10),  # after 3 s and some more of looking
        (Mode.HOLD, 12),
        (Mode.SEARCH, 16),
        (Mode.HOLD, 20),
        (Mode.SEARCH, 24),
        (Mode.HOLD, 28),
    ]


def test_a_target_that_was_seen_again_is_looked_for_anew() -> None:
    made = guidance(Mode.HOLD)
    run(made, 0.0, 4.0)
    assert made.update(look(4.2, age=0.05)).mode is Mode.APPROACH
    switches = run(made, 4.2, 16.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [(Mode.HOLD, 4), (Mode.SEARCH, 9)]


def test_a_returning_camera_that_shows_the_pad_resumes() -> None:
    made = guidance(Mode.HOLD)
    run(made, 0.0, 12.0, frames_until=-1.0)
    assert made.mode is Mode.HOLD
    switched = made.update(look(12.2, age=0.05)).switched
    assert switched is not None
    assert switched.mode is Mode.APPROACH


def test_a_search_waits_for_the_camera_and_keeps_the_rest_of_its_time() -> None:
    switches = run(guidance(Mode.SEARCH), 0.0, 80.0, frames_until=10.0, frames_from=20.0)
    assert [(mode, round(t)) for t, mode, _ in switches] == [(Mode.HOLD, 11), (Mode.SEARCH, 25), (Mode.ABORT, 64)]
    assert "searching would be pointless" in switches[0][2]


def test_a_mission_that_only_searches_is_not_done_because_its_camera_died() -> None:
    plan = FlightPlan(land=None, lost=LostPlan(hold_s=5.0, no_camera_s=30.0))
    made = guidance(Mode.SEARCH, plan)
    made._c.memory.centre_ned = np.zeros(3)  # it has been glimpsed
    switches = run(made, 0.0, 40.0, frames_until=-1.0)
    assert [mode for _, mode, _ in switches] == [Mode.HOLD, Mode.ABORT]


def test_nothing_is_settled_by_a_forecast() -> None:
    made = guidance(Mode.ALIGN)
    for k in range(100):
        made.update(look(0.02 * k, age=1.0))
    assert made.mode is Mode.ALIGN


def following_height(std: float, *, age: float = 2.0) -> float:
    """Give the height [m] of the feet above the pad that is flown to, with a pad known to a deviation [m]."""
    made = guidance(Mode.FOLLOW, FlightPlan(search=SearchPlan(height_m=5.0), follow=FollowPlan(height_m=3.0)))
    goal = goal_of(made._c, look(1.0, age=age, std=std), 0.1)
    assert goal is not None
    return 3.2 - float(goal.at(1.0).position_ned[2]) - 0.2


def test_the_less_is_known_of_where_the_pad_is_the_higher_the_vehicle_follows_up_to_where_it_searches() -> None:
    """The forecast alone leads: from higher up more of where the pad may be comes into the picture."""
    assert following_height(0.02) == following_height(0.1) == pytest.approx(3.0)
    assert following_height(1.0, age=0.1) == pytest.approx(3.0)  # in sight: it is where it is
    heights = [following_height(std) for std in np.linspace(0.3, 3.0, 20)]
    assert heights == sorted(heights)
    assert 3.0 < following_height(0.6) < 5.0
    assert heights[-1] == pytest.approx(5.0)
