"""What a docking mission may hold: a spacecraft that finds its way by ranges and a camera, without an autopilot.

It is told from other missions by its step `dock`.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Gt, Interval, Len

from companion.documents import (
    Document,
    Example,
    in_order,
    json_schema,
    load_document,
    validate,
)
from companion.documents.nodes import MappingNode, ScalarNode, SequenceNode, node_at
from companion.errors import InputError, Problem
from companion.mission.load import named_world, resolved
from companion.mission.steps import open_steps

DOCK = "dock"


class PolicyName(Enum):
    """What decides when to turn towards the port, and when to move in front of it."""

    FIXED = "fixed"
    MARKOV = "markov"
    OPTIMAL = "optimal"


Range = Annotated[float, Interval(gt=0.0, le=10.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dock:
    """Fly to the port and dock."""

    # fixed: at set ranges; markov: by the estimator's confidence (Parikh et al.); optimal: by a solved decision table
    policy: PolicyName = PolicyName.OPTIMAL
    # with optimal: what a miss costs, in units of a whole docking; the table's nearest is taken
    careful: Annotated[float, Interval(gt=0.0, le=1000.0)] = 10.0
    reorient_range_m: Range = 0.8  # with fixed: turns to the port's attitude at this range
    align_range_m: Range = 0.3  # with fixed: moves in front of the port at this range
    max_attempts: Annotated[int, Interval(ge=1, le=20)] = 3  # runs at the port before the mission is given up
    timeout_s: Annotated[float, Interval(gt=0.0, le=3600.0)] = 300.0  # not docked by then: it retreats and holds


DOCKING_STEPS = {DOCK: Dock}
_STEP = ("steps", 0, DOCK)
_ONLY_WITH = {  # keys that one policy alone looks at
    "careful": PolicyName.OPTIMAL,
    "reorient_range_m": PolicyName.FIXED,
    "align_range_m": PolicyName.FIXED,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingStep:
    """The step of a docking mission."""

    dock: Dock  # fly to the port and dock


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingTarget:
    """What to dock with."""

    dock: Annotated[
        Path, Example("../config/docks/cubesat_port.yaml")
    ]  # file that describes the port: where it is, its markers; counts from the mission's folder


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingSimulation:
    """Only for `companion sim`."""

    world: Annotated[str, Len(1)] = "docking_surveyed"  # name of a docking world, or the path of a world file
    start_m: tuple[float, float, float] | None = (
        None  # where the chaser starts, in the frame of the anchors; not given: the world's
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingLimits:
    """Tighter limits of this mission. What is left out is as configured."""

    speed_mps: Annotated[float, Gt(0.0)] | None = None  # of the approach
    closing_speed_mps: Annotated[float, Gt(0.0)] | None = None  # of the last part, straight into the port


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingDocument:
    """A docking mission's file, as written."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80), Example("dock at the port")]  # for people: shown in the results
    config: Annotated[
        Path, Example("../config/cubesat_sim.yaml")
    ]  # the spacecraft's configuration; counts from the mission's folder
    target: DockingTarget  # what to dock with
    steps: Annotated[tuple[DockingStep, ...], Len(1, 1), Example("[dock]")]  # what to do: dock
    simulation: DockingSimulation = field(default_factory=DockingSimulation)  # only for `companion sim`
    limits: DockingLimits = field(default_factory=DockingLimits)  # tighter limits for this mission


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingMission:
    """A checked docking mission, paths resolved."""

    source: str  # the file, as the user named it
    name: str
    config: Path
    port: Path
    world: str  # of the simulation: a built-in name, or a path
    start_m: tuple[float, float, float] | None  # [m] of the simulation: of the chaser's centre, in c; None: the world's
    step: Dock
    limits: DockingLimits


def is_docking(document: Document) -> bool:
    """Say whether an opened file is a docking mission: one of its steps is `dock`."""
    steps = node_at(document.root, ("steps",))
    if not isinstance(steps, SequenceNode):
        return False
    return any(
        (isinstance(item, MappingNode) and DOCK in item.entries)
        or (isinstance(item, ScalarNode) and item.value == DOCK)
        for item in steps.items
    )


def names_docking(path: str | os.PathLike[str]) -> bool:
    """Say whether a file is a docking mission; a file that cannot be read is none: others say what is wrong with it."""
    try:
        return is_docking(load_document(path))
    except InputError:
        return False


def open_docking(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Document:
    """Read a docking mission's file without checking its values.

    Raises:
        InputError: it cannot be read or is not YAML.
    """
    return open_steps(path, overrides, DOCKING_STEPS)


def docking_from(document: Document) -> DockingMission:
    """Check an opened docking mission.

    Raises:
        InputError: with every problem of the file.
    """
    written = validate(document, DockingDocument)
    step = written.steps[0].dock
    problems = list(_without_effect(document, step))
    if step.align_range_m >= step.reorient_range_m:
        problems.append(
            document.problem(
                ("steps", 0, "dock", "align_range_m"),
                wrong=f"{step.align_range_m:g} m is not below reorient_range_m ({step.reorient_range_m:g} m)",
                right="it turns first and moves in front of the port later: align_range_m < reorient_range_m",
            )
        )
    if problems:
        raise InputError(in_order(problems))
    return DockingMission(
        source=document.source,
        name=written.name,
        config=resolved(document, ("config",), written.config),
        port=resolved(document, ("target", "dock"), written.target.dock),
        world=named_world(document) or written.simulation.world,
        start_m=written.simulation.start_m,
        step=step,
        limits=written.limits,
    )


def _without_effect(document: Document, step: Dock) -> Iterator[Problem]:
    """Find values that the policy does not look at.

    A policy that `--set` puts in the place of the file's is a comparison: what the file says for its own policy stays.
    """
    compared = document.position((*_STEP, "policy")).source != document.source
    for key, policy in _ONLY_WITH.items():
        path = (*_STEP, key)
        written_here = document.position(path).source == document.source
        if step.policy is policy or getattr(step, key) == getattr(Dock(), key) or (compared and written_here):
            continue
        yield document.problem(
            path,
            wrong=f"{key} has an effect only with policy: {policy.value}, and the policy is {step.policy.value}",
            right=f"leave it out, or write policy: {policy.value}",
        )


def docking_schema() -> dict[str, Any]:
    """Build the JSON Schema of docking missions."""
    return json_schema(DockingDocument, title="Docking mission")
