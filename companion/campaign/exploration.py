"""Dockings from which the switching policy is learned: their switching is drawn anew for each flight."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Interval

from companion.campaign.docking import SimulatedDocking
from companion.campaign.seeds import MAX_SEED, drawn_seeds
from companion.config.docking import load_docking
from companion.guidance.decision_process.approach_log import Action, ApproachRecorder, Epoch, LoggedApproach
from companion.guidance.docking.policies import FixedDistances
from companion.messages.docking import DockingMode, SwitchingSituation, SwitchingVerdict
from companion.runtime.docking.pipeline import DockingStep
from sitl_stub.cubesat.simulation import CubesatTruth

_LEARNING = "flights to learn the switching policy from"  # in place of a commit's hash
_FIXED = "steps.0.dock.policy=fixed"  # no table is needed; the policy is drawn instead

_TURNED = 0.05  # norm of the error quaternion's vector part: the guidance's own limit

Fraction = Annotated[float, Interval(ge=0.0, le=1.0)]
Positive = Annotated[float, Gt(0.0)]


def learning_seeds(count: int) -> tuple[int, ...]:
    """Give the first seeds to learn from: always the same ones, and none by which anything can be judged.

    Campaigns, papers and `--seeds` know seeds below 2^31 only; these are from 2^31 on.
    """
    return tuple(MAX_SEED + seed for seed in drawn_seeds(_LEARNING, "exploration", count))


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationParameters:
    """What is drawn for a flight: uniformly between the ends, wide enough that the best lies inside."""

    reorient_nearest: Positive = 0.40  # [m] the turn takes 0.36 m; the guidance begins it at 0.3 m anyway
    reorient_farthest: Positive = 0.95  # [m] earlier than fixed distances and Algorithm 1 turn
    align_nearest: Positive = 0.10  # [m] the guidance's least
    align_farthest: Positive = 0.55  # [m] or where the turn begins, if that is nearer
    ahead_share: Fraction = 0.75  # of the flights that aim ahead, from the first decision on: a bend later costs more
    near_share: Fraction = 0.75  # of the flights that align near
    direct_share: Fraction = 0.8  # of the flights that go in without coming to rest, where they may


@dataclass(frozen=True, slots=True, kw_only=True)
class ExploringSwitching:
    """One draw: distances, where to aim, where to align, and whether to come to rest there.

    It begins to align only once it has turned. What an alignment during the turn comes to depends on how far the turn
    has come to within a few degrees; cells of the grid cannot tell, and would mix good flights with bad ones.
    """

    distances: FixedDistances
    ahead: bool
    near: bool
    direct: bool

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        """Answer as drawn."""
        if situation.mode is DockingMode.ALIGN:
            return SwitchingVerdict(switch=self.direct, reason="as drawn for this flight")
        verdict = self.distances.decide(situation)
        reorienting = situation.mode is DockingMode.REORIENT
        if reorienting and situation.misalignment >= _TURNED:
            return SwitchingVerdict(switch=False, reason="the turn is not complete")
        near = verdict.switch and self.near and reorienting
        ahead = self.ahead and not (verdict.switch or reorienting or situation.ahead)
        return SwitchingVerdict(switch=verdict.switch, ahead=ahead, near=near, reason=verdict.reason)


def drawn_switching(rng: np.random.Generator, parameters: ExplorationParameters) -> ExploringSwitching:
    """Draw a flight's switching."""
    p = parameters
    reorient = float(rng.uniform(p.reorient_nearest, p.reorient_farthest))
    align = float(rng.uniform(p.align_nearest, min(p.align_farthest, reorient)))
    return ExploringSwitching(
        distances=FixedDistances(reorient_range=reorient, align_range=align),
        ahead=bool(rng.random() < p.ahead_share),
        near=bool(rng.random() < p.near_share),
        direct=bool(rng.random() < p.direct_share),
    )


def explore(mission: Path, overrides: tuple[str, ...], seed: int) -> LoggedApproach:
    """Fly one docking with a switching drawn from the seed, and log it.

    Raises:
        InputError: with every problem of every file.
        ValueError: the flight ended before anything was to be decided.
    """
    docking = load_docking(mission, overrides=(*overrides, _FIXED))
    dice = np.random.default_rng(int.from_bytes(hashlib.sha256(f"{_LEARNING}\n{seed}".encode()).digest()[:8], "big"))
    policy = drawn_switching(dice, ExplorationParameters())
    recorder = ApproachRecorder()

    def on_step(step: DockingStep, truth: CubesatTruth) -> None:
        decision = step.decision
        if decision.situation is not None and decision.verdict is not None:
            action = Action.of(decision.verdict)
            recorder.observe(decision.t, decision.situation, action=action, impulse=truth.impulse_ns)

    simulated = SimulatedDocking(docking, seed=seed, policy=policy)
    result = simulated.run(on_step)
    impulse = simulated.simulation.truth.impulse_ns
    return recorder.finish(
        result.duration_s,
        seed=seed,
        docked=result.success,
        impulse=impulse,
        inaccuracy=simulated.inaccuracy(result) if result.success else 0.0,
    )


def log_as_json(log: LoggedApproach) -> dict[str, Any]:
    """Give plain values, an epoch a list."""
    rows = []
    for epoch in log.epochs:
        s = epoch.situation
        seen = [
            s.mode.value,
            s.range,
            s.misalignment,
            s.mahalanobis,
            s.position_std,
            s.vision,
            s.reorient_range,
            s.ahead,
        ]
        rows.append([*seen, int(epoch.action), epoch.elapsed, epoch.impulse])
    return {"seed": log.seed, "docked": log.docked, "inaccuracy": log.inaccuracy, "epochs": rows}


def log_from_json(data: Mapping[str, Any]) -> LoggedApproach:
    """Read what `log_as_json` gave.

    Raises:
        KeyError, TypeError, ValueError: it is something else.
    """
    return LoggedApproach(
        seed=data["seed"],
        docked=data["docked"],
        inaccuracy=data["inaccuracy"],
        epochs=tuple(_epoch(*row) for row in data["epochs"]),
    )


def _epoch(
    mode: str,
    range_: float,
    misalignment: float,
    mahalanobis: float,
    position_std: float,
    vision: bool,
    reorient_range: float | None,
    ahead: bool,
    action: int,
    elapsed: float,
    impulse: float,
) -> Epoch:
    situation = SwitchingSituation(
        mode=DockingMode(mode),
        range=range_,
        misalignment=misalignment,
        mahalanobis=mahalanobis,
        position_std=position_std,
        vision=vision,
        reorient_range=reorient_range,
        ahead=ahead,
    )
    return Epoch(situation=situation, action=Action(action), elapsed=elapsed, impulse=impulse)
