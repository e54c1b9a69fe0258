"""Everything that a flight is described by, read together: the mission, its configuration, its pad, its calibration.

The problems of all files are reported at once.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

from companion.config.collect import FileReaders, collect, open_files
from companion.config.load import read_config
from companion.config.target_checks import check_target
from companion.config.tree import Config
from companion.config.vehicle import floats, on_ground
from companion.config.world_check import WrongWithWorld
from companion.documents import Document, in_order
from companion.errors import InputError, Problem
from companion.guidance.plan import FlightPlan
from companion.link.endpoints import parse_endpoint
from companion.link.ground_station import parse_ground_station
from companion.link.signing import load_signing_key
from companion.mission import (
    Envelope,
    Land,
    Mission,
    check_envelope,
    check_vehicle,
    flight_plan,
    mission_from,
    open_mission,
)
from companion.mission.schema import Coarse, MissionDocument
from companion.perception.calibration_file import load_calibration
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pad_file import load_pad
from companion.ranging.parameters import NO_INPUT
from companion.ranging.source import parse_ranging_input
from companion.ranging.survey import AnchorSurvey, SurveyFrame
from companion.ranging.survey_file import load_survey

T = TypeVar("T")

_READERS = FileReaders(
    mission_type=MissionDocument,
    open_mission=open_mission,
    mission_from=mission_from,
    target_key=("target", "pad"),
    load_target=load_pad,
    config_type=Config,
    read_config=read_config,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A checked mission with all that it names."""

    mission: Mission
    config: Config  # effective: tightened by the mission's limits, with the mission's values for the landing
    config_source: str  # the configuration's file
    plan: FlightPlan  # the mission as the guidance sees it
    pad: Pad
    camera: CameraModel
    anchors: AnchorSurvey | None = None  # of the ranging radios; None: no ranging input is configured


def load_flight(
    mission_path: str | os.PathLike[str],
    *,
    config_path: str | os.PathLike[str] | None = None,
    overrides: Iterable[str] = (),
    wrong_with_world: WrongWithWorld | None = None,
) -> Flight:
    """Read and check a mission and every file that it names.

    Args:
        mission_path: the mission file.
        config_path: a configuration to be used instead of the one that the mission names.
        overrides: texts `a.b=value`, as from `--set`; the first key tells whether mission or configuration is meant.
        wrong_with_world: says what is wrong with the simulation's world, None where nothing is; not asked for: not
            checked. (The configuration does not know the simulator.)

    Raises:
        InputError: with every problem of every file.
    """
    problems: list[Problem] = []
    files = open_files(
        problems,
        _READERS,
        mission_path,
        config_path=config_path,
        overrides=overrides,
        wrong_with_world=wrong_with_world,
    )
    document, mission, pad, read = files.document, files.mission, files.target, files.config
    camera = anchors = None
    if read is not None:
        config, config_document = read
        load = partial(load_calibration, config.camera.calibration)
        camera = collect(problems, load, config_document, ("camera", "calibration"))
        _check_link(problems, config, config_document)
        anchors = _check_ranging(problems, config, config_document)
        if mission is not None and document is not None:
            problems.extend(check_vehicle(document, mission, config.vehicle.type.value.replace("_", "-")))
            _check_transit(problems, document, mission, config, anchors)
            problems.extend(check_envelope(document, mission, envelope_of(config)))
            if pad is not None:
                problems.extend(check_target(document, mission, pad, config))
    if problems or mission is None or pad is None or read is None or camera is None:
        raise InputError(in_order(problems))
    return Flight(
        mission=mission,
        config=with_mission(read[0], mission),
        config_source=files.config_source,
        plan=flight_plan(mission),
        pad=pad,
        camera=camera,
        anchors=anchors,
    )


def load_vehicle(config_path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> tuple[Config, CameraModel]:
    """Read and check a configuration and the files that it names, without a mission.

    Args:
        config_path: the configuration.
        overrides: texts `a.b=value`, as from `--set`.

    Raises:
        InputError: with every problem of every file.
    """
    problems: list[Problem] = []
    config, document = read_config(config_path, overrides)
    load = partial(load_calibration, config.camera.calibration)
    camera = collect(problems, load, document, ("camera", "calibration"))
    _check_link(problems, config, document)
    _check_ranging(problems, config, document)
    if problems or camera is None:
        raise InputError(in_order(problems))
    return config, camera


def _check_link(problems: list[Problem], config: Config, document: Document) -> None:
    """Check the link's URLs and key; add what is wrong, with its place in the configuration."""
    link = config.link
    if link.signing.key_file is not None:
        collect(problems, partial(load_signing_key, link.signing.key_file), document, ("link", "signing", "key_file"))
    for key, url, parse in (
        ("url", link.url, parse_endpoint),
        ("ground_station", link.ground_station, parse_ground_station),
    ):
        if url is None:
            continue
        try:
            parse(url)
        except InputError as error:
            problems.extend(document.problem(("link", key), wrong=p.wrong, right=p.right) for p in error.problems)


def _check_transit(
    problems: list[Problem], document: Document, mission: Mission, config: Config, anchors: AnchorSurvey | None
) -> None:
    """Check that a mission that flies by ranges has them; add what is wrong, with its place in the mission.

    An input or a survey that is set but wrong has been told of before.
    """
    if mission.transit is None or mission.transit.by is not Coarse.RANGES:
        return
    place = ("steps", mission.steps.index(mission.transit), "transit", "by")
    if config.ranging.input == NO_INPUT:
        wrong = "the mission flies by ranges, and the configuration has no ranging input"
        right = "set ranging.input and ranging.survey in the configuration, or write `by: odometry`"
        problems.append(document.problem(place, wrong=wrong, right=right))
    elif anchors is not None and anchors.frame is not SurveyFrame.PAD:
        wrong = f'the anchors\' survey "{anchors.name}" is in {anchors.frame.value}'
        problems.append(document.problem(place, wrong=wrong, right="give their places in the pad's frame: frame: pad"))


def _check_ranging(problems: list[Problem], config: Config, document: Document) -> AnchorSurvey | None:
    """Check where ranges come from, and the survey; add what is wrong, with its place in the configuration.

    Returns:
        The survey where there is an input.
    """
    ranging = config.ranging
    try:
        wanted = parse_ranging_input(ranging.input) is not None
    except InputError as error:
        problems.extend(document.problem(("ranging", "input"), wrong=p.wrong, right=p.right) for p in error.problems)
        return None
    if ranging.survey is not None:
        survey = collect(problems, partial(load_survey, ranging.survey), document, ("ranging", "survey"))
        return survey if wanted else None
    if wanted:
        right = "name the file of the anchors, such as config/anchors/pad_four.yaml"
        problems.append(document.problem(("ranging", "survey"), wrong="the anchors are not known", right=right))
    return None


def envelope_of(config: Config) -> Envelope:
    """Give what the configuration allows a mission."""
    multicopter, guardian = config.vehicle.multicopter, config.guardian
    fence = guardian.fence
    if on_ground(config):
        rover, flyer = config.vehicle.rover, config.vehicle.free_flyer
        vehicle = flyer if floats(config) else rover
        return Envelope(
            speed_mps=flyer.speed if floats(config) else rover.speed_forward,
            acceleration_mps2=vehicle.acceleration,
            closing_speed_mps=min(vehicle.closing_speed, guardian.closing_speed),
            radius_m=fence.radius - fence.margin,
        )
    return Envelope(
        speed_mps=multicopter.speed_horizontal,
        speed_up_mps=multicopter.speed_up,
        speed_down_mps=multicopter.speed_down,
        acceleration_mps2=multicopter.acceleration_horizontal,
        closing_speed_mps=min(multicopter.closing_speed, guardian.closing_speed),
        height_m=fence.height_max - fence.margin,
        radius_m=fence.radius - fence.margin,
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
    rover = _replaced(
        config.vehicle.rover,
        speed_forward=limits.speed_mps,
        speed_reverse=None if limits.speed_mps is None else min(limits.speed_mps, config.vehicle.rover.speed_reverse),
        acceleration=limits.acceleration_mps2,
        closing_speed=limits.closing_speed_mps,
    )
    free_flyer = _replaced(
        config.vehicle.free_flyer,
        speed=limits.speed_mps,
        acceleration=limits.acceleration_mps2,
        closing_speed=limits.closing_speed_mps,
    )
    fence = config.guardian.fence
    fence = _replaced(
        fence,
        height_max=None if limits.height_m is None else min(fence.height_max, limits.height_m + fence.margin),
        radius=None if limits.radius_m is None else min(fence.radius, limits.radius_m + fence.margin),
    )
    guardian = replace(_replaced(config.guardian, closing_speed=limits.closing_speed_mps), fence=fence)
    land = next((step for step in mission.steps if isinstance(step, Land)), Land())
    angle = land.cone_half_angle_deg
    descent = _replaced(
        config.guidance.descent,
        speed_mps=land.descent_mps,
        cone_half_angle_rad=None if angle is None else math.radians(angle),
    )
    return replace(
        config,
        vehicle=replace(config.vehicle, multicopter=multicopter, rover=rover, free_flyer=free_flyer),
        guidance=replace(config.guidance, descent=descent),
        guardian=guardian,
    )


def _replaced(parameters: T, **values: float | None) -> T:
    """Replace those fields for which a value is given."""
    given = {name: value for name, value in values.items() if value is not None}
    result: T = replace(parameters, **given)  # type: ignore[type-var]
    return result
