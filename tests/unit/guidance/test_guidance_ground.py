"""The rover's guidance: it looks, drives, follows, stops with the target, and looks again."""

import math
from dataclasses import replace

import numpy as np
import pytest
from guidance_views import view

from companion.guidance.ground import TRANSITIONS, GroundGuidance
from companion.guidance.modes import FINAL_MODES, Event
from companion.guidance.near_sight import NearSight
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, FollowUntil, GroundPlan, LostPlan, SearchPlan
from companion.guidance.standing import standing_of
from companion.messages.decision import Mode
from companion.messages.ownship import LandedState
from companion.messages.target import TargetPose, TargetTrack

STANDOFF = 1.25
P = GuidanceParameters()


class Ahead:
    """A forecast: the target moves on at its velocity."""

    reset_counter, horizon = 0, 10.0

    def __init__(self, t, place, velocity, yaw):
        self.t, self._place, self._velocity, self._yaw = t, np.array(place, float), np.array(velocity, float), yaw

    def at(self, t):
        return TargetPose(
            t=t,
            position_ned=self._place + (t - self.t) * self._velocity,
            velocity_ned=self._velocity,
            acceleration_ned=np.zeros(3),
            yaw=self._yaw,
            yaw_rate=0.0,
            covariance=np.zeros((4, 4)),
        )


class Drive:
    """A rover that stands at the origin and faces north; the target is where it is put."""

    def __init__(
        self,
        *,
        until=FollowUntil.TARGET_STOPPED,
        for_s=0.0,
        at_most_s=100.0,
        hold_s=0.0,
        stands=True,
        no_camera_s=60.0,
    ):
        ground = GroundPlan(standoff_m=STANDOFF, until=until, for_s=for_s, at_most_s=at_most_s)
        lost = LostPlan(coast_s=2.0, hold_s=1.0, search_s=3.0, no_camera_s=no_camera_s)
        plan = FlightPlan(ground=ground, land=None, search=SearchPlan(timeout_s=5.0), lost=lost, hold_s=hold_s)
        self.guidance = GroundGuidance(plan, P, stands=stands)
        self.t, self.place, self.yaw, self.speed, self.relative = 0.0, (4.0, 0.0, 0.0), 0.0, 0.0, 0.0
        self.sighted, self.more, self.seen, self.driven = True, {}, -1e9, 0.5
        self.course = (1.0, 0.0, 0.0)

    def view(self):
        if self.sighted:
            self.seen = self.t
        track = TargetTrack(
            t=self.t,
            t_measured=self.seen,
            state=np.array([*self.place, self.yaw, self.speed, 0.0, 0.0, 0.0]),
            covariance=1e-4 * np.eye(8),
            position_ned=np.array(self.place, float),
            velocity_ned=np.array([self.speed, 0.0, 0.0]),
            yaw_ned=self.yaw,
            reset_counter=0,
            nis=1.0,
            nis_mean=1.0,
            fused=20,
            t_began=0.0,
        )
        fields = {
            "track": track,
            "prediction": Ahead(self.t, self.place, self.speed * np.array(self.course), self.yaw),
            "relative_velocity_ned": np.array([self.relative, 0.0, 0.0]),
        }
        return view(self.t, planned_speed=self.driven, landed=LandedState.IN_AIR, **(fields | self.more))

    def run(self, seconds):
        for _ in range(round(seconds / 0.1)):
            self.t += 0.1
            decision = self.guidance.update(self.view())
        return decision.mode

    def on_station(self):
        assert self.run(2.0) is Mode.APPROACH
        self.place, self.speed = (1.5, 0.0, 0.0), 0.5
        assert self.run(0.2) is Mode.FOLLOW
        return self


def test_it_looks_before_it_sets_off() -> None:
    drive = Drive()
    assert drive.run(1.0) is Mode.SEARCH
    assert drive.run(1.0) is Mode.APPROACH


def test_its_place_is_reached_when_it_is_seen_to_be_there_not_where_it_was_last_seen() -> None:
    drive = Drive()
    assert drive.run(2.0) is Mode.APPROACH
    drive.sighted = False
    drive.run(0.5)
    drive.place = (1.5, 0.0, 0.0)
    assert drive.run(1.0) is Mode.APPROACH
    drive.sighted = True
    assert drive.run(0.1) is Mode.FOLLOW


def test_the_goal_is_behind_the_target_at_its_heading() -> None:
    drive = Drive().on_station()
    drive.place, drive.yaw, drive.speed = (2.0, 1.0, 0.0), 0.5 * math.pi, 0.0
    state = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert state.position_ned[:2] == pytest.approx([2.0, 1.0 - STANDOFF])
    assert state.yaw == pytest.approx(0.5 * math.pi)


def test_far_out_of_line_it_lines_up_behind_its_place_first() -> None:
    drive = Drive()
    drive.yaw = 0.5 * math.pi
    drive.run(2.0)
    assert drive.guidance.mode is Mode.APPROACH
    state = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert state.position_ned[1] == pytest.approx(-STANDOFF - P.ground.lead_in_most_m)


def test_it_ends_where_the_target_has_stopped() -> None:
    drive = Drive().on_station()
    assert drive.run(3.0) is Mode.FOLLOW
    drive.place, drive.speed = (STANDOFF, 0.0, 0.0), 0.0
    assert drive.run(1.0) is Mode.ALIGN
    assert drive.run(3.5) is Mode.DONE


def test_a_target_that_moves_on_is_followed_again() -> None:
    drive = Drive().on_station()
    drive.place, drive.speed = (STANDOFF, 0.0, 0.0), 0.0
    assert drive.run(2.0) is Mode.ALIGN
    drive.place = (STANDOFF + 0.1, 0.0, 0.0)
    assert drive.run(0.2) is Mode.FOLLOW


def test_one_that_rolls_on_after_it_has_arrived_comes_back() -> None:
    drive = Drive().on_station()
    drive.place, drive.speed = (STANDOFF + 0.5 * P.ground.arrived_m, 0.0, 0.0), 0.0
    assert drive.run(0.8) is Mode.ALIGN
    drive.place = (STANDOFF + P.ground.arrived_m + 2.0 * P.ground.rolled_m, 0.0, 0.0)
    assert drive.run(1.0) is Mode.FOLLOW


def test_what_floats_keeps_its_place_while_it_looks_and_goes_by_the_targets_speed() -> None:
    drive = Drive(stands=False).on_station()
    drive.place, drive.speed = (STANDOFF, 0.0, 0.0), 0.0
    assert drive.run(2.0) is Mode.ALIGN
    assert drive.guidance.goal(drive.view(), 0.1).relative
    drive.speed = 2.5 * P.ground.slow_mps
    assert drive.run(0.2) is Mode.FOLLOW


def test_what_is_near_enough_widens_with_time() -> None:
    drive = Drive().on_station()
    drive.place, drive.speed = (STANDOFF + 0.1, 0.0, 0.0), 0.0
    assert drive.run(5.0) is Mode.FOLLOW
    assert drive.run(50.0) is Mode.DONE


def test_a_place_that_is_far_off_is_never_near_enough() -> None:
    drive = Drive(at_most_s=1000.0).on_station()
    drive.place, drive.speed = (STANDOFF + 0.4, 0.0, 0.0), 0.0
    assert drive.run(100.0) is Mode.FOLLOW


def test_for_s_is_waited_for_standing() -> None:
    drive = Drive(for_s=20.0).on_station()
    drive.place, drive.speed = (STANDOFF, 0.0, 0.0), 0.0
    assert drive.run(15.0) is Mode.ALIGN
    assert drive.run(6.0) is Mode.DONE


@pytest.mark.parametrize("more", [{"until": FollowUntil.TIME, "for_s": 4.0}, {"at_most_s": 4.0}])
def test_time_ends_it_whatever_the_target_does(more) -> None:
    drive = Drive(**more).on_station()
    assert drive.run(3.5) is Mode.FOLLOW
    assert drive.run(1.0) is Mode.DONE


def test_what_is_near_enough_widens_though_drifting_odometry_makes_the_target_seem_to_drive_at_times() -> None:
    drive = Drive().on_station()
    drive.place, drive.speed = (STANDOFF + 0.5 * P.ground.arrived_last_m, 0.0, 0.0), 0.05
    for _ in range(round((P.ground.strict_s + P.ground.patience_s) / 9.0) + 1):
        drive.speed = 3.0 * P.ground.slow_mps
        drive.run(1.0)
        drive.speed = 0.05
        drive.run(9.0)
    assert drive.guidance.mode is Mode.DONE


def test_beside_a_target_that_drives_it_does_not_widen() -> None:
    drive = Drive().on_station()
    drive.place, drive.speed = (STANDOFF + 0.5 * P.ground.arrived_last_m, 0.0, 0.0), 3.0 * P.ground.slow_mps
    drive.run(P.ground.strict_s + P.ground.patience_s)
    drive.speed = 0.05
    assert drive.run(1.0) is Mode.FOLLOW


def test_a_lost_target_is_waited_for_then_given_up() -> None:
    drive = Drive().on_station()
    drive.sighted = False
    assert drive.run(1.8) is Mode.FOLLOW
    assert drive.run(0.5) is Mode.HOLD
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert not goal.relative
    assert drive.run(1.2) is Mode.SEARCH
    assert drive.run(3.5) is Mode.ABORT


def test_a_lost_target_is_looked_for_where_it_should_be() -> None:
    drive = Drive().on_station()
    drive.place = (-3.0, 4.0, 0.0)
    drive.run(0.1)
    drive.sighted = False
    drive.run(3.4)
    assert drive.guidance.mode is Mode.SEARCH
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert goal.relative  # planned: a rover cannot turn on the spot
    assert goal.at(drive.t).yaw == pytest.approx(math.atan2(4.0, -3.0))
    assert goal.at(drive.t).position_ned == pytest.approx(np.zeros(3))


def test_a_lost_target_that_is_near_is_looked_for_from_farther_back() -> None:
    drive = Drive().on_station()
    drive.sighted, drive.speed = False, 0.0
    drive.run(2.3)
    drive.run(1.2)
    assert drive.guidance.mode is Mode.SEARCH
    goal = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert goal.position_ned == pytest.approx([-P.ground.retreat_m, 0.0, 0.0])


def test_one_that_was_near_may_have_stopped_there_and_is_looked_for_from_farther_back() -> None:
    drive = Drive().on_station()
    drive.sighted, drive.place = False, (9.0, 2.0, 0.0)
    drive.run(3.5)
    assert drive.guidance.mode is Mode.SEARCH
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert goal.at(drive.t).position_ned == pytest.approx([-P.ground.retreat_m, 0.0, 0.0])
    assert goal.at(drive.t).yaw == pytest.approx(math.atan2(2.0, 9.0))
    assert goal.may_stand_at.position_ned == pytest.approx([1.5, 0.0, 0.0])


def test_what_floats_goes_back_by_a_plan_and_not_on_again_when_the_forecast_ends() -> None:
    drive = Drive(stands=False).on_station()
    drive.sighted, drive.speed = False, 0.0
    drive.run(3.5)
    assert drive.guidance.mode is Mode.SEARCH
    for _ in range(2):
        goal = drive.guidance.goal(drive.view(), 0.1)
        assert not goal.direct
        assert goal.at(drive.t).position_ned == pytest.approx([-P.ground.retreat_m, 0.0, 0.0])
        drive.more = {"track": None, "prediction": None}
        drive.run(0.1)


def test_without_pictures_it_stands_and_then_gives_up_and_says_why() -> None:
    drive = Drive(no_camera_s=4.0).on_station()
    drive.sighted, silent_since = False, drive.t
    modes = []
    for _ in range(70):
        drive.more = {"t_frame": silent_since}
        modes.append(drive.run(0.1))
    assert Mode.SEARCH not in modes
    assert modes[-1] is Mode.ABORT
    assert modes.count(Mode.HOLD) == pytest.approx(40, abs=2)


def test_a_search_breaks_off_without_pictures_and_goes_on_with_the_rest_of_its_time() -> None:
    drive = Drive().on_station()
    drive.sighted, drive.place = False, (-3.0, 4.0, 0.0)
    drive.run(4.5)
    assert drive.guidance.mode is Mode.SEARCH
    drive.more = {"t_frame": drive.t - 1.0}
    assert drive.run(0.1) is Mode.HOLD
    drive.more = {}
    assert drive.run(0.1) is Mode.SEARCH  # the hold before the search had its time with pictures already
    assert drive.run(1.1) is Mode.SEARCH
    assert drive.run(0.8) is Mode.ABORT


def test_one_that_was_never_found_is_waited_for_standing() -> None:
    drive = Drive()
    drive.sighted = False
    assert drive.run(2.0) is Mode.SEARCH
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert not goal.relative
    assert goal.at(drive.t).position_ned == pytest.approx(np.zeros(3))


def test_a_near_target_that_is_not_seen_where_it_should_be_is_backed_out_from() -> None:
    drive = Drive().on_station()
    drive.sighted = False
    drive.run(P.ground.blind_s + 0.2)
    goal = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert goal.position_ned[0] == pytest.approx(1.5 - STANDOFF - P.ground.retreat_m)


@pytest.mark.parametrize("place", [(0.8, 1.3, 0.0), (0.8, -1.3, 0.0), (4.0, 0.3, 0.0)])
def test_one_that_has_left_the_picture_aside_or_was_far_is_driven_to_by_the_forecast(place) -> None:
    drive = Drive().on_station()
    drive.place = place
    drive.run(0.1)
    drive.sighted = False
    drive.run(1.0)
    goal = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert goal.position_ned[:2] == pytest.approx([place[0] - STANDOFF, place[1]])


def test_it_backs_out_once_it_has_turned_and_does_not_see_it() -> None:
    drive = Drive().on_station()
    drive.sighted, drive.place = False, (0.8, 1.3, 0.0)
    drive.run(0.4)
    drive.place = (1.5, 0.0, 0.0)
    drive.run(P.ground.blind_s - 0.15)
    assert drive.guidance.goal(drive.view(), 0.1).at(drive.t).position_ned[0] == pytest.approx(1.5 - STANDOFF)
    drive.run(0.3)
    goal = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert goal.position_ned[0] == pytest.approx(1.5 - STANDOFF - P.ground.retreat_m)


@pytest.mark.parametrize(("place", "driven"), [((4.0, 0.3, 0.0), 0.5), ((1.0, 1.3, 0.0), 0.0)])
def test_one_that_may_have_stopped_where_it_was_near_is_backed_out_from(place, driven) -> None:
    """The forecast has it drive on; but it is not seen there, or the rover stands and so will not turn to it."""
    drive = Drive().on_station()
    drive.sighted, drive.place, drive.driven = False, place, driven
    drive.run(P.ground.blind_s + 0.2)
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert goal.at(drive.t).position_ned == pytest.approx([1.5 - STANDOFF - P.ground.retreat_m, 0.0, 0.0])
    assert goal.may_stand_at.position_ned == pytest.approx([1.5, 0.0, 0.0])


def test_one_that_comes_back_at_the_edge_of_the_picture_is_backed_out_from_until_it_stays() -> None:
    drive = Drive().on_station()
    drive.sighted = False
    drive.run(P.ground.blind_s + 0.2)
    back = drive.guidance.goal(drive.view(), 0.1).at(drive.t).position_ned
    drive.sighted, drive.place, drive.speed = True, (1.3, 0.7, 0.0), 0.1
    for _ in range(8):
        drive.run(0.1)
        assert drive.guidance.goal(drive.view(), 0.1).at(drive.t).position_ned == pytest.approx(back)
    drive.run(0.5)
    assert drive.guidance.goal(drive.view(), 0.1).at(drive.t).position_ned[:2] == pytest.approx([1.3 - STANDOFF, 0.7])


@pytest.mark.parametrize(
    ("place", "speed"),
    [((1.5, 0.0, 0.0), 0.1), ((2.0, 1.2, 0.0), 0.1), ((1.3, 0.7, 0.0), P.ground.slow_unseen_mps + 0.1)],
)
def test_one_that_comes_back_in_the_middle_or_far_away_or_drives_on_is_followed_at_once(place, speed) -> None:
    drive = Drive().on_station()
    drive.sighted = False
    drive.run(P.ground.blind_s + 0.2)
    drive.guidance.goal(drive.view(), 0.1)
    drive.sighted, drive.place, drive.speed = True, place, speed
    drive.run(0.1)
    goal = drive.guidance.goal(drive.view(), 0.1).at(drive.t)
    assert goal.position_ned[:2] == pytest.approx([place[0] - STANDOFF, place[1]])


@pytest.mark.parametrize(
    ("speed", "course", "stays"),
    [
        (1.0, (1.0, 0.3, 0.0), True),
        (0.2, (0.0, 1.0, 0.0), True),
        (0.2, (-1.0, 0.0, 0.0), True),
        (0.5, (0, 1.0, 0), False),
    ],
)
def test_one_that_may_have_stopped_aside_is_turned_to_for_a_while_only(speed, course, stays) -> None:
    """One that crossed has gone on. One that was slow may stand, whichever way drifting odometry had it drive."""
    drive = Drive().on_station()
    drive.speed, drive.course = speed, course
    drive.run(0.1)
    drive.sighted, drive.place = False, (1.0, 0.8, 0.0)
    places = []
    for _ in range(15):
        drive.run(0.1)
        goal = drive.guidance.goal(drive.view(), 0.1)
        places.append(goal.at(drive.t).position_ned[0])
    assert places[6] == pytest.approx(1.0 - STANDOFF)
    assert places[-1] == pytest.approx(1.0 - STANDOFF - stays * P.ground.retreat_m)
    assert (goal.may_stand_at is not None) == stays


def test_without_pictures_nothing_says_that_it_is_not_there() -> None:
    drive = Drive().on_station()
    drive.sighted, drive.more = False, {"t_frame": drive.t}
    for _ in range(15):
        drive.run(0.1)
        assert drive.guidance.goal(drive.view(), 0.1).at(drive.t).position_ned[0] == pytest.approx(1.5 - STANDOFF)


def test_one_that_crossed_is_not_backed_out_from_where_it_was() -> None:
    """Its forecast is ahead, but far: it has gone on, and so does the rover."""
    drive = Drive().on_station()
    drive.speed, drive.course = 0.6, (0.0, 1.0, 0.0)
    drive.run(0.1)
    drive.sighted, drive.place = False, (4.0, 0.3, 0.0)
    drive.run(1.0)
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert goal.at(drive.t).position_ned[:2] == pytest.approx([4.0 - STANDOFF, 0.3])
    assert not goal.backs_out


def test_from_one_that_it_is_not_behind_it_backs_out_on_its_own_side() -> None:
    drive = Drive().on_station()
    drive.yaw = math.pi  # it faces the rover
    drive.run(0.1)
    drive.sighted = False
    drive.run(P.ground.blind_s + 0.2)
    goal = drive.guidance.goal(drive.view(), 0.1)
    assert goal.at(drive.t).position_ned == pytest.approx([1.5 - STANDOFF - P.ground.retreat_m, 0.0, 0.0])
    assert goal.at(drive.t).yaw == pytest.approx(0.0)
    assert goal.backs_out


def test_what_it_backed_out_to_is_forgotten_by_the_next_mode() -> None:
    drive = Drive().on_station()
    drive.sighted = False
    drive.run(P.ground.blind_s + 0.2)
    assert drive.guidance.goal(drive.view(), 0.1).backs_out
    drive.run(3.0)
    assert drive.guidance.mode is Mode.SEARCH
    drive.sighted, drive.place, drive.speed = True, (1.3, 0.7, 0.0), 0.1
    assert drive.run(0.5) in (Mode.APPROACH, Mode.FOLLOW)
    assert not drive.guidance.goal(drive.view(), 0.1).backs_out


def test_engaged_again_it_knows_of_no_sighting_any_more() -> None:
    drive, sight = Drive(), NearSight(P, standoff=STANDOFF)
    sight.watch(drive.view())
    drive.sighted, drive.t = False, 1.0
    sight.watch(drive.view())
    assert sight.may_stand_at(drive.view()) is not None
    assert sight.retreat(drive.view(), drive.view().prediction) is None  # 4 m away
    drive.place = (1.5, 0.0, 0.0)
    assert sight.retreat(replace(drive.view(), t_frame=2.0), drive.view().prediction) is not None
    assert sight.is_backing_out(drive.view())
    sight.forget()
    assert sight.may_stand_at(drive.view()) is None
    assert not sight.is_backing_out(drive.view())


def test_what_it_drives_back_to_follows_a_reset_of_the_estimate() -> None:
    turn, step, pivot = 0.4, np.array([3.0, -1.0, 0.5]), np.zeros(3)
    goals = []
    for reset in (False, True):
        drive = Drive().on_station()
        drive.sighted = False
        drive.t += P.ground.blind_s + 0.1
        goals.append(drive.guidance.goal(drive.view(), 0.1).at(drive.t))
        if reset:
            drive.guidance.rebase(step, turn, pivot)
            goal = drive.guidance.goal(drive.view(), 0.1)
            goals.append(goal.at(drive.t))
            assert goal.may_stand_at.position_ned == pytest.approx(
                [1.5 * math.cos(turn) + 3.0, 1.5 * math.sin(turn) - 1.0, 0.5]
            )
            assert goal.may_stand_at.yaw == pytest.approx(turn)
            assert goal.may_stand_at.velocity_ned == pytest.approx([0.5 * math.cos(turn), 0.5 * math.sin(turn), 0.0])
    before, _, after = goals
    c, s = math.cos(turn), math.sin(turn)
    north, east, down = before.position_ned
    assert after.position_ned == pytest.approx([c * north - s * east + 3.0, s * north + c * east - 1.0, down + 0.5])
    assert after.yaw == pytest.approx(before.yaw + turn)


def test_one_that_comes_back_into_view_is_followed_on() -> None:
    drive = Drive().on_station()
    drive.sighted = False
    assert drive.run(2.4) is Mode.HOLD
    drive.sighted = True
    assert drive.run(0.8) in (Mode.APPROACH, Mode.FOLLOW)


def test_it_ends_where_the_target_leads_out_of_the_fence() -> None:
    drive = Drive().on_station()
    drive.more = {"at_fence": True}
    assert drive.run(P.fence_patience_s - 0.3) is Mode.FOLLOW
    assert drive.run(1.0) is Mode.ABORT


@pytest.mark.parametrize("more", [{"taken_over": True}])
def test_a_takeover_ends_it(more) -> None:
    drive = Drive().on_station()
    drive.more = more
    assert drive.run(0.1) is Mode.ABORT
    assert drive.guidance.goal(drive.view(), 0.1) is None


def test_along_and_across_are_those_of_the_target() -> None:
    drive = Drive()
    drive.place, drive.yaw = (0.0, 3.0, 0.0), 0.5 * math.pi  # it is to the right and heads to the right
    standing = standing_of(drive.view().track, STANDOFF)
    assert standing.along == pytest.approx(3.0 - STANDOFF)
    assert standing.across == pytest.approx(0.0, abs=1e-9)
    assert standing.heading == pytest.approx(0.5 * math.pi)


def test_every_mode_that_is_reached_can_be_left() -> None:
    reached = set(TRANSITIONS.values()) | {Mode.PREFLIGHT}
    for mode in reached - FINAL_MODES:
        assert TRANSITIONS[(mode, Event.TAKEN_OVER)] is Mode.ABORT
        assert any(start is mode and event is not Event.TAKEN_OVER for start, event in TRANSITIONS)


def test_a_plan_for_the_air_is_refused() -> None:
    with pytest.raises(ValueError, match="intercept or follow"):
        GroundGuidance(FlightPlan(), P)
