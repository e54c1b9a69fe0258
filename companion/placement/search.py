"""Better places for anchors: exchange of one anchor at a time over mounting places, then a local polish.

By ranges alone the covariance of a standing chaser's place has the principal axes of the information of the ranges, and
along each the variance falls with the eigenvalue there: variance ~ eigenvalue^(-3/4) for a filter whose acceleration
is white noise (the steady state of two integrators has p = sqrt(2) q^(1/4) r^(3/4)). So the search compares
eigenvalues, a thousand times faster than Riccati equations, which then give the figures of what it found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.placement.geometry import eigenvalues, information
from companion.placement.mounting import Mounting
from companion.placement.scene import Scene, whole_std, worst_std

RESTARTS = 8  # from random places, besides the given ones
_POLISHED = 3  # of the results of all starts
_STEP, _LAST_STEP = 0.125, 0.001  # [m] of the polish
_TRIES = 500  # of drawing places that keep spacing and leave a plane
_WORTH_MOVING = 1e-3  # of the error: for less nobody moves an anchor
_GAIN = 1e-9  # of the cost that counts as better
_LEAST = 1e-9  # eigenvalue: what is undetermined counts as much worse than anything else

Report = Callable[[int, int], None]


class Objective(Enum):
    """Which error by ranges alone is to be small."""

    RMS = "rms"  # root mean square of the error's length over all places: it spares the bad ones, and costs few others
    WORST = "worst"  # standard deviation in the worst direction at the worst place, whatever that costs elsewhere
    MEAN = "mean"  # standard deviation in the worst direction, mean over all places


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """Steady-state errors by ranges alone over places [m], as in `Objective`; inf: somewhere undetermined."""

    rms: float
    worst: float
    mean: float

    def of(self, objective: Objective) -> float:
        """Give the one that is to be small."""
        return {Objective.RMS: self.rms, Objective.WORST: self.worst, Objective.MEAN: self.mean}[objective]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """Where anchors should stand."""

    anchors: Array  # (N, 3) [m]; the given ones where nothing better was found
    given: Quality
    proposed: Quality
    kept: bool  # nothing better was found

    def __post_init__(self) -> None:
        object.__setattr__(self, "anchors", frozen(self.anchors))

    def improvement(self, objective: Objective) -> float:
        """Say by which share the standard deviation is smaller; 1 where the given anchors leave it undetermined."""
        before, after = self.given.of(objective), self.proposed.of(objective)
        return 1.0 - after / before if np.isfinite(before) else float(np.isfinite(after))


def quality(scene: Scene, places: Array) -> Quality:
    """Give the steady-state errors over places (P, 3) [m] of the centre of mass."""
    covariances = [scene.by_ranges(place) for place in places]
    stds = np.array([worst_std(covariance) for covariance in covariances])
    lengths = np.array([whole_std(covariance) for covariance in covariances])
    return Quality(rms=float(np.sqrt(np.mean(lengths**2))), worst=float(stds.max()), mean=float(stds.mean()))


def propose(
    scene: Scene,
    mounting: Mounting,
    places: Array,
    dice: np.random.Generator,
    *,
    objective: Objective = Objective.RMS,
    report: Report | None = None,
) -> Proposal:
    """Search for better places of the anchors; never worse than the given ones.

    Args:
        scene: with the given anchors.
        mounting: how many may stand where.
        places: (P, 3) [m] of the centre of mass at which the position should be known well.
        dice: draws the starts of the search.
        objective: what is to be small.
        report: is told after each part how many of how many are done.

    Raises:
        ValueError: so many anchors do not fit with that spacing.
    """
    search = _Search(mounting, scene.radio(places), objective)
    starts = [_drawn(mounting, dice) for _ in range(RESTARTS)]
    if len(scene.setup.anchors) == mounting.count:
        starts.append(mounting.nearest(scene.setup.anchors))
    parts = len(starts) + _POLISHED
    found: list[tuple[float, Array]] = []
    for number, start in enumerate(starts, 1):
        found.append(search.exchanged(start))
        if report is not None:
            report(number, parts)
    found.sort(key=lambda item: item[0])
    given = quality(scene, places)
    reached: list[tuple[Quality, Array]] = []
    for number, (_, anchors) in enumerate(found[:_POLISHED], len(starts) + 1):
        polished = search.polished(anchors)
        reached.append((quality(scene.with_anchors(polished), places), polished))
        if report is not None:
            report(number, parts)
    best, anchors = min(reached, key=lambda item: item[0].of(objective))
    if best.of(objective) < (1.0 - _WORTH_MOVING) * given.of(objective):
        return Proposal(anchors=anchors, given=given, proposed=best, kept=False)
    return Proposal(anchors=scene.setup.anchors, given=given, proposed=given, kept=True)


class _Search:
    """Costs of sets of anchors over fixed places, and moves that lower them."""

    def __init__(self, mounting: Mounting, radios: Array, objective: Objective) -> None:
        self._mounting = mounting
        self._radios = radios  # (P, 3) [m]
        self._objective = objective
        self._candidates = mounting.candidates()
        self._told = information(self._candidates, radios)

    def exchanged(self, anchors: Array) -> tuple[float, Array]:
        """Put one anchor after the other where it does most good, until none of them has a better place."""
        anchors, cost, better = anchors.copy(), self._cost_of(anchors), True
        while better:
            better = False
            for slot in range(len(anchors)):
                costs = self._costs(anchors, slot, self._candidates, self._told)
                place = int(np.argmin(costs))
                if costs[place] < cost * (1.0 - _GAIN):
                    anchors[slot], cost, better = self._candidates[place], float(costs[place]), True
        return cost, anchors

    def polished(self, anchors: Array) -> Array:
        """Slide the anchors along their faces by shorter and shorter steps."""
        anchors, cost, step = anchors.copy(), self._cost_of(anchors), _STEP
        box = self._mounting.box
        moves = np.vstack([np.eye(3), -np.eye(3)])
        while step >= _LAST_STEP:
            better = False
            for slot in range(len(anchors)):
                options = np.clip(anchors[slot] + step * moves, box.low, box.high)
                options = options[self._mounting.on_face(options)]
                costs = self._costs(anchors, slot, options, information(options, self._radios))
                place = int(np.argmin(costs))
                if costs[place] < cost * (1.0 - _GAIN):
                    anchors[slot], cost, better = options[place], float(costs[place]), True
            step = step if better else 0.5 * step
        return anchors

    def _cost_of(self, anchors: Array) -> float:
        return float(self._costs(anchors, 0, anchors[:1], information(anchors[:1], self._radios))[0])

    def _costs(self, anchors: Array, slot: int, options: Array, told: Array) -> Array:
        """Give the cost (K,) with one anchor at each option (K, 3), which tells `told` (K, 6, P); inf: refused."""
        others = np.delete(anchors, slot, axis=0)
        entries = (told + information(others, self._radios).sum(axis=0)) / len(anchors)
        variances = np.maximum(eigenvalues(entries), _LEAST) ** -0.75
        if self._objective is Objective.RMS:
            costs: Array = np.sqrt(variances.sum(axis=1).mean(axis=1))
        elif self._objective is Objective.WORST:
            costs = np.sqrt(variances[:, 0].max(axis=1))
        else:
            costs = np.sqrt(variances[:, 0]).mean(axis=1)
        sets = np.repeat(anchors[None], len(options), axis=0)
        sets[:, slot] = options
        costs[np.logical_not(self._mounting.admits(sets))] = np.inf
        return costs


def _drawn(mounting: Mounting, dice: np.random.Generator) -> Array:
    """Draw mounting places that keep the spacing and leave a plane."""
    candidates = mounting.candidates()
    if len(candidates) >= mounting.count:
        for _ in range(_TRIES):
            anchors = candidates[dice.choice(len(candidates), mounting.count, replace=False)]
            if mounting.admits(anchors[None])[0]:
                return anchors
    raise ValueError(
        f"{mounting.count} anchors {mounting.spacing:g} m apart do not fit on these faces, not all in one plane; "
        "use fewer anchors, a smaller spacing, more faces or a larger box"
    )
