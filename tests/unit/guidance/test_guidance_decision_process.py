"""Learning and solving the switching decision: against hand, linear programming and policy iteration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from companion.guidance.decision_process.approach_log import Action, ApproachRecorder, Epoch, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.guidance.decision_process.model import LearningParameters, TransitionModel, learn
from companion.guidance.decision_process.solve import (
    CostWeights,
    evaluated,
    expectation,
    pair_costs,
    policy_iteration,
    value_iteration,
)
from companion.guidance.decision_process.table import CAREFULNESS, SwitchingTable, solve_table
from companion.guidance.docking.optimal_switching import OptimalSwitching
from companion.guidance.docking.policies import FixedDistances
from companion.messages.docking import DockingMode, SwitchingSituation

GRID = DecisionGrid(range=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), misalignment=(0.0, 0.5, 1.01), position_std=(0.0, 0.01, 0.1))
NO_PRIOR = LearningParameters(prior_weight=0.0, least_visits=1)
WEIGHTS = CostWeights(time_scale=10.0, impulse_scale=1.0, impulse_weight=0.0)


def at(range_: float, mode: DockingMode = DockingMode.REORIENT, **changed) -> SwitchingSituation:
    values = {"misalignment": 0.1, "mahalanobis": 1.0, "position_std": 0.005, "vision": False, "reorient_range": None}
    return SwitchingSituation(mode=mode, range=range_, **{**values, **changed})


def epoch(
    range_: float, *, action: Action = Action.KEEP, elapsed: float = 1.0, impulse: float = 0.1, **changed
) -> Epoch:
    return Epoch(situation=at(range_, **changed), action=action, elapsed=elapsed, impulse=impulse)


def approach(last: float, *, docked: bool, seed: int = 0, start: float = 0.55) -> LoggedApproach:
    """Comes nearer by 0.1 m a second, switches at `last`; from there it takes 20 s for each metre to the port."""
    ranges = np.arange(start, last + 0.01, -0.1)
    epochs = [epoch(float(r)) for r in ranges]
    return LoggedApproach(
        seed=seed, epochs=(*epochs, epoch(last, action=Action.SWITCH, elapsed=1.0 + 40.0 * last)), docked=docked
    )


def flights(misses: dict[float, int], of: int = 20) -> list[LoggedApproach]:
    """`of` approaches for each range of switching, of which so many miss."""
    return [approach(last, docked=k >= missed, seed=k) for last, missed in misses.items() for k in range(of)]


def random_model(rng: np.random.Generator, n: int) -> TransitionModel:
    """States with one or two actions; each leads to some others or to an end."""
    pairs = [(s, a) for s in range(n) for a in range(2) if a == 0 or rng.random() < 0.7]
    arcs, missed, docked = [], [], []
    for k, _ in enumerate(pairs):
        shares = rng.dirichlet(np.ones(6))
        arcs += [(k, int(c), p) for c, p in zip(rng.choice(n, 4, replace=False), shares[:4], strict=True)]
        missed.append(shares[4])
        docked.append(shares[5])
    return TransitionModel(
        states=tuple(range(n)),
        pair_state=np.array([p[0] for p in pairs]),
        pair_action=np.array([p[1] for p in pairs]),
        visits=np.ones(len(pairs), dtype=np.int64),
        time=rng.uniform(0.1, 2.0, len(pairs)),
        impulse=rng.uniform(0.0, 1.0, len(pairs)),
        missed=np.array(missed),
        docked=np.array(docked),
        inaccuracy=rng.uniform(0.0, 0.1, len(pairs)),
        row=np.array([a[0] for a in arcs]),
        column=np.array([a[1] for a in arcs]),
        probability=np.array([a[2] for a in arcs]),
        start=np.full(n, 1.0 / n),
    )


def by_linear_programming(model: TransitionModel, costs: np.ndarray) -> np.ndarray:
    """The largest values with V(s) <= c(s, a) + sum P V for every pair."""
    n, k = len(model.states), len(costs)
    lhs = np.zeros((k, n))
    lhs[np.arange(k), model.pair_state] = 1.0
    np.subtract.at(lhs, (model.row, model.column), model.probability)
    result = linprog(-np.ones(n), A_ub=lhs, b_ub=costs, bounds=[(None, None)] * n)
    assert result.success
    return result.x


@pytest.mark.parametrize("seed", range(1, 6))
def test_value_iteration_policy_iteration_and_linear_programming_agree(seed: int) -> None:
    model = random_model(np.random.default_rng(seed), 30)
    costs = pair_costs(model, CostWeights(), 10.0)
    solution, other = value_iteration(model, costs), policy_iteration(model, costs)
    assert solution.residual <= 1e-11 * max(1.0, solution.values.max())
    np.testing.assert_allclose(solution.values, other.values, atol=1e-8)
    np.testing.assert_array_equal(solution.choice, other.choice)
    np.testing.assert_allclose(solution.values, by_linear_programming(model, costs), atol=1e-6)


def test_a_chain_solved_by_hand() -> None:
    # 0.1 m a second nearer; switched at r it takes 1 + 40 r seconds more and misses in a known share.
    misses = {0.45: 0, 0.35: 0, 0.25: 2, 0.15: 10}
    model = learn(flights(misses), GRID, NO_PRIOR)
    for carefulness in (0.1, 1.0, 3.0, 10.0, 100.0):
        solution = value_iteration(model, pair_costs(model, WEIGHTS, carefulness))
        begin = 0.55
        by_hand = {
            last: ((begin - last) / 0.1 + 1.0 + 40.0 * last) / 10.0 + carefulness * missed / 20.0
            for last, missed in misses.items()
        }
        assert float(model.start @ solution.values) == pytest.approx(min(by_hand.values()), abs=1e-9)


def test_more_carefulness_never_raises_the_expected_misses() -> None:
    for seed in range(1, 6):
        model = random_model(np.random.default_rng(seed), 40)
        choices = [
            value_iteration(model, pair_costs(model, CostWeights(), c)).choice for c in np.geomspace(0.01, 1e3, 12)
        ]
        misses = np.array([evaluated(model, choice, model.missed) for choice in choices])
        assert (np.diff(misses, axis=0) <= 1e-9).all()
        assert expectation(model, choices[-1]).miss < expectation(model, choices[0]).miss


def test_a_problem_without_end_is_refused() -> None:
    model = random_model(np.random.default_rng(1), 5)
    staying = model.probability / np.bincount(model.row, weights=model.probability)[model.row]
    endless = replace(model, missed=0.0 * model.missed, docked=0.0 * model.docked, probability=staying)
    with pytest.raises(ValueError, match="leads to an end"):
        policy_iteration(endless, np.ones(len(model.time)))
    with pytest.raises(ValueError, match="leads to an end"):
        value_iteration(endless, np.ones(len(model.time)), most_iterations=50)


def test_counts_become_probabilities() -> None:
    model = learn(flights({0.45: 0, 0.15: 5}, of=10), GRID, NO_PRIOR)
    leaving = np.bincount(model.row, weights=model.probability, minlength=len(model.time))
    np.testing.assert_allclose(leaving + model.missed + model.docked, 1.0, atol=1e-12)
    near = next(k for k, a in enumerate(model.pair_action) if a and model.missed[k] > 0.0)
    assert model.missed[near] == pytest.approx(0.5)
    assert model.states[model.pair_state[near]] == GRID.cell(at(0.15))


def test_few_flights_do_not_look_certain() -> None:
    model = learn([approach(0.25, docked=True)], GRID, LearningParameters(least_visits=1))
    assert 0.0 < model.missed.max() < 0.5
    many = learn(flights({0.25: 0}, of=500), GRID, LearningParameters(least_visits=1))
    assert many.missed.max() < 0.001


def test_what_was_never_or_hardly_seen_is_not_chosen() -> None:
    log = flights({0.45: 10, 0.25: 10})
    lucky = approach(0.35, docked=True)  # one switch at 0.35 m that went well, among many that did not
    model = learn([*log, lucky], GRID, LearningParameters(least_visits=3))
    pairs = {(model.states[s], a) for s, a in zip(model.pair_state, model.pair_action, strict=True)}
    assert (GRID.cell(at(0.35)), 1) not in pairs
    assert (GRID.cell(at(0.35)), 0) in pairs
    assert (GRID.cell(at(0.55)), 1) not in pairs
    alone = learn([lucky], GRID, LearningParameters(least_visits=3))  # all there is: taken, for want of another
    assert (GRID.cell(at(0.35)), 1) in {
        (alone.states[s], a) for s, a in zip(alone.pair_state, alone.pair_action, strict=True)
    }


def test_epochs_outside_of_the_grid_cost_but_are_no_states() -> None:
    log = [approach(0.15, docked=True, start=1.05)]
    model = learn(log, GRID, NO_PRIOR)
    assert len(model.states) == 5
    inside = value_iteration(model, pair_costs(model, WEIGHTS, 1.0))
    assert float(model.start @ inside.values) == pytest.approx((4.0 + 7.0) / 10.0)
    with pytest.raises(ValueError, match="widen the grid"):
        learn([LoggedApproach(seed=1, epochs=(epoch(2.0),), docked=True)], GRID, NO_PRIOR)


def test_cells_are_told_apart_by_every_part_of_the_state() -> None:
    situations = [
        at(r, mode, misalignment=m, position_std=s, vision=v, ahead=a)
        for a in (False, True)
        for mode in (DockingMode.APPROACH, DockingMode.REORIENT, DockingMode.ALIGN)
        for r in (0.15, 0.25, 0.35, 0.45, 0.55)
        for m in (0.1, 0.9)
        for s in (0.005, 0.05)
        for v in (False, True)
    ]
    assert [GRID.cell(s) for s in situations] == list(range(np.prod(GRID.shape)))
    for outside in (at(0.05), at(0.6), at(0.3, position_std=0.2), at(0.3, DockingMode.DOCK)):
        assert GRID.cell(outside) is None
    with pytest.raises(ValueError, match="ascending"):
        DecisionGrid(range=(0.2, 0.1))


def test_the_recorder_cuts_at_ranges_times_and_switches() -> None:
    recorder = ApproachRecorder(range_step=0.1, time_step=5.0)
    for k in range(40):  # 0.02 m/s, then at rest; a step is 0.5 s
        r = max(0.5, 0.8 - 0.01 * k)
        recorder.observe(0.5 * k, at(r, DockingMode.APPROACH), action=Action.KEEP, impulse=0.01 * k)
    recorder.observe(20.0, at(0.5, DockingMode.APPROACH), action=Action.SWITCH, impulse=0.4)
    recorder.observe(20.5, at(0.5), action=Action.KEEP, impulse=0.4)
    log = recorder.finish(60.0, seed=7, docked=True, impulse=2.0)
    assert [e.action for e in log.epochs].index(Action.SWITCH) == len(log.epochs) - 2
    assert sum(e.elapsed for e in log.epochs) == pytest.approx(60.0)
    assert sum(e.impulse for e in log.epochs) == pytest.approx(2.0)
    assert all(e.elapsed <= 5.0 for e in log.epochs[:-1])
    assert log.epochs[-2].elapsed == pytest.approx(0.5)
    with pytest.raises(ValueError, match="no decision"):
        ApproachRecorder().finish(1.0, seed=1, docked=True, impulse=0.0)


def table(**changed) -> SwitchingTable:
    log = flights({0.45: 0, 0.35: 0, 0.25: 2, 0.15: 10})
    values = {"commit": "abc1234", "grid": GRID, "learning": NO_PRIOR, "weights": WEIGHTS}
    return solve_table(log, **{**values, **changed})


def switching_range(policy: OptimalSwitching) -> float:
    return next(r for r in (0.55, 0.45, 0.35, 0.25, 0.15) if policy.decide(at(r)).switch)


def test_the_table_switches_earlier_the_more_careful_it_is() -> None:
    ranges = [switching_range(OptimalSwitching(table(), carefulness=c)) for c in CAREFULNESS]
    assert ranges == sorted(ranges)
    assert (ranges[0], ranges[-1]) == (0.15, 0.35)
    misses = [policy.expected.miss for policy in table().policies]
    assert misses == sorted(misses, reverse=True)


def test_outside_of_the_table_fixed_distances_answer_and_say_so() -> None:
    policy = OptimalSwitching(table(), carefulness=10.0, fallback=FixedDistances(reorient_range=0.9, align_range=0.4))
    beyond, unseen = policy.decide(at(0.7)), policy.decide(at(0.35, vision=True))
    assert not beyond.switch
    assert beyond.fallback
    assert "outside of the table" in beyond.reason
    assert unseen.switch
    assert unseen.fallback
    assert "never seen" in unseen.reason
    assert not policy.decide(at(0.35)).fallback


def courses(ahead: float, to_the_place: float, *, fold: bool = False) -> list[LoggedApproach]:
    """Flights on both courses that cost so much [N s] after the choice; `fold`: the logs do not tell the course."""
    logs = []
    for seed in range(20):
        aims = seed % 2 == 0
        told, cost = aims and not fold, ahead if aims else to_the_place
        epochs = (
            epoch(0.55, mode=DockingMode.APPROACH, action=Action.AHEAD if aims else Action.KEEP, impulse=0.1),
            epoch(0.45, mode=DockingMode.APPROACH, ahead=told, impulse=0.1),
            epoch(0.35, mode=DockingMode.APPROACH, ahead=told, action=Action.SWITCH, impulse=0.1),
            epoch(0.25, ahead=told, action=Action.SWITCH, impulse=cost),
        )
        logs.append(LoggedApproach(seed=seed, epochs=epochs, docked=True))
    return logs


@pytest.mark.parametrize(("ahead", "place", "aims"), [(0.1, 0.2, True), (0.3, 0.2, False)])
def test_it_aims_ahead_where_and_only_where_that_costs_less(ahead: float, place: float, aims: bool) -> None:
    weights = replace(WEIGHTS, impulse_weight=1.0)
    policy = OptimalSwitching(table_of(courses(ahead, place), weights), carefulness=1.0)
    first = policy.decide(at(0.55, DockingMode.APPROACH))
    assert (first.ahead, first.switch) == (aims, False)
    later = policy.decide(at(0.35, DockingMode.APPROACH, ahead=aims))
    assert (later.ahead, later.switch, later.fallback) == (False, True, False)
    told = table_of(courses(ahead, place), weights).policies[0].expected.impulse
    assert told == pytest.approx(0.3 + min(ahead, place))
    # Cells that could not tell the course would believe that the choice makes no odds.
    blurred = table_of(courses(ahead, place, fold=True), weights).policies[0].expected.impulse
    assert blurred == pytest.approx(0.3 + 0.5 * (ahead + place))


def test_accuracy_is_bought_where_it_is_worth_its_time() -> None:
    # Switched at 0.45 m it takes 8 s more than at 0.25 m, and touches more accurately by 0.04.
    log = [
        replace(approach(last, docked=True, seed=k), inaccuracy=inaccuracy)
        for last, inaccuracy in ((0.45, 0.01), (0.25, 0.05))
        for k in range(20)
    ]
    begin, scale = 0.55, WEIGHTS.time_scale
    for weight in (0.0, 5.0, 14.0, 16.0, 100.0):
        weights = replace(WEIGHTS, inaccuracy_weight=weight)
        solved = table_of(log, weights)
        by_hand = {
            last: ((begin - last) / 0.1 + 1.0 + 40.0 * last) / scale + weight * inaccuracy
            for last, inaccuracy in ((0.45, 0.01), (0.25, 0.05))
        }
        best = min(by_hand, key=lambda last: by_hand[last])
        assert switching_range(OptimalSwitching(solved, carefulness=1.0)) == best
        assert solved.policies[0].expected.inaccuracy == pytest.approx({0.45: 0.01, 0.25: 0.05}[best])


def table_of(log: list[LoggedApproach], weights: CostWeights) -> SwitchingTable:
    return solve_table(log, commit="abc1234", grid=GRID, learning=NO_PRIOR, weights=weights)


def test_the_nearest_carefulness_is_taken_by_ratio() -> None:
    assert OptimalSwitching(table(), carefulness=10.0).carefulness == 10.0
    assert OptimalSwitching(table(), carefulness=18.0).carefulness == 30.0
    assert OptimalSwitching(table(), carefulness=1e4).carefulness == 100.0
    with pytest.raises(ValueError, match="greater than 0"):
        OptimalSwitching(table(), carefulness=0.0)


def test_a_table_that_does_not_fit_its_grid_is_refused() -> None:
    good = table()
    with pytest.raises(ValueError, match="30 rows of 8 letters"):
        replace(good, policies=(replace(good.policies[0], rows=good.policies[0].rows[1:]),))
    with pytest.raises(ValueError, match="other letters"):
        replace(good, policies=(replace(good.policies[0], rows=("x" * 8,) * 30),))
