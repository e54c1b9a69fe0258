"""Whole dockings of a chaser that follows its goal: modes, smoothness, clearance, and what failures lead to."""

import math
from dataclasses import replace

import numpy as np
import pytest
from docking_flights import (
    CENTRE,
    DOCKED,
    IDENTITY,
    NORMAL,
    PERIOD,
    SETUP,
    START,
    Flight,
    FollowingChaser,
    apart,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.guidance.decision_process.approach_log import Action, ApproachRecorder, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.guidance.decision_process.model import LearningParameters
from companion.guidance.decision_process.solve import CostWeights
from companion.guidance.decision_process.table import solve_table
from companion.guidance.docking.courses import first_within
from companion.guidance.docking.guidance import DockingGuidance
from companion.guidance.docking.optimal_switching import OptimalSwitching
from companion.guidance.docking.parameters import DockingParameters
from companion.guidance.docking.policies import FixedDistances, MarkovSwitching, SwitchingPolicy
from companion.guidance.docking.port import DockingSetup, Port, triple
from companion.guidance.docking.turn import misalignment
from companion.messages.docking import DockingMode, SwitchingSituation, SwitchingVerdict
from companion.messages.proximity import ProximityState

M = DockingMode
P = DockingParameters()
LINE = [M.WAIT, M.APPROACH, M.REORIENT, M.ALIGN, M.DOCK, M.DOCKED]


class Never:
    """A policy that never switches: the guidance's own limits have to."""

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        return SwitchingVerdict(switch=False, reason="never")


class AtOnce:
    """A policy that always switches."""

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        return SwitchingVerdict(switch=True, reason="at once")


class Ahead(FixedDistances):
    """Aims ahead from the first decision on, turns at its distance, and leaves the way in to the guidance."""

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        if situation.mode is M.APPROACH:
            return replace(super().decide(situation), ahead=not situation.ahead)
        return SwitchingVerdict(switch=False, reason="as far as the way leads")


POLICIES = [FixedDistances(), MarkovSwitching(), Never(), AtOnce()]


def chaser(policy: SwitchingPolicy, setup: DockingSetup = SETUP, seed: int = 1, **options) -> FollowingChaser:
    guidance = DockingGuidance(P, setup, policy)
    return FollowingChaser(guidance, np.random.default_rng(seed), **options)


def check_smooth(flight: Flight) -> None:
    """Between two steps the goal is a parabola, carried a little only on the approach; its acceleration is bounded, and
    the turn's rate fits its attitude."""
    begin = next(k for k, d in enumerate(flight.decisions) if d.mode is not M.WAIT)
    goals = flight.goals[begin:]
    position, velocity, a = (np.array([getattr(g, n) for g in goals]) for n in ("position", "velocity", "acceleration"))
    assert np.linalg.norm(a, axis=1).max() <= P.motion.acceleration + 1e-12
    expected = position + PERIOD * velocity + 0.5 * PERIOD**2 * a
    carried = np.linalg.norm(position[1:] - expected[:-1], axis=1)
    approaching = np.array([d.mode is M.APPROACH for d in flight.decisions[begin + 1 :]])
    assert np.all(carried[~approaching] <= 1e-12)
    assert np.all(carried[approaching] <= P.motion.lead * PERIOD / P.motion.carry_time)
    np.testing.assert_allclose(velocity[1:], (velocity + PERIOD * a)[:-1], atol=1e-12)
    attitude, turning = np.array([g.quaternion for g in goals]), np.array([g.rate for g in goals])
    rates = np.linalg.norm(turning, axis=1)
    assert rates.max() <= P.motion.turn_rate + 1e-12
    steepest = 1.5 * P.motion.turn_rate / P.motion.turn_ramp
    assert np.linalg.norm(np.diff(turning, axis=0), axis=1).max() <= steepest * PERIOD + 1e-9
    chords = np.minimum(
        np.linalg.norm(attitude[1:] - attitude[:-1], axis=1), np.linalg.norm(attitude[1:] + attitude[:-1], axis=1)
    )
    np.testing.assert_allclose(4.0 * np.arcsin(0.5 * chords), PERIOD * 0.5 * (rates[1:] + rates[:-1]), atol=1e-4)


@pytest.mark.parametrize("policy", POLICIES, ids=lambda p: type(p).__name__)
def test_every_policy_docks_smoothly_in_the_committed_scenario(policy: SwitchingPolicy) -> None:
    flight = chaser(policy).fly()
    assert flight.modes == LINE
    check_smooth(flight)
    error = flight.positions[-1] - DOCKED
    assert np.linalg.norm(error - (error @ NORMAL) * NORMAL) < 0.001
    assert misalignment(flight.goals[-1].quaternion, SETUP.quaternion) == 0.0
    assert np.linalg.norm(flight.goals[-2].velocity) <= P.motion.dock_speed + 1e-9


def test_a_later_switch_makes_the_way_shorter() -> None:
    fixed, markov = chaser(FixedDistances()).fly(), chaser(MarkovSwitching()).fly()
    assert markov.times[-1] < 0.9 * fixed.times[-1]


@pytest.mark.parametrize("policy", [*POLICIES, Ahead()], ids=lambda p: type(p).__name__)
def test_the_chaser_does_not_come_near_before_it_has_turned(policy: SwitchingPolicy) -> None:
    flight = chaser(policy).fly()
    for position, goal in zip(flight.positions, flight.goals, strict=True):
        if misalignment(goal.quaternion, SETUP.quaternion) > P.clearance.turned:
            assert np.linalg.norm(position - DOCKED) > P.clearance.turning_range - 0.005


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    direction=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    distance=st.floats(0.35, 1.5),
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    angle=st.floats(0.0, 3.1),
    policy=st.sampled_from([*POLICIES, Ahead()]),
)
def test_from_anywhere_the_cubes_stay_apart(direction, distance, axis, angle, policy) -> None:
    unit = np.array(direction) / np.linalg.norm(direction)
    tilt = np.array(axis) / np.linalg.norm(axis)
    attitude = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * tilt])
    setup = DockingSetup(position=DOCKED, quaternion=SETUP.quaternion, normal=NORMAL, start_quaternion=attitude)
    flight = chaser(policy, setup, start=CENTRE + distance * unit).fly()
    assert flight.modes[-1] is M.DOCKED
    check_smooth(flight)
    for position, goal, decision in list(zip(flight.positions, flight.goals, flight.decisions, strict=True))[::3]:
        if decision.mode in (M.APPROACH, M.REORIENT, M.ALIGN):
            assert apart(position, goal.quaternion) > 0.03
        elif decision.mode is M.DOCK:
            assert float((position - DOCKED) @ NORMAL) > -1e-3 or np.linalg.norm(position - DOCKED) < 0.012


def test_a_start_too_near_to_turn_backs_out_first() -> None:
    flight = chaser(FixedDistances(), start=DOCKED + 0.12 * NORMAL).fly()
    assert flight.modes[-1] is M.DOCKED
    turning = [
        np.linalg.norm(p - DOCKED)
        for p, g in zip(flight.positions, flight.goals, strict=True)
        if np.linalg.norm(g.rate) > 0.0
    ]
    assert min(turning) > P.clearance.turning_range - 0.025


def test_with_early_vision_alignment_is_left_out() -> None:
    setup = DockingSetup(position=DOCKED, quaternion=SETUP.quaternion, normal=NORMAL, start_quaternion=SETUP.quaternion)
    start = DOCKED + 1.2 * NORMAL + np.array([0.25, 0.0, 0.1])
    flight = chaser(FixedDistances(), setup, start=start).fly()
    assert flight.modes == [M.WAIT, M.APPROACH, M.REORIENT, M.DOCK, M.DOCKED]
    check_smooth(flight)
    straight = [p for p in flight.positions if 0.0 < (p - DOCKED) @ NORMAL < 0.5 * P.corridor.straight]
    assert max(np.linalg.norm(p - DOCKED - ((p - DOCKED) @ NORMAL) * NORMAL) for p in straight) < 0.002


def test_without_vision_it_tries_again_farther_out_then_gives_up_clear_of_the_target() -> None:
    parameters = DockingParameters(timeout=1000.0)
    toy = FollowingChaser(DockingGuidance(parameters, SETUP, FixedDistances()), np.random.default_rng(1), blind=True)
    flight = toy.fly(until=1000.0)
    assert flight.modes == [*LINE[:4], M.RETREAT, M.ALIGN, M.RETREAT, M.ALIGN, M.RETREAT, M.HOLD]
    ranges = [d.align_range for d in flight.decisions if d.switched is not None and d.mode is M.ALIGN]
    assert ranges == sorted(ranges)
    assert ranges[-1] > ranges[0] + 0.15
    assert flight.decisions[-1].failed_attempts == P.attempts
    assert np.linalg.norm(flight.positions[-1] - DOCKED) == pytest.approx(P.retreat_range, abs=0.01)


def test_pushed_off_the_corridor_it_backs_off_and_docks_in_the_next_attempt() -> None:
    toy = chaser(FixedDistances())
    step = toy.guidance.step

    def pushed(t, state, *, contact):
        decision, goal = step(t, state, contact=contact)
        away = 0.04 if decision.mode is M.DOCK and decision.failed_attempts == 0 else 0.0
        toy.push = np.array([away, 0.0, 0.0])
        return decision, goal

    toy.guidance.step = pushed
    flight = toy.fly()
    assert flight.modes == [*LINE[:5], M.RETREAT, M.ALIGN, M.DOCK, M.DOCKED]
    check_smooth(flight)


def test_without_contact_the_attempt_fails() -> None:
    flight = chaser(FixedDistances(), touch=False, noise=0.003).fly()
    assert flight.modes[:6] == [*LINE[:5], M.RETREAT]
    assert "no contact" in next(d.switched.reason for d in flight.decisions if d.mode is M.RETREAT and d.switched)


def test_when_time_is_up_it_stops_far_out_and_moves_clear_near_by() -> None:
    for timeout, modes in ((20.0, [M.WAIT, M.APPROACH, M.HOLD]), (90.0, [*LINE[:4], M.RETREAT, M.HOLD])):
        guidance = DockingGuidance(DockingParameters(timeout=timeout), SETUP, FixedDistances())
        flight = FollowingChaser(guidance, np.random.default_rng(1)).fly()
        assert flight.modes == modes
        assert f"> {timeout:.0f} s" in next(d.switched.reason for d in flight.decisions if d.t > timeout)


def test_the_goal_waits_for_silent_sensors() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    for k in range(600):
        t = PERIOD * k
        _, goal = guidance.step(t, state_at(t, START, t_range=t - 10.0 * (k > 0)))
    assert np.linalg.norm(goal.velocity) < 1e-9
    assert np.linalg.norm(goal.position - START) < 0.01


def test_the_goal_does_not_run_away_from_a_chaser_that_stays_behind() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    behind = START - np.array([0.2, 0.0, 0.0])
    for k in range(600):
        _, goal = guidance.step(PERIOD * k, state_at(PERIOD * k, behind if k else START))
    assert np.linalg.norm(goal.position - behind) <= P.motion.lead


def test_on_the_approach_what_the_estimate_was_off_is_not_flown_back() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    aside = np.array([0.03, 0.0, -0.03])  # across the way
    goals = [guidance.step(PERIOD * k, state_at(PERIOD * k, START + (aside if k > 5 else 0.0)))[1] for k in range(200)]
    assert float((goals[-1].position - START) @ aside) >= 0.9 * float(aside @ aside)


class NearAndOn(FixedDistances):
    """Aligns as near as may be, and goes in without coming to rest."""

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        if situation.mode is M.ALIGN:
            return SwitchingVerdict(switch=True, reason="goes on")
        return replace(super().decide(situation), near=situation.mode is M.REORIENT)


def test_aligned_near_and_without_a_stop_it_docks_sooner_and_keeps_its_speed() -> None:
    distances = {"reorient_range": 0.7, "align_range": 0.3}
    stopped, going = (chaser(policy(**distances)).fly() for policy in (FixedDistances, NearAndOn))
    assert stopped.modes == going.modes == LINE
    check_smooth(going)
    assert going.times[-1] < stopped.times[-1] - 5.0
    slowest = {
        name: min(
            np.linalg.norm(goal.velocity)
            for goal, decision in zip(flight.goals, flight.decisions, strict=True)
            if decision.mode in (M.ALIGN, M.DOCK)
        )
        for name, flight in (("stopped", stopped), ("going", going))
    }
    assert slowest["stopped"] < 0.002
    assert slowest["going"] > 0.004
    switched = next(d.situation for d in going.decisions if d.switched is not None and d.mode is M.DOCK)
    assert switched.vision
    aligned = next(d for d in going.decisions if d.mode is M.ALIGN)
    assert aligned.align_range == P.clearance.near_align_range


def planned_changes(flight: Flight) -> float:
    """Velocity [m/s] that the goal's accelerations add up to once it flies, each axis on its own like the nozzles."""
    flown = zip(flight.goals, flight.decisions, strict=True)
    return PERIOD * sum(
        float(np.abs(goal.acceleration).sum()) for goal, d in flown if d.mode not in (M.WAIT, M.APPROACH)
    )


def test_aiming_ahead_plans_fewer_changes_of_velocity_and_sees_for_longer() -> None:
    on_sight, ahead = chaser(NearAndOn(reorient_range=0.7)).fly(), chaser(Ahead(reorient_range=0.7)).fly()
    assert ahead.modes == [M.WAIT, M.APPROACH, M.REORIENT, M.DOCK, M.DOCKED]
    check_smooth(ahead)
    assert planned_changes(ahead) < 0.8 * planned_changes(on_sight)
    straight = [p for p in ahead.positions if 0.0 < (p - DOCKED) @ NORMAL < 0.5 * P.corridor.straight]
    assert max(np.linalg.norm(p - DOCKED - ((p - DOCKED) @ NORMAL) * NORMAL) for p in straight) < 0.002
    entered = {name: flight.entered(M.DOCK) for name, flight in (("sight", on_sight), ("ahead", ahead))}
    left = {name: f.times[-1] - entered[name].t for name, f in (("sight", on_sight), ("ahead", ahead))}
    assert left["ahead"] > left["sight"] + 3.0  # with vision, to settle in


def test_ahead_is_for_good_and_told_to_the_policy() -> None:
    flight = chaser(Ahead(reorient_range=0.7)).fly()
    told = [d.situation.ahead for d in flight.decisions if d.situation is not None]
    assert told == [False] + [True] * (len(told) - 1)


def test_blind_at_the_end_of_the_way_ahead_it_aligns_there() -> None:
    toy = FollowingChaser(DockingGuidance(P, SETUP, Ahead(reorient_range=0.7)), np.random.default_rng(1), blind=True)
    flight = toy.fly(until=140.0)
    assert flight.modes == LINE[:4]
    aligned = flight.entered(M.ALIGN)
    assert "the way ahead ends here" in aligned.switched.reason
    assert aligned.align_range == pytest.approx(P.clearance.ahead_range, abs=0.06)


@given(
    start=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    end=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    end_range=st.floats(0.05, 0.5),
)
def test_a_way_ends_where_it_comes_too_near(start, end, end_range) -> None:
    port = Port(SETUP)
    start, end = DOCKED + np.array(start), DOCKED + np.array(end)
    if np.linalg.norm(start - DOCKED) <= end_range:
        return
    last = np.array(first_within(port, triple(start), triple(end), end_range))
    for share in np.linspace(0.0, 1.0, 50):
        assert np.linalg.norm(start + share * (last - start) - DOCKED) >= end_range - 1e-6
    on_the_way = np.linalg.norm(start - last) + np.linalg.norm(last - end) - np.linalg.norm(start - end)
    assert on_the_way == pytest.approx(0.0, abs=1e-6)
    assert np.allclose(last, end) or np.linalg.norm(last - DOCKED) == pytest.approx(end_range, abs=1e-6)


def test_a_silent_estimator_makes_the_goal_neither_jump_nor_run_away() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    for k in range(100):
        _, before = guidance.step(PERIOD * k, state_at(PERIOD * k, START))
    _, after = guidance.step(60.0, state_at(60.0, START))
    assert np.linalg.norm(after.position - before.position) < P.motion.approach_speed * P.motion.longest_step + 1e-3


def test_it_waits_for_a_known_position_but_not_for_ever() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    modes = [guidance.step(t, state_at(t, START, std=0.05))[0].mode for t in np.arange(0.0, 7.0, PERIOD)]
    waited = PERIOD * modes.count(M.WAIT)
    assert waited == pytest.approx(P.settling.start_patience, abs=2 * PERIOD)
    assert modes[-1] is M.APPROACH


def test_time_backwards_and_numbers_that_are_none_are_refused() -> None:
    guidance = DockingGuidance(P, SETUP, FixedDistances())
    guidance.step(1.0, state_at(1.0, START))
    with pytest.raises(ValueError, match="backwards"):
        guidance.step(0.9, state_at(0.9, START))
    with pytest.raises(ValueError, match="finite"):
        guidance.step(1.1, state_at(1.1, np.full(3, np.nan)))
    with pytest.raises(ValueError, match="normal has the length 2"):
        DockingSetup(position=DOCKED, quaternion=IDENTITY, normal=2.0 * NORMAL, start_quaternion=IDENTITY)


def test_the_same_flight_gives_the_same_bits() -> None:
    one, two = (chaser(MarkovSwitching(), seed=3).fly() for _ in range(2))
    assert one.decisions == two.decisions
    assert all(np.array_equal(a.position, b.position) for a, b in zip(one.goals, two.goals, strict=True))


def logged(setup: DockingSetup, seed: int) -> LoggedApproach:
    """A flight that switches at ranges drawn for it."""
    rng = np.random.default_rng(seed)
    policy = FixedDistances(reorient_range=rng.uniform(0.3, 1.4), align_range=rng.uniform(0.1, 0.5))
    flight = FollowingChaser(DockingGuidance(P, setup, policy), rng).fly()
    recorder = ApproachRecorder()
    for decision in flight.decisions:
        if decision.situation is not None and decision.verdict is not None:
            action = Action.of(decision.verdict)
            recorder.observe(decision.t, decision.situation, action=action, impulse=0.004 * decision.t)
    docked = flight.modes[-1] is M.DOCKED
    return recorder.finish(flight.times[-1], seed=seed, docked=docked, impulse=0.004 * flight.times[-1])


def test_what_was_learned_from_flights_flies_faster_than_fixed_distances() -> None:
    log = [logged(SETUP, seed) for seed in range(1, 9)]
    assert all([epoch.action for epoch in approach.epochs].count(Action.SWITCH) == 2 for approach in log)
    learning = LearningParameters(least_visits=1)
    table = solve_table(log, commit="none", grid=DecisionGrid(), learning=learning, weights=CostWeights())
    optimal = chaser(OptimalSwitching(table, carefulness=1.0), seed=101).fly()
    assert optimal.modes == LINE
    assert optimal.times[-1] < chaser(FixedDistances(), seed=101).fly().times[-1]
    assert optimal.times[-1] < np.mean([sum(epoch.elapsed for epoch in approach.epochs) for approach in log])


def state_at(t: float, position, *, std: float = 0.01, t_range: float | None = None) -> ProximityState:
    return ProximityState(
        t=t,
        position=np.asarray(position, dtype=float),
        velocity=np.zeros(3),
        quaternion=IDENTITY,
        rate=np.zeros(3),
        covariance=np.diag([std**2] * 3 + [1e-6] * 6),
        mahalanobis=1.0,
        t_vision=-math.inf,
        t_range=t if t_range is None else t_range,
    )
