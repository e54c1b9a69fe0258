"""Reads what `companion study anchors` is about: a docking mission, a docking world of the simulator, or a survey."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.config.docking import load_docking
from companion.config.docking_tree import SpacecraftSection
from companion.documents import Document, load_document
from companion.documents.nodes import MappingNode
from companion.errors import InputError
from companion.estimation.proximity.parameters import ANCHORS_MAX, ProximityParameters
from companion.geometry.arrays import Array
from companion.guidance.docking.parameters import MarkovSwitchingParameters
from companion.mission.docking import is_docking
from companion.perception.docking_port import DockingPort, load_port
from companion.placement.geometry import on_one_line
from companion.placement.scene import Scene
from companion.ranging.survey import Anchor, AnchorSurvey, SurveyFrame, geometry_remarks
from companion.ranging.survey_file import survey_from_document
from companion.runtime.docking.wiring import spacecraft_setup

# What a multirotor accelerates without the estimator's knowing [m/s^2/sqrt(Hz)]: as for its landing by ranges.
_MULTIROTOR_NOISE = 0.2
_ANY_POLICY = "steps.0.dock.policy=markov"  # Algorithm 1 is asked whatever flies: no decision table is wanted
_NEITHER = (
    "give a docking mission (missions/dock_cubesat.yaml), a docking world of the simulator "
    "(sitl_stub/cubesat/worlds/docking.yaml, or its name) or a survey of anchors (config/anchors/pad_four.yaml)"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Given:
    """What the study starts from."""

    source: str  # as the user named it
    survey: AnchorSurvey
    scene: Scene
    start: Array | None  # (3,) [m] of the chaser's centre of mass, in the survey's frame; None: not said


def read_given(name: str) -> Given:
    """Read a file, or a docking world by its name.

    Raises:
        InputError: it is none of them, or wrong.
    """
    if not Path(name).suffix and not Path(name).exists():
        return _checked(_of_world(name))
    document = load_document(name)
    keys = set(document.root.entries) if isinstance(document.root, MappingNode) else set()
    readers: tuple[tuple[bool, Callable[[], Given]], ...] = (
        (is_docking(document), lambda: _of_mission(name)),
        ("chaser" in keys, lambda: _of_world(name)),
        ({"anchors", "frame"} <= keys, lambda: _of_survey(document)),
    )
    for fits, read in readers:
        if fits:
            return _checked(read())
    raise InputError.single(
        source=name, wrong="this file says nothing of anchors and who finds its way by them", right=_NEITHER
    )


def with_options(
    given: Given,
    *,
    start: list[float] | None,
    port: str | None,
    lever_arm: list[float] | None,
    range_std: float | None,
    acceleration_noise: float | None,
    range_rate: float,
) -> Given:
    """Replace what options say.

    Args:
        given: as read.
        start: (3,) [m].
        port: a docking port's file; the chaser is then the docking CubeSat as designed.
        lever_arm: (3,) [m] of the radio, in d.
        range_std: of one range [m].
        acceleration_noise: that nobody commanded [m/s^2/sqrt(Hz)].
        range_rate: [1/s].

    Raises:
        InputError: a file or a place is wrong.
    """
    scene = given.scene
    setup = scene.setup
    if port is not None:
        if scene.port is not None:
            raise InputError.single(
                source=f"--port {port}",
                wrong=f"{given.source} names its own port",
                right="leave it out, or give a survey",
            )
        loaded = load_port(port)
        setup = spacecraft_setup(SpacecraftSection(), given.survey, loaded)
        scene = dataclasses.replace(scene, port=loaded)
    if lever_arm is not None:
        setup = dataclasses.replace(setup, lever_arm=np.array(lever_arm))
    noise = scene.noise
    noise = dataclasses.replace(
        noise,
        range_std=noise.range_std if range_std is None else range_std,
        acceleration_noise=noise.acceleration_noise if acceleration_noise is None else acceleration_noise,
    )
    scene = dataclasses.replace(scene, setup=setup, noise=noise, range_rate=range_rate)
    return dataclasses.replace(given, scene=scene, start=given.start if start is None else np.array(start))


def _of_mission(name: str) -> Given:
    docking = load_docking(name, overrides=[_ANY_POLICY])
    config = docking.config
    scene = _scene(
        docking.survey,
        docking.port,
        np.array(config.start.quaternion),
        craft=config.spacecraft,
        noise=config.estimation,
        switching=config.markov,
    )
    return Given(source=name, survey=docking.survey, scene=scene, start=np.array(config.start.position_m))


def _of_world(name: str) -> Given:
    try:
        from sitl_stub.cubesat.world import DockingWorld
        from sitl_stub.world.documents import WorldFileError
    except ImportError:
        raise InputError.single(
            source=name, wrong="worlds are the simulator's, which is not installed", right=_NEITHER
        ) from None
    try:
        world = DockingWorld.load(name)
    except WorldFileError as error:
        raise InputError.single(source=name, wrong=str(error), right=_NEITHER) from None
    survey = AnchorSurvey(
        name=f"world {world.name}"[:80],
        frame=SurveyFrame.MOTHERSHIP,
        anchors=tuple(Anchor(id=number, position=place) for number, place in enumerate(world.anchors, 1)),
    )
    port = DockingPort(
        name=world.name,
        position=np.array(world.target.position),
        quaternion=np.array(world.target.quaternion),
        normal=np.array([0.0, 0.0, 1.0]),
        side=world.target.side,
        docked_distance=world.target.side,
        markers=np.array(world.target.markers),
    )
    scene = _scene(survey, port, np.array(world.chaser.quaternion))
    return Given(source=name, survey=survey, scene=scene, start=np.array(world.chaser.position))


def _of_survey(document: Document) -> Given:
    survey = survey_from_document(document)
    craft = dataclasses.replace(SpacecraftSection(), radio_lever_arm_m=(0.0, 0.0, 0.0))
    noise = ProximityParameters()
    if survey.frame is not SurveyFrame.MOTHERSHIP:
        noise = dataclasses.replace(noise, acceleration_noise=_MULTIROTOR_NOISE)
    scene = _scene(survey, None, np.array([1.0, 0.0, 0.0, 0.0]), craft=craft, noise=noise)
    return Given(source=document.source, survey=survey, scene=scene, start=None)


def _scene(
    survey: AnchorSurvey,
    port: DockingPort | None,
    quaternion: Array,
    *,
    craft: SpacecraftSection | None = None,
    noise: ProximityParameters | None = None,
    switching: MarkovSwitchingParameters | None = None,
) -> Scene:
    if len(survey.anchors) > ANCHORS_MAX:
        raise InputError.single(
            source=survey.name,
            wrong=f"{len(survey.anchors)} anchors",
            right=f"at most {ANCHORS_MAX}: so many the pose estimator fuses",
        )
    return Scene(
        setup=spacecraft_setup(craft or SpacecraftSection(), survey, port),
        noise=noise or ProximityParameters(),
        start_quaternion=quaternion,
        port=port,
        switching=switching or MarkovSwitchingParameters(),
    )


def _checked(given: Given) -> Given:
    """Refuse anchors that fix no place anywhere."""
    if on_one_line(given.survey.positions):
        wrong, _, right = geometry_remarks(given.survey)[0].partition("; ")
        raise InputError.single(source=given.source, key="anchors", wrong=wrong, right=right)
    return given
