"""What a docking is described by: the mission, the spacecraft's configuration, the port and the survey of the anchors.

The problems of all files are reported at once.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from companion.config.collect import FileReaders, collect, open_files
from companion.config.docking_tree import DockingConfig
from companion.config.load import is_spacecraft
from companion.config.switching_table import load_switching_table
from companion.config.world_check import WrongWithWorld
from companion.documents import Document, apply_overrides, in_order, load_document, validate
from companion.errors import InputError, Problem
from companion.guidance.decision_process.table import SwitchingTable
from companion.mission.checks import check_limit
from companion.mission.docking import DockingDocument, DockingMission, PolicyName, docking_from, open_docking
from companion.mission.load import resolved
from companion.perception.docking_port import DockingPort, load_port
from companion.ranging.survey import AnchorSurvey
from companion.ranging.survey_file import load_survey


@dataclass(frozen=True, slots=True, kw_only=True)
class Docking:
    """A checked docking mission with all that it names."""

    mission: DockingMission
    config: DockingConfig  # effective: tightened by the mission
    config_source: str
    port: DockingPort
    survey: AnchorSurvey
    table: SwitchingTable | None  # of `policy: optimal`; None with the others


def load_docking(
    mission_path: str | os.PathLike[str],
    *,
    config_path: str | os.PathLike[str] | None = None,
    overrides: Iterable[str] = (),
    wrong_with_world: WrongWithWorld | None = None,
) -> Docking:
    """Read and check a docking mission and every file that it names.

    Args:
        mission_path: the mission file.
        config_path: a configuration to be used instead of the one that the mission names.
        overrides: texts `a.b=value`, as from `--set`; the first key tells whether mission or configuration is meant.
        wrong_with_world: as for `load_flight`.

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
    document, mission, port, read = files.document, files.mission, files.target, files.config
    survey, table = None, None
    if read is not None:
        if mission is not None and mission.step.policy is PolicyName.OPTIMAL and read[0].policy_table is not None:
            load = partial(load_switching_table, read[0].policy_table)
            table = collect(problems, load, read[1], ("policy_table",))
        survey = collect(problems, partial(load_survey, read[0].anchors), read[1], ("anchors",))
        if mission is not None and document is not None:
            problems.extend(_check(document, mission, read[0]))
    if problems or mission is None or port is None or read is None or survey is None:
        raise InputError(in_order(problems))
    return Docking(
        mission=mission,
        config=_with_mission(read[0], mission),
        config_source=files.config_source,
        port=port,
        survey=survey,
        table=table,
    )


def _read(path: Path, overrides: Iterable[str]) -> tuple[DockingConfig, Document]:
    document = load_document(path)
    if not is_spacecraft(document):
        raise InputError.single(
            source=document.source,
            wrong="this configuration describes no docking spacecraft: it has no key spacecraft",
            right="name one that does, such as config/cubesat_sim.yaml",
        )
    document = apply_overrides(document, overrides)
    config = validate(document, DockingConfig)
    table = config.policy_table
    return dataclasses.replace(
        config,
        anchors=resolved(document, ("anchors",), config.anchors),
        policy_table=None if table is None else resolved(document, ("policy_table",), table),
    ), document


_READERS = FileReaders(
    mission_type=DockingDocument,
    open_mission=open_docking,
    mission_from=docking_from,
    target_key=("target", "dock"),
    load_target=load_port,
    config_type=DockingConfig,
    read_config=_read,
)


def _check(document: Document, mission: DockingMission, config: DockingConfig) -> Iterator[Problem]:
    motion = config.guidance.motion
    for key, wanted, allowed in (
        ("speed_mps", mission.limits.speed_mps, motion.approach_speed),
        ("closing_speed_mps", mission.limits.closing_speed_mps, motion.dock_speed),
    ):
        yield from check_limit(document, key, wanted, allowed)
    if mission.step.policy is PolicyName.OPTIMAL and config.policy_table is None:
        yield document.problem(
            ("steps", 0, "dock", "policy"),
            wrong="policy: optimal, but the configuration names no policy_table",
            right="let the configuration name one, or use markov or fixed",
        )


def _with_mission(config: DockingConfig, mission: DockingMission) -> DockingConfig:
    """Tighten the configuration by the mission's limits, and take over its attempts and time."""
    motion, limits, step = config.guidance.motion, mission.limits, mission.step
    speed = motion.approach_speed if limits.speed_mps is None else limits.speed_mps
    closing = motion.dock_speed if limits.closing_speed_mps is None else limits.closing_speed_mps
    motion = dataclasses.replace(
        motion,
        approach_speed=speed,
        reorient_speed=min(motion.reorient_speed, speed),
        align_speed=min(motion.align_speed, speed),
        dock_speed=min(closing, speed),
    )
    guidance = dataclasses.replace(config.guidance, motion=motion, attempts=step.max_attempts, timeout=step.timeout_s)
    return dataclasses.replace(config, guidance=guidance)
