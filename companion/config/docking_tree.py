"""What the configuration of a docking spacecraft may hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Gt, Len

from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.estimation.proximity.parameters import ProximityParameters
from companion.guidance.docking.parameters import DockingParameters, MarkovSwitchingParameters

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingCameraSection:
    """The camera that sees the port."""

    position_m: Triple = (0.0, 0.0, -0.05)  # of its lens, in d
    quaternion: Quaternion = (0.0, 1.0, 0.0, 0.0)  # w, x, y, z: turns vectors of cam into d; here it looks along -z


@dataclass(frozen=True, slots=True, kw_only=True)
class SpacecraftSection:
    """The chaser."""

    control: RigidBodyParameters = field(default_factory=RigidBodyParameters)  # mass, nozzles, feedback
    radio_lever_arm_m: Triple = (0.05, 0.05, 0.0)  # of the ranging radio's antenna, in d
    camera: DockingCameraSection = field(default_factory=DockingCameraSection)  # where it sits and looks


@dataclass(frozen=True, slots=True, kw_only=True)
class StartSection:
    """What is known of the chaser when it is switched on, in the frame of the anchors."""

    position_m: Triple  # of its centre of mass
    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)  # w, x, y, z: c_from_d
    position_std_m: Positive = 0.05  # each axis
    velocity_std_mps: Positive = 0.002  # each axis; it starts at rest
    attitude_std_rad: Positive = 0.0175  # about each axis


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingConfig:
    """A docking spacecraft's configuration. Whatever it leaves out has the default that stands beside the code."""

    version: Literal[1]  # of this format
    name: Annotated[str, Len(1, 80)]  # for people: which spacecraft, which purpose
    anchors: Path  # survey of the ranging anchors; counts from this file's folder
    start: StartSection  # what is known at the start
    spacecraft: SpacecraftSection = field(default_factory=SpacecraftSection)  # the chaser: mass, nozzles, sensors
    estimation: ProximityParameters = field(default_factory=ProximityParameters)  # noise, gate, structure of the filter
    guidance: DockingParameters = field(default_factory=DockingParameters)  # speeds, clearances, patience
    markov: MarkovSwitchingParameters = field(default_factory=MarkovSwitchingParameters)  # policy: markov
    policy_table: Path | None = None  # decisions of `policy: optimal`; made by `companion study policy`
