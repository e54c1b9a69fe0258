"""Whether a mission's target fits to what is done with it."""

from __future__ import annotations

from collections.abc import Iterator

from companion.config.tree import Config
from companion.config.vehicle import floats
from companion.documents import Document
from companion.errors import Problem
from companion.mission import Follow, Intercept, Mission
from companion.mission.checks import kind_of
from companion.perception.pad import Pad


def check_target(document: Document, mission: Mission, pad: Pad, config: Config) -> Iterator[Problem]:
    """Yield what speaks against this target: a pad is landed on, a body with upright boards is met beside it."""
    if mission.on_ground == pad.upright:
        yield from _check_standoff(document, mission, pad, config)
        return
    wrong, right = "a pad that lies flat, for a vehicle that looks ahead", "name a file with faces: rover_target.yaml"
    if pad.upright:
        wrong, right = "a body with upright boards, for a vehicle that looks down", "name a pad: landing_pad_0p8.yaml"
    yield document.problem(("target", "pad"), wrong=wrong, right=right)


def _check_standoff(document: Document, mission: Mission, pad: Pad, config: Config) -> Iterator[Problem]:
    """Yield what speaks against the place behind this target: there the vehicle must be clear of its boards."""
    vehicle = config.vehicle
    body = vehicle.free_flyer.footprint_radius if floats(config) else 0.5 * vehicle.rover.length
    for index, step in enumerate(mission.steps):
        standoff = step.standoff_m if isinstance(step, Follow | Intercept) else None
        if standoff is not None and (clear := pad.clearance(-standoff, 0.0)) < body:
            yield document.problem(
                ("steps", index, kind_of(step), "standoff_m"),
                wrong=f"at {standoff:g} m its boards are {max(clear, 0.0):.2f} m from the middle of the vehicle",
                right=f"more: the vehicle reaches {body:.2f} m",
            )
