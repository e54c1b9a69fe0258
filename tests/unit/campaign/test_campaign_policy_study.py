"""Learning the switching policy: seeds of its own, draws, logs that survive their files, scales, and the command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import companion.campaign.mission as campaign_mission
from companion.campaign import policy_study
from companion.campaign.exploration import (
    ExplorationParameters,
    drawn_switching,
    explore,
    learning_seeds,
    log_as_json,
    log_from_json,
)
from companion.campaign.policy_study import explorations, policy_tasks, weights_of
from companion.campaign.result import DockingFigures, FlightResult, Outcome
from companion.campaign.runner import Options
from companion.campaign.seeds import MAX_SEED
from companion.campaign.versions import project_root
from companion.cli import study_policy
from companion.cli.main import main
from companion.config.switching_table import load_switching_table
from companion.errors import InputError
from companion.guidance.decision_process.approach_log import Action, Epoch, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.messages.docking import DockingMode, SwitchingSituation

MISSION = project_root() / "missions/papers/parikh_docking.yaml"


def situation(mode: DockingMode, range_: float) -> SwitchingSituation:
    return SwitchingSituation(
        mode=mode, range=range_, misalignment=0.01, mahalanobis=1.0, position_std=0.004, vision=False,
        reorient_range=0.7,
    )  # fmt: skip


def made_up(_mission: Path, _overrides: tuple[str, ...], seed: int) -> LoggedApproach:
    """A flight that aligns somewhere; nearer is sooner over, and the nearest alignment cheaper."""
    rng = np.random.default_rng(seed)
    last, near = float(rng.uniform(0.15, 0.5)), bool(rng.random() < 0.5)
    keep = [
        Epoch(situation=situation(DockingMode.REORIENT, r), action=Action.KEEP, elapsed=3.0, impulse=0.01)
        for r in np.arange(0.6, last, -0.05)
    ]
    end = Epoch(
        situation=situation(DockingMode.REORIENT, last),
        action=Action.SWITCH_NEAR if near else Action.SWITCH,
        elapsed=100.0 * last,
        impulse=0.1 if near else 0.2,
    )
    return LoggedApproach(seed=seed, epochs=(*keep, end), docked=True)


def docked(mission_path: Path, *, seed: int, overrides: tuple[str, ...], **_ignored) -> FlightResult:
    """A docking that was never flown; the time tells which policy was asked for."""
    names = [text.partition("=")[2] for text in overrides]
    time_s = 140.0 if "fixed" in names else 120.0 if "markov" in names else 100.0 + float(names[-1])
    figures = DockingFigures(
        policy=names[0], impulse_ns=0.003 * time_s, lateral_speed_mps=0.0, reorient_range_m=0.8, align_range_m=0.3,
        attempts=1, outliers=0, outliers_rejected=0, ranges=0, ranges_rejected=0,
    )  # fmt: skip
    return FlightResult(
        outcome=Outcome.DOCKED, success=seed != 13, reason="", position_error_m=0.002, angular_error_rad=0.003,
        station_keeping=None, duration_s=time_s, touchdown_speed_mps=0.01, mode_history=(), limits_violated=(),
        tracking_gap_s=None, wall_s=0.0, seed=seed, docking=figures,
    )  # fmt: skip


def test_seeds_to_learn_from_are_their_own_and_always_the_same() -> None:
    seeds = learning_seeds(500)
    assert len(set(seeds)) == 500
    assert min(seeds) >= MAX_SEED  # no --seeds, campaign or paper can name them
    assert learning_seeds(20) == seeds[:20]


def test_draws_fill_the_region_and_answer_by_themselves() -> None:
    rng, p = np.random.default_rng(1), ExplorationParameters()
    drawn = [drawn_switching(rng, p) for _ in range(300)]
    reorient, align = (np.array([getattr(d.distances, n) for d in drawn]) for n in ("reorient_range", "align_range"))
    assert p.reorient_nearest <= reorient.min() < p.reorient_nearest + 0.05
    assert p.reorient_farthest >= reorient.max() > p.reorient_farthest - 0.05
    assert np.all((align >= p.align_nearest) & (align <= np.minimum(reorient, p.align_farthest)))
    both = (True, False)
    assert {(d.ahead, d.near, d.direct) for d in drawn} == {(a, b, c) for a in both for b in both for c in both}
    near = next(d for d in drawn if d.near and d.direct)
    assert near.decide(situation(DockingMode.ALIGN, 0.2)).switch
    assert near.decide(situation(DockingMode.REORIENT, 0.05)).near
    assert not near.decide(situation(DockingMode.APPROACH, 0.05)).near
    far = situation(DockingMode.APPROACH, 1.6)
    ahead = next(d for d in drawn if d.ahead)
    assert ahead.decide(far).ahead  # once: from then on it does so
    assert not ahead.decide(replace(far, ahead=True)).ahead
    assert not next(d for d in drawn if not d.ahead).decide(far).ahead


def test_an_explored_docking_accounts_for_all_its_time_and_survives_its_file() -> None:
    seed = learning_seeds(1)[0]
    log = explore(MISSION, (), seed)
    assert log.docked
    assert log.seed == seed
    actions = [epoch.action for epoch in log.epochs]
    assert sum(action in (Action.SWITCH, Action.SWITCH_NEAR) for action in actions) in (1, 2, 3)
    aimed = [k for k, action in enumerate(actions) if action is Action.AHEAD]
    assert aimed in ([], [0])
    assert all(epoch.situation.ahead == bool(aimed) for epoch in log.epochs[1:])
    assert 80.0 < sum(epoch.elapsed for epoch in log.epochs) < 200.0
    assert 0.2 < sum(epoch.impulse for epoch in log.epochs) < 0.6
    assert all(DecisionGrid().cell(epoch.situation) is not None for epoch in log.epochs)
    assert 0.0 < log.inaccuracy < 0.5  # a tenth to two thirds of what counts as docked
    assert log_from_json(json.loads(json.dumps(log_as_json(log)))) == log


def test_what_was_explored_is_not_flown_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policy_study, "explore", made_up)
    options = Options(processes=1, store=tmp_path)
    first = explorations(MISSION, (), (5, 3, 8), options, lambda log: None)
    assert [log.seed for log in first] == [5, 3, 8]
    flown: list[int] = []
    monkeypatch.setattr(policy_study, "explore", lambda m, o, seed: flown.append(seed) or made_up(m, o, seed))
    again = explorations(MISSION, (), (5, 3, 8, 9), options, lambda log: None)
    assert flown == [9]
    assert again[:3] == first
    explorations(MISSION, ("simulation.world=docking_surveyed",), (5,), options, lambda log: None)
    assert flown == [9, 5]


def test_a_policy_is_chosen_by_overrides() -> None:
    task, *_ = policy_tasks(MISSION, ("a=1",), (4,), policy="optimal")
    assert task.overrides == ("a=1", "steps.0.dock.policy=optimal")
    assert task.seed == 4


def test_without_a_docking_there_is_no_scale() -> None:
    with pytest.raises(InputError, match="no flight by fixed distances has docked"):
        weights_of([], impulse_weight=1.0, inaccuracy_weight=3.0)


def test_the_command_writes_a_table_and_says_what_it_expects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(policy_study, "explore", made_up)
    monkeypatch.setattr(campaign_mission, "run_mission", docked)
    out = tmp_path / "new" / "table.yaml"
    words = ["study", "policy", "--runs", "60", "--jobs", "1", "--out", str(out), "--store", str(tmp_path), "--json"]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    table = load_switching_table(out)
    assert (said["approaches"], said["docked"]) == (60, 60) == (table.provenance.approaches, table.provenance.docked)
    assert table.provenance.world == "docking"
    assert table.provenance.seeds == learning_seeds(60 + study_policy.BASELINE)[study_policy.BASELINE :]
    weights = table.provenance.weights
    assert (weights.time_scale, weights.impulse_scale) == (140.0, 0.42)
    letters = "".join(row for policy in table.policies for row in policy.rows)
    assert letters.count("n") > letters.count("s")  # the dearer way to align is taken for want of the other only
    assert all(policy["residual"] <= 1e-9 for policy in said["policies"])


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        (["--runs", "0"], "not a number of flights"),
        (["--seeds", "1..5"], "seeds of their own"),
        (["--inaccuracy-weight", "nan"], "--inaccuracy-weight nan: not a weight"),
        (["--impulse-weight", "-1"], "--impulse-weight -1: not a weight"),
        (["--impulse-weight", "inf"], "not a weight; a finite number"),
        (["--out", "."], "this is a directory"),
        (["nowhere.yaml"], "nowhere.yaml: no such file"),
        ([str(study_policy.project_root() / "missions" / "land_static.yaml")], "no docking; give a mission whose step"),
    ],
)
def test_bad_input_is_told(words: list[str], wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "policy", *words]) == 2
    assert wrong in capsys.readouterr().err
