"""The way to a pad that is not seen yet: when it is left, how low it leads, and that nothing jumps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from guidance_views import GEAR, track, view

from companion.guidance.machine import Guidance
from companion.guidance.modes import TRANSITIONS
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, LandPlan, LostPlan, SearchPlan, SwitchingPolicy, TransitPlan
from companion.guidance.view import View
from companion.messages.coarse import CoarseTarget
from companion.messages.decision import Mode
from companion.messages.ownship import LandedState
from companion.messages.target import TargetPose

P = GuidanceParameters()
PLAN = FlightPlan(
    takeoff_height_m=6.0,
    transit=TransitPlan(height_m=4.0, by_ranges=True),
    search=SearchPlan(height_m=4.0),
    lost=LostPlan(coast_s=4.0, hold_s=5.0, search_s=20.0),
)
DT = 0.02
PAD = np.array([18.0, -5.0, 0.05])  # the body origin of the standing vehicle is 0.2 m above the ground


def coarse(t: float, *, pad=PAD, yaw: float = 0.0, std: float = 0.3, age: float = 0.02, mahalanobis: float = 1.0):
    return CoarseTarget(
        t=t,
        position_ned=pad,
        yaw=yaw,
        covariance=np.diag([std**2, std**2, std**2, 0.01]),
        mahalanobis=mahalanobis,
        t_range=t - age,
        by_ranges=True,
    )


class Still:
    t, horizon, reset_counter = 0.0, 6.0, 0

    def __init__(self, pad: np.ndarray) -> None:
        self.pad = pad

    def at(self, t: float) -> TargetPose:
        return TargetPose(
            t=t,
            position_ned=self.pad,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.eye(4),
        )


def seen(t: float, position: np.ndarray, pad: np.ndarray) -> dict[str, object]:
    state = np.zeros(8)
    state[:3] = pad - position
    known = track(t, age=0.05, state=state, covariance=np.diag([0.02**2] * 8), position_ned=pad, nis=4.0)
    return {"track": known, "prediction": Still(pad)}


class Flown:
    """Follows the goal exactly; the pad comes into sight nearer than `sight` metres."""

    def __init__(self, plan: FlightPlan = PLAN, *, sight: float = 2.5, **estimate) -> None:
        self.guidance = Guidance(plan, P)
        self.sight, self.estimate = sight, estimate
        self.t, self.position, self.path, self.switches = 0.0, np.zeros(3), [], []
        self.guidance.update(replace(self.view(), status=replace(self.view().status, landed=LandedState.ON_GROUND)))
        self.position = np.array([0.0, 0.0, -5.7])

    def view(self) -> View:
        lateral = math.hypot(*(PAD - self.position)[:2])
        known = {"coarse": coarse(self.t, **self.estimate)}
        if lateral < self.sight:
            known |= seen(self.t, self.position, PAD)
        return view(self.t, position=self.position, **known)

    def step(self) -> Mode:
        self.t += DT
        now = self.view()
        decision = self.guidance.update(now)
        if decision.switched is not None:
            self.switches.append(decision.switched)
        goal = self.guidance.goal(now, DT)
        if goal is not None and decision.mode is Mode.TRANSIT:
            self.position = goal.at(self.t).position_ned.copy()
            self.path.append(self.position)
        return decision.mode

    def fly(self, seconds: float = 30.0) -> Mode:
        mode = self.step()
        while self.t < seconds and mode in (Mode.PREFLIGHT, Mode.TAKEOFF, Mode.TRANSIT):
            mode = self.step()
        return mode


def with_policy(policy: SwitchingPolicy, at: float = 3.0) -> FlightPlan:
    return replace(PLAN, land=LandPlan(policy=policy, deviate_at_m=at))


def test_it_flies_to_the_pad_never_lower_than_allowed_and_turns_to_it_when_seen() -> None:
    flown = Flown()
    assert flown.fly() is Mode.REORIENT
    assert [switch.mode for switch in flown.switches] == [Mode.TRANSIT, Mode.REORIENT]
    assert math.hypot(*(PAD - flown.position)[:2]) == pytest.approx(P.markov.reorient_floor_m, abs=0.05)
    unseen = [place for place in flown.path if math.hypot(*(PAD - place)[:2]) >= flown.sight]
    assert max(place[2] for place in unseen) <= -4.0 + 1e-9
    assert min(place[2] for place in unseen) >= -5.7 - 1e-9


def test_the_reference_keeps_speed_and_acceleration_and_does_not_jump() -> None:
    flown = Flown(sight=0.0)
    flown.fly()
    speeds = np.linalg.norm(np.diff(flown.path, axis=0)[:, :2], axis=1) / DT
    assert speeds.max() <= P.transit.speed_mps + 1e-6
    assert np.abs(np.diff(speeds)).max() <= 2.0 * P.transit.acceleration_mps2 * DT + 1e-6
    sinking = np.diff(np.array(flown.path)[:, 2]) / DT
    assert np.abs(sinking).max() <= P.transit.sink_rate_mps * 1.01
    assert np.abs(np.diff(sinking)[5:]).max() / DT < 1.0  # the lowest height is not run into


def test_a_pad_that_turns_out_to_be_elsewhere_moves_the_reference_by_the_share_that_is_flown() -> None:
    flown = Flown()
    while flown.step() is not Mode.TRANSIT or np.linalg.norm(flown.position[:2]) < 5.0:
        pass
    before = flown.position.copy()
    flown.estimate["pad"] = np.array([PAD[0], PAD[1] + 1.0, PAD[2]])
    flown.step()
    share = np.linalg.norm(before[:2]) / np.linalg.norm(PAD[:2])
    moved = flown.position - before
    assert moved[1] - (PAD[1] / PAD[0]) * moved[0] == pytest.approx(share, abs=0.1)
    assert share < 0.4


def test_without_a_sighting_it_searches_around_where_the_pad_should_be_and_never_lands() -> None:
    flown = Flown(sight=0.0)
    assert flown.fly() is Mode.SEARCH
    assert "not seen yet" in flown.switches[-1].reason
    assert flown.guidance._c.memory.centre_ned == pytest.approx(PAD)


def test_no_event_leads_from_the_way_there_to_a_descent() -> None:
    """Only modes that need the camera's track lead to a landing; reorient is entered with a sighting."""
    after = {mode for (before, _), mode in TRANSITIONS.items() if before is Mode.TRANSIT}
    assert after == {Mode.REORIENT, Mode.SEARCH, Mode.HOLD, Mode.ABORT, Mode.AUTOPILOT_LAND}


@pytest.mark.parametrize("at", [1.0, 2.2])
def test_a_fixed_policy_leaves_the_way_at_its_distance(at: float) -> None:
    flown = Flown(with_policy(SwitchingPolicy.FIXED, at))
    assert flown.fly() is Mode.REORIENT
    assert math.hypot(*(PAD - flown.position)[:2]) == pytest.approx(at, abs=0.06)


def test_the_markov_policy_leaves_it_the_earlier_the_farther_it_has_to_turn() -> None:
    """A11 = r / r_t / (1 + d) / |sin(e / 2)| (Parikh et al., Algorithm 1)."""
    ranges = []
    for yaw in (0.0, 2.0, math.pi):
        flown = Flown(sight=0.0, yaw=yaw)
        flown.fly()
        offset = PAD - flown.position
        ranges.append(math.hypot(*offset[:2], offset[2] - GEAR))
    assert ranges[2] == pytest.approx(0.4 * P.transit.activation_range_m, abs=0.1)
    assert ranges[0] < ranges[1] < ranges[2]


@pytest.mark.parametrize(
    ("estimate", "said"),
    [
        ({"age": 6.0}, "no range fused for 6.0 s"),
        ({"age": math.inf}, "no range fused yet"),
        ({"std": 4.0}, "known to 4.0 m only"),
        ({"mahalanobis": 5.0}, "not consistent"),
    ],
)
def test_it_holds_where_the_estimate_is_not_to_be_flown_by(estimate, said: str) -> None:
    flown = Flown()
    while flown.step() is not Mode.TRANSIT:
        pass
    flown.estimate |= estimate
    assert flown.step() is Mode.HOLD
    assert said in flown.switches[-1].reason


def test_it_flies_on_when_ranges_come_again_and_gives_up_when_they_do_not() -> None:
    for back, mode in ((8.0, Mode.TRANSIT), (math.inf, Mode.ABORT)):
        flown = Flown()
        while flown.step() is not Mode.TRANSIT:
            pass
        flown.estimate["age"] = 6.0
        held = flown.t
        while flown.t < held + 40.0:
            if flown.t > held + back:
                flown.estimate["age"] = 0.02
            if flown.step() not in (Mode.HOLD, Mode.TRANSIT):
                break
            if flown.switches[-1].mode is Mode.TRANSIT and flown.t > held + 1.0:
                break
        assert flown.switches[-1].mode is mode
        if mode is Mode.ABORT:
            assert flown.t - held == pytest.approx(PLAN.lost.hold_s + PLAN.lost.search_s, abs=0.1)


def test_a_short_gap_in_the_ranges_is_coasted_over() -> None:
    flown = Flown(age=5.0)
    assert flown.fly() is Mode.REORIENT


def test_lost_far_from_the_pad_it_goes_back_to_the_way_there_and_near_it_searches() -> None:
    for place, mode in (((0.0, 0.0, -5.0), Mode.TRANSIT), ((16.0, -5.0, -4.0), Mode.SEARCH)):
        flown = Flown(sight=0.0)
        memory = flown.guidance._c.memory
        memory.mode, memory.t_entered, flown.position = Mode.HOLD, 0.0, np.array(place)
        while flown.step() is Mode.HOLD and flown.t < 10.0:
            pass
        assert flown.guidance.mode is mode


def test_engaged_in_flight_it_goes_there_only_if_it_knows_where_that_is() -> None:
    for known, mode in ((coarse(1.0), Mode.TRANSIT), (None, Mode.SEARCH)):
        guidance = Guidance(PLAN, P)
        assert guidance.update(view(1.0, coarse=known)).mode is mode
