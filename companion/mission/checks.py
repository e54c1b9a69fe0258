"""What a mission must satisfy beyond the types of its values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

from companion.documents.nodes import Document, node_at, plain
from companion.errors import Problem
from companion.mission.schema import (
    Follow,
    FollowUntil,
    Land,
    Mission,
    Output,
    Policy,
    Search,
    Step,
    Surveyed,
    Takeoff,
    Transit,
    is_ground_mission,
)

_ORDER = ("takeoff", "transit", "search", "intercept", "follow", "land", "hold")
_IN_THE_AIR = ("takeoff", "transit", "land")
_SLOWEST_ROVER = 0.05  # [m/s] friction holds what is told to drive slower


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """What the configuration allows; None where it sets no bound."""

    speed_mps: float | None = None
    speed_up_mps: float | None = None
    speed_down_mps: float | None = None
    acceleration_mps2: float | None = None
    closing_speed_mps: float | None = None
    height_m: float | None = None  # above the take-off point
    radius_m: float | None = None  # horizontal distance from the take-off point


def kind_of(step: Step) -> str:
    """Give the key under which a step stands in the file."""
    return type(step).__name__.lower()


def check_steps(document: Document, steps: tuple[Step, ...]) -> Iterator[Problem]:
    """Yield what is wrong with the order and the content of the steps."""
    kinds = [kind_of(step) for step in steps]
    if is_ground_mission(steps):
        yield from _check_ground(document, kinds, steps)
    elif kinds[0] != "takeoff":
        right = "begin with `- takeoff: {height_m: 4.0}`; on the ground: intercept, or follow with standoff_m"
        yield document.problem(("steps", 0), wrong=f"the first step is {kinds[0]}", right=right)
    for index, kind in enumerate(kinds):
        yield from _check_place(document, kinds, index)
        if kind == "follow":
            step = steps[index]
            if isinstance(step, Follow):
                yield from _check_follow(document, index, step)
    last = len(kinds) - 1
    if kinds[last] in ("takeoff", "transit", "search"):
        yield document.problem(
            ("steps", last), wrong=f"the mission ends with {kinds[last]}", right="add `- land`, `- follow` or `- hold`"
        )


def _check_ground(document: Document, kinds: list[str], steps: tuple[Step, ...]) -> Iterator[Problem]:
    """Yield what a vehicle that stays on the ground cannot do."""
    for index, (kind, step) in enumerate(zip(kinds, steps, strict=True)):
        if kind in _IN_THE_AIR:
            yield document.problem(
                ("steps", index),
                wrong=f"{kind} in a mission on the ground",
                right="drop it: the vehicle stays on the ground",
            )
        if isinstance(step, Follow) and step.height_m is not None:
            yield document.problem(
                ("steps", index, "follow", "height_m"), wrong="a height on the ground", right="give standoff_m alone"
            )
        if isinstance(step, Follow) and not step.match_heading:
            yield document.problem(
                ("steps", index, "follow", "match_heading"),
                wrong="a place behind the target is at its heading",
                right="drop it: on the ground the vehicle always turns with the target",
            )
        if isinstance(step, Follow) and step.standoff_m is None:
            yield document.problem(
                ("steps", index, "follow"), wrong="follow without a standoff", right="add `standoff_m: 1.25`"
            )
    searches = [("steps", index, "search") for index, kind in enumerate(kinds) if kind == "search"]
    for path in (
        *((*search, key) for search in searches for key in ("height_m", "radius_m")),
        *(("limits", key) for key in ("speed_up_mps", "speed_down_mps", "height_m")),
    ):
        node = node_at(document.root, path)
        if node is not None and plain(node) is not None:
            yield document.problem(path, wrong="has no effect on the ground", right="drop it")
    if "intercept" in kinds and "follow" in kinds:
        yield document.problem(
            ("steps", kinds.index("follow")), wrong="intercept and follow", right="follow drives there too: keep one"
        )


def check_transit(document: Document, surveyed: Surveyed | None, steps: tuple[Step, ...]) -> Iterator[Problem]:
    """Yield what does not fit to a pad that cannot be seen from the start, and to the policy that goes there."""
    way = next((index for index, step in enumerate(steps) if isinstance(step, Transit)), None)
    if way is not None and surveyed is None:
        right = "add it to target, for example `surveyed: {north_m: 18.0, east_m: -5.0, heading_deg: 40.0}`"
        yield document.problem(("steps", way), wrong="transit without target.surveyed", right=right)
    if way is None and surveyed is not None:
        right = "add `- transit: {by: ranges}` (or `by: odometry`) after the take-off, or drop it"
        yield document.problem(("target", "surveyed"), wrong="has no effect without the step transit", right=right)
    for index, step in enumerate(steps):
        if isinstance(step, Land) and step.policy is Policy.OPTIMAL:
            wrong = "optimal: no table of switching has been learned for landings, only for dockings"
            yield document.problem(("steps", index, "land", "policy"), wrong=wrong, right="write fixed or markov")
        if isinstance(step, Land) and step.deviate_at_m is not None and step.policy is not Policy.FIXED:
            right = "write `policy: fixed`, or drop it: the Markov policy decides by its probabilities"
            yield document.problem(("steps", index, "land", "deviate_at_m"), wrong="has no effect here", right=right)


def check_vehicle(document: Document, mission: Mission, vehicle: str) -> Iterator[Problem]:
    """Yield what speaks against this mission with this type of vehicle, given in words."""
    speed = mission.limits.speed_mps
    if vehicle == "rover" and speed is not None and speed < _SLOWEST_ROVER:
        yield document.problem(
            ("limits", "speed_mps"), wrong=f"a rover stands at {speed:g} m/s", right=f"at least {_SLOWEST_ROVER:g} m/s"
        )
    if mission.on_ground == (vehicle != "multicopter"):
        return
    wrong, right = (
        f"a {vehicle} cannot leave the ground",
        "name a multicopter's configuration, or use intercept or follow: {standoff_m: …}",
    )
    if mission.on_ground:
        wrong, right = (
            "a multicopter does not keep a standoff on the ground",
            "name a rover's or free-flyer's configuration",
        )
    yield document.problem(("config",), wrong=f"this mission does not fit to the vehicle: {wrong}", right=right)


def check_output(document: Document, output: Output, steps: tuple[Step, ...]) -> Iterator[Problem]:
    """Yield what does not fit to a landing by the autopilot."""
    if output is not Output.LANDING_TARGET:
        return
    if not any(isinstance(step, Land) for step in steps):
        yield document.problem(
            ("output",), wrong="landing_target without a landing", right="add `- land` as the last step, or drop output"
        )
    for index, step in enumerate(steps):
        if not isinstance(step, Land):
            continue
        for key in ("descent_mps", "cone_half_angle_deg"):
            if getattr(step, key) is not None:
                yield document.problem(
                    ("steps", index, "land", key),
                    wrong="has no effect with output: landing_target, where the autopilot flies the descent",
                    right="drop it; the autopilot's parameters MPC_LAND_SPEED and PLD_HACC_RAD stand for it",
                )


def _check_place(document: Document, kinds: list[str], index: int) -> Iterator[Problem]:
    kind = kinds[index]
    if kind in kinds[:index]:
        yield document.problem(
            ("steps", index), wrong=f"a second {kind}", right=f"keep one {kind}; steps are not repeated"
        )
    elif kind in ("land", "hold") and index != len(kinds) - 1:
        yield document.problem(
            ("steps", index, kind),
            wrong=f"{kind} is followed by {kinds[index + 1]}",
            right=f"{kind} must be the last step",
        )
    else:
        later = [k for k in kinds[:index] if k not in ("land", "hold") and _ORDER.index(k) > _ORDER.index(kind)]
        if later:
            yield document.problem(
                ("steps", index, kind), wrong=f"{kind} after {later[0]}", right=f"put {kind} before {later[0]}"
            )


def _check_follow(document: Document, index: int, step: Follow) -> Iterator[Problem]:
    path = ("steps", index, "follow")
    if step.ends is FollowUntil.TIME and step.for_s <= 0.0:
        yield document.problem(
            (*path, "until"), wrong="until: time without a time", right="add, for example, `for_s: 60`"
        )
    if step.for_s > step.at_most_s:
        yield document.problem(
            (*path, "for_s"),
            wrong=f"for_s ({step.for_s:g} s) is longer than at_most_s ({step.at_most_s:g} s)",
            right="raise at_most_s or lower for_s",
        )


def check_limit(document: Document, key: str, wanted: float | None, allowed: float | None) -> Iterator[Problem]:
    """Yield that a mission's limit is above the configuration's; None: there is none."""
    if wanted is not None and allowed is not None and wanted > allowed:
        yield document.problem(
            ("limits", key),
            wrong=f"{wanted:g} is more than the configuration allows, which is {allowed:g}",
            right=f"at most {allowed:g}; a mission can only tighten limits",
        )


def check_envelope(document: Document, mission: Mission, envelope: Envelope) -> Iterator[Problem]:
    """Yield where the mission asks for more than the configuration, or its own limits, allow."""
    for item in fields(mission.limits):
        yield from check_limit(document, item.name, getattr(mission.limits, item.name), getattr(envelope, item.name))
    ceiling = _tightest(mission.limits.height_m, envelope.height_m)
    radius = _tightest(mission.limits.radius_m, envelope.radius_m)
    away = 0.0 if mission.surveyed is None else math.hypot(mission.surveyed.north_m, mission.surveyed.east_m)
    if radius is not None and away > radius:
        yield document.problem(
            ("target", "surveyed"),
            wrong=f"the pad is {away:.1f} m away, outside the fence, whose radius is {radius:g} m",
            right=f"at most {radius:g} m (limits.radius_m, or the fence of the configuration)",
        )
    for index, step in enumerate(mission.steps):
        height = step.height_m if isinstance(step, Takeoff | Transit | Search | Follow) else None
        if not mission.on_ground and height is not None and ceiling is not None and height > ceiling:
            yield document.problem(
                ("steps", index, kind_of(step), "height_m"),
                wrong=f"{height:g} m is above the ceiling of {ceiling:g} m",
                right=f"at most {ceiling:g} m (limits.height_m, or the fence of the configuration)",
            )
        if not mission.on_ground and isinstance(step, Search) and radius is not None and step.radius_m > radius:
            yield document.problem(
                ("steps", index, "search", "radius_m"),
                wrong=f"{step.radius_m:g} m leaves the fence, whose radius is {radius:g} m",
                right=f"at most {radius:g} m (limits.radius_m, or the fence of the configuration)",
            )


def _tightest(*bounds: float | None) -> float | None:
    given = [bound for bound in bounds if bound is not None]
    return min(given) if given else None
