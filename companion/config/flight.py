"""Everything that a flight is described by, read together: the mission, its configuration, its pad, its calibration.

The problems of all files are reported at once.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

from companion.config.load import load_config
from companion.config.tree import Config
from companion.documents import in_order, nearest, read_text, split_override
from companion.errors import InputError, Problem
from companion.guidance.plan import FlightPlan
from companion.mission import Envelope, Land, Mission, check_envelope, flight_plan, read_mission
from companion.mission.schema import MissionDocument

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A checked mission with all that it names."""

    mission: Mission
    config: Config  # effective: tightened by the mission's limits, with the mission's values for the landing
    config_source: str  # the configuration's file
    plan: FlightPlan  # the mission as the guidance sees it


def load_flight(
    mission_path: str | os.PathLike[str],
    *,
    config_path: str | os.PathLike[str] | None = None,
    overrides: Iterable[str] = (),
) -> Flight:
    """Read and check a mission and every file that it names.

    Args:
        mission_path: the mission file.
        config_path: a configuration to be used instead of the one that the mission names.
        overrides: texts `a.b=value`, as from `--set`; the first key tells whether mission or configuration is meant.

    Raises:
        InputError: with every problem of every file.
    """
    problems: list[Problem] = []
    for_mission, for_config = _routed(overrides, problems)
    read = _collect(problems, lambda: read_mission(mission_path, for_mission))
    chosen = config_path if config_path is not None else read[0].config if read is not None else None
    config = None if chosen is None else _collect(problems, lambda: load_config(chosen, for_config))
    if read is not None:
        mission, document = read
        _collect(problems, lambda: read_text(mission.pad))
        if config is not None:
            problems.extend(check_envelope(document, mission, envelope_of(config)))
    if config is not None:
        calibration = config.camera.calibration
        _collect(problems, lambda: read_text(calibration))
    if problems or read is None or config is None or chosen is None:
        raise InputError(in_order(problems))
    return Flight(
        mission=read[0],
        config=with_mission(config, read[0]),
        config_source=os.fspath(chosen),
        plan=flight_plan(read[0]),
    )


def envelope_of(config: Config) -> Envelope:
    """Give what the configuration allows a mission."""
    multicopter = config.vehicle.multicopter
    return Envelope(
        speed_mps=multicopter.speed_horizontal,
        speed_up_mps=multicopter.speed_up,
        speed_down_mps=multicopter.speed_down,
        acceleration_mps2=multicopter.acceleration_horizontal,
        closing_speed_mps=multicopter.closing_speed,
    )


def with_mission(config: Config, mission: Mission) -> Config:
    """Tighten the configuration by the mission's limits, and take over its values for the landing."""
    limits = mission.limits
    multicopter = _replaced(
        config.vehicle.multicopter,
        speed_horizontal=limits.speed_mps,
        speed_up=limits.speed_up_mps,
        speed_down=limits.speed_down_mps,
        acceleration_horizontal=limits.acceleration_mps2,
        closing_speed=limits.closing_speed_mps,
    )
    land = next((step for step in mission.steps if isinstance(step, Land)), Land())
    angle = land.cone_half_angle_deg
    descent = _replaced(
        config.guidance.descent,
        speed_mps=land.descent_mps,
        cone_half_angle_rad=None if angle is None else math.radians(angle),
    )
    return replace(
        config,
        vehicle=replace(config.vehicle, multicopter=multicopter),
        guidance=replace(config.guidance, descent=descent),
    )


def _replaced(parameters: T, **values: float | None) -> T:
    """Replace those fields for which a value is given."""
    given = {name: value for name, value in values.items() if value is not None}
    result: T = replace(parameters, **given)  # type: ignore[type-var]
    return result


def _collect(problems: list[Problem], read: Callable[[], T]) -> T | None:
    try:
        return read()
    except InputError as error:
        problems.extend(error.problems)
        return None


def _routed(overrides: Iterable[str], problems: list[Problem]) -> tuple[list[str], list[str]]:
    """Sort `--set` texts into those for the mission and those for the configuration, by their first key."""
    mission_keys = [item.name for item in fields(MissionDocument)]
    config_keys = [item.name for item in fields(Config)]
    routed: tuple[list[str], list[str]] = ([], [])
    for text in overrides:
        try:
            steps = split_override(text)[0]
        except InputError as error:
            problems.extend(error.problems)
            continue
        if steps[0] in mission_keys:
            routed[0].append(text)
        elif steps[0] in config_keys:
            routed[1].append(text)
        else:
            meant = nearest(steps[0], [*mission_keys, *config_keys])
            known = f"the mission has {', '.join(mission_keys)}; the configuration has {', '.join(config_keys)}"
            problems.append(
                Problem(
                    source=f"--set {text}",
                    line=None,
                    column=None,
                    key=steps[0],
                    wrong="no such key",
                    right=f"did you mean {meant}?" if meant else known,
                )
            )
    return routed
