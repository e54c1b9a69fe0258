"""Puts a docking together from its files."""

from __future__ import annotations

import numpy as np

from companion.config.docking import Docking
from companion.config.docking_tree import SpacecraftSection
from companion.control.rigid_body.controller import RigidBodyController
from companion.errors import InputError
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.parameters import ProximitySetup
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_from_quaternion
from companion.geometry.transform import RigidTransform
from companion.guidance.docking.guidance import DockingGuidance
from companion.guidance.docking.optimal_switching import OptimalSwitching
from companion.guidance.docking.policies import FixedDistances, MarkovSwitching, SwitchingPolicy
from companion.guidance.docking.port import DockingSetup
from companion.messages.proximity import ProximityState
from companion.mission.docking import PolicyName
from companion.perception.docking_port import DockingPort
from companion.ranging.survey import AnchorSurvey
from companion.recording import Recorder
from companion.runtime.docking.pipeline import DockingPipeline


def build_docking(
    docking: Docking, initial: ProximityState, recorder: Recorder | None, policy: SwitchingPolicy | None = None
) -> DockingPipeline:
    """Build the pipeline.

    Args:
        docking: mission, configuration, port and survey.
        initial: what is known of the chaser at the start; it keeps this attitude on the approach.
        recorder: takes the recording; None: nothing is kept.
        policy: instead of the mission's own.

    Raises:
        InputError: the spacecraft cannot be: its nozzles, its masses, or too many anchors.
    """
    try:
        return DockingPipeline(
            estimator=ProximityFilter(proximity_setup(docking), docking.config.estimation, initial),
            guidance=DockingGuidance(
                docking.config.guidance, docking_setup(docking, initial.quaternion), policy or policy_of(docking)
            ),
            controller=RigidBodyController(docking.config.spacecraft.control),
            recorder=recorder,
        )
    except ValueError as error:
        raise InputError.single(
            source=docking.config_source, wrong=str(error), right="correct the spacecraft, or the survey of its anchors"
        ) from None


def proximity_setup(docking: Docking) -> ProximitySetup:
    """Give what the estimator knows of chaser, anchors and port."""
    return spacecraft_setup(docking.config.spacecraft, docking.survey, docking.port)


def spacecraft_setup(craft: SpacecraftSection, survey: AnchorSurvey, port: DockingPort | None) -> ProximitySetup:
    """Give what the estimator knows of a chaser among anchors; without a port there are no markers."""
    c_from_t = RigidTransform(rotation=np.eye(3), translation=np.zeros(3))
    if port is not None:
        c_from_t = RigidTransform(rotation=rotation_from_quaternion(port.quaternion), translation=port.position)
    return ProximitySetup(
        anchors=survey.positions,
        lever_arm=np.array(craft.radio_lever_arm_m),
        markers=np.zeros((0, 3)) if port is None else port.markers,
        c_from_t=c_from_t,
        d_from_cam=RigidTransform(
            rotation=rotation_from_quaternion(np.array(craft.camera.quaternion)),
            translation=np.array(craft.camera.position_m),
        ),
        mass=craft.control.mass,
        control_period=craft.control.period,
    )


def docking_setup(docking: Docking, start_quaternion: Array) -> DockingSetup:
    """Give what the guidance knows of the port, and the attitude to be kept on the approach."""
    port = docking.port
    return DockingSetup(
        position=port.docked_position,
        quaternion=port.quaternion,
        normal=port.outward,
        start_quaternion=start_quaternion,
    )


def known_start(docking: Docking) -> ProximityState:
    """Give the start as the configuration has it, at time 0."""
    start = docking.config.start
    return initial_state(
        position=np.array(start.position_m),
        velocity=np.zeros(3),
        quaternion=np.array(start.quaternion),
        position_std=start.position_std_m,
        velocity_std=start.velocity_std_mps,
        attitude_std=start.attitude_std_rad,
    )


def initial_state(
    *,
    position: Array,
    velocity: Array,
    quaternion: Array,
    position_std: float,
    velocity_std: float,
    attitude_std: float,
) -> ProximityState:
    """Give an estimate at time 0 with the same uncertainty along and about every axis.

    Args:
        position: (3,) [m] of the centre of mass, in c.
        velocity: (3,) [m/s], in c.
        quaternion: (4,) c_from_d.
        position_std: [m].
        velocity_std: [m/s].
        attitude_std: [rad].
    """
    stds = np.repeat([position_std, velocity_std, attitude_std], 3)
    return ProximityState(
        t=0.0,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        rate=np.zeros(3),
        covariance=np.diag(stds**2),
        mahalanobis=0.0,
        t_vision=-np.inf,
        t_range=-np.inf,
    )


def policy_of(docking: Docking) -> SwitchingPolicy:
    """Give the policy that the mission asks for."""
    step = docking.mission.step
    if step.policy is PolicyName.FIXED:
        return FixedDistances(reorient_range=step.reorient_range_m, align_range=step.align_range_m)
    if step.policy is PolicyName.MARKOV:
        return MarkovSwitching(parameters=docking.config.markov)
    if docking.table is None:
        raise ValueError("policy: optimal needs the table that load_docking reads")
    return OptimalSwitching(docking.table, carefulness=step.careful)
