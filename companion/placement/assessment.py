"""What a place offers a chaser that stands there: how well it is known, and what Algorithm 1 would make of it.

Parikh et al., section V-D: the steady-state covariance at a place goes into the probabilities of Algorithm 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.guidance.docking.turn import misalignment
from companion.guidance.switching_chain import approach_kept, reorient_again, reorient_kept, steady_state_align
from companion.perception.docking_port import DockingPort
from companion.placement.geometry import mirror_distance, position_dilution
from companion.placement.scene import Scene, worst_std

CONSISTENT = 1.0
"""Mahalanobis distance d per degree of freedom of a filter that knows how wrong it is."""
_RANGE_STEP = 0.01  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """Algorithm 1 at a place with d = 1; nan where the algorithm does not ask for a number there."""

    a11: float  # below r_t: stay on the approach
    a22: float  # below r2: go on in "reorient"
    a32: float  # below r2: go back from "align" to "reorient"
    steady_align: float  # below r2: steady-state probability of "align"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Place:
    """What a place offers."""

    position: Array  # (3,) [m] of the chaser's centre of mass, in c
    axis_std: Array  # (3,) [m] by ranges alone, in the start's attitude; inf: undetermined
    worst_std: float  # [m] the same in the worst direction
    dilution: float  # GDOP of the position: factor from a range's error to the position's, one range from each anchor
    mirror: float  # [m] to the mirror image with the same ranges; inf: there is none
    range: float  # [m] to the docked position; nan without a port
    seen_at_start: bool  # the camera sees the port from here in the start's attitude
    seen_docking: bool  # and in the docking attitude
    known_std: float  # [m] largest axis in the attitude flown here, with pictures where the port is seen
    chain: Chain

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (3,)))
        object.__setattr__(self, "axis_std", frozen(self.axis_std, (3,)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corridor:
    """The line of sight from a start to the docked position."""

    places: tuple[Place, ...]  # from the start on
    worst: Place  # where the chaser knows least of its position
    reorient_range: float  # [m] r2 that Algorithm 1 chooses with d = 1
    align_range: float  # [m] r1 likewise, with the steady state at each place


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen:
    """Algorithm 1 on a way on which the position is known equally well everywhere (section V-D)."""

    position_std: float  # [m] largest axis
    least_steady_align: float  # least steady-state probability of "align" between r2 and the first r1
    align_range: float  # [m] r1: where it falls to its threshold, the first r1 at least


def reorient_range(scene: Scene, port: DockingPort) -> float:
    """Give r2 [m]: the range at which A11 falls to its threshold with d = 1 (Algorithm 1), its first value at least."""
    p = scene.switching
    turn = misalignment(scene.start_quaternion, port.quaternion)
    chosen = p.keep_approach_threshold * p.activation_range * (1.0 + CONSISTENT) * turn
    return min(p.activation_range, max(p.reorient_floor, chosen))


def assess(scene: Scene, position: Array) -> Place:
    """Say what a place offers.

    Args:
        scene: anchors, port and chaser.
        position: (3,) [m] of the chaser's centre of mass, in c.
    """
    ranges = scene.covariance(position, scene.start_quaternion, with_vision=False)
    port, radio = scene.port, scene.radio(position)
    seen_docking = port is not None and scene.sees(position, port.quaternion)
    seen_at_start = scene.sees(position, scene.start_quaternion)
    distance, known, chain = (
        math.nan,
        _largest_axis(ranges),
        Chain(a11=math.nan, a22=math.nan, a32=math.nan, steady_align=math.nan),
    )
    if port is not None:
        distance = float(np.linalg.norm(position - port.docked_position))
        near = distance <= reorient_range(scene, port)
        attitude, seen = (port.quaternion, seen_docking) if near else (scene.start_quaternion, seen_at_start)
        if near or seen:
            known = _largest_axis(scene.covariance(position, attitude, with_vision=seen))
        chain = _chain(scene, port, distance, known)
    return Place(
        position=position,
        axis_std=np.full(3, math.inf) if ranges is None else np.sqrt(np.diag(ranges)),
        worst_std=worst_std(ranges),
        dilution=position_dilution(scene.setup.anchors, radio),
        mirror=mirror_distance(scene.setup.anchors, radio),
        range=distance,
        seen_at_start=seen_at_start,
        seen_docking=seen_docking,
        known_std=known,
        chain=chain,
    )


def corridor(scene: Scene, port: DockingPort, start: Array, *, places: int = 25) -> Corridor:
    """Assess the straight way from a start to the docked position, both included.

    Args:
        scene: anchors, port and chaser.
        port: the scene's.
        start: (3,) [m] of the chaser's centre of mass, in c.
        places: number of places on the way.
    """
    line = np.linspace(start, port.docked_position, places)
    assessed = tuple(assess(scene, position) for position in line)
    return Corridor(
        places=assessed,
        worst=max(assessed, key=lambda place: place.known_std),
        reorient_range=reorient_range(scene, port),
        align_range=_align_range(scene, assessed),
    )


def foresee(scene: Scene, port: DockingPort, position_std: float) -> Foreseen:
    """Say what Algorithm 1 makes of a standard deviation, such as that of the best or the worst place, with d = 1.

    Args:
        scene: anchors, port and chaser.
        port: the scene's.
        position_std: [m] largest axis.
    """
    p = scene.switching
    ranges = np.arange(reorient_range(scene, port), p.align_floor, -_RANGE_STEP).tolist()
    steady = [_chain(scene, port, distance, position_std).steady_align for distance in ranges]
    below = (distance for distance, value in zip(ranges, steady, strict=True) if value <= p.align_threshold)
    return Foreseen(
        position_std=position_std,
        least_steady_align=min(steady, default=math.nan),
        align_range=next(below, p.align_floor),
    )


def _chain(scene: Scene, port: DockingPort, distance: float, known: float) -> Chain:
    p = scene.switching
    turn_at = reorient_range(scene, port)
    a11 = a22 = a32 = align = math.nan
    if distance <= p.activation_range:
        a11 = approach_kept(
            distance=distance,
            activation_range=p.activation_range,
            inconsistency=CONSISTENT,
            misalignment=misalignment(scene.start_quaternion, port.quaternion),
        )
    if distance <= turn_at:
        a22 = reorient_kept(distance=distance, reorient_range=turn_at, inconsistency=CONSISTENT)
        a32 = reorient_again(
            distance=distance,
            reorient_range=turn_at,
            docked_range=p.docked_range,
            position_std=min(known, 1.0),  # undetermined is as good as any number that A32 clamps
            coarse_std=p.coarse_std,
        )
        align = steady_state_align(a22, a32)
    return Chain(a11=a11, a22=a22, a32=a32, steady_align=align)


def _align_range(scene: Scene, places: Sequence[Place]) -> float:
    """Give r1 [m]: where the steady state falls to its threshold on the way, the algorithm's first value at least."""
    p = scene.switching
    for place in places:
        if place.range > p.align_floor and place.chain.steady_align <= p.align_threshold:
            return place.range
    return p.align_floor


def _largest_axis(covariance: Array | None) -> float:
    return math.inf if covariance is None else math.sqrt(float(np.diag(covariance).max()))
