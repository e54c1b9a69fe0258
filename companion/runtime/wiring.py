"""The composition root: from a checked flight to a pipeline."""

from __future__ import annotations

import math

import numpy as np

from companion.clock import Clock
from companion.config import Flight
from companion.config.sections import LinkSection
from companion.config.vehicle import autopilot_rules, body_height, floats, link_parameters, on_ground
from companion.estimation.coarse_pad import CoarsePad, RangingSetup, SurveyedPad
from companion.estimation.ground_odometry import AutopilotOdometry, GroundOdometry, Odometry
from companion.guardian.free_flyer_thrust import FreeFlyerShaper
from companion.guardian.guardian import Guardian
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.rover_drive import RoverShaper
from companion.guardian.shaping import Shaper
from companion.guidance.ground import GroundGuidance
from companion.guidance.machine import Guidance
from companion.guidance.policy import Policy
from companion.link.autopilot_link import AutopilotLink
from companion.link.signing import Signing, load_signing_key, signing_time
from companion.perception.pad_detector import PadDetector
from companion.planning.shortest.meeting import make_reach
from companion.prediction.reach import AcceleratingReach, Reachability
from companion.ranging.decoder import RangingDecoder
from companion.ranging.packet import decode_packet
from companion.recording.recorder import Recorder
from companion.runtime.conductor import Conductor
from companion.runtime.driving.pilot import Driving
from companion.runtime.floating import Boards, Floating
from companion.runtime.guardian_announcer import GuardianAnnouncer
from companion.runtime.helm import Helm, HelmParameters
from companion.runtime.landing_targets import LandingTargets
from companion.runtime.mission_announcer import MissionAnnouncer
from companion.runtime.pilot import Pilot
from companion.runtime.piloting import Piloting
from companion.runtime.pipeline import Pipeline
from companion.runtime.planner import Planner
from companion.runtime.tracking import Tracking
from companion.vehicles.free_flyer import FreeFlyer
from companion.vehicles.multicopter import Multicopter
from companion.vehicles.rover import Rover


def build_detector(flight: Flight) -> PadDetector:
    """Build the detector of the mission's pad."""
    return PadDetector(flight.pad, flight.camera, flight.config.perception)


def build_signing(link: LinkSection, t: float, unix_s: float) -> Signing | None:
    """Build what signs and verifies the link's frames; None where no key is configured.

    Args:
        link: the configuration's section.
        t: now, companion clock [s].
        unix_s: now, wall clock [s].

    Raises:
        InputError: the key cannot be used.
    """
    if link.signing.key_file is None:
        return None
    zero = signing_time(unix_s - t)
    return Signing(secret=load_signing_key(link.signing.key_file), link_id=link.signing.link_id, timestamp=zero)


def build_helm(flight: Flight, *, auto_engage: bool, signing: Signing | None = None) -> Helm:
    """Build the guardian's side; `signing` as for `AutopilotLink`."""
    config = flight.config
    return Helm(
        link=AutopilotLink(link_parameters(config), signing, ground_station=config.link.ground_station is not None),
        guardian=Guardian(config.guardian, _shaper(flight)),
        parameters=HelmParameters(
            auto_engage=auto_engage,
            arm_tries=config.engagement.arm_tries,
            arm_interval_s=config.engagement.arm_interval_s,
            handover_age_s=config.guardian.handover_age,
            parameters=tuple(autopilot_rules(config)),
            landing_targets=_autopilot_lands(flight),
        ),
        announcer=GuardianAnnouncer(gear_height=body_height(config)),
    )


def build_planner(flight: Flight, recorder: Recorder, *, auto_engage: bool, clock: Clock | None = None) -> Planner:
    """Build the planner's side; `clock`: what plans with a deadline keep it by, in flight."""
    config = flight.config
    odometry = _odometry(flight)
    return Planner(
        odometry=odometry,
        tracking=Tracking(
            config.estimation,
            config.prediction,
            frd_from_cam=config.camera.mount.frd_from_cam,
            reach=_reach(flight),
        ),
        guidance=_policy(flight),
        piloting=_pilot(flight, odometry, clock),
        conductor=Conductor(
            config.engagement, autopilot_rules(config), auto_engage=auto_engage, mode=_shaper(flight).mode
        ),
        announcer=MissionAnnouncer(unseen_s=config.link.mavlink.pilot.unseen_s, gear_height=body_height(config)),
        landing_targets=_landing_targets(flight),
        recorder=recorder,
        gear_height=body_height(config),
        coarse=_coarse(flight),
    )


def _coarse(flight: Flight) -> CoarsePad | None:
    """Build what says where a surveyed pad is without the camera."""
    survey, transit, config = flight.mission.surveyed, flight.plan.transit, flight.config
    if survey is None or transit is None:
        return None
    anchors = flight.anchors
    ranging = None
    if transit.by_ranges and anchors is not None:
        ranging = RangingSetup(
            anchors=anchors.positions, lever_arm=np.array(config.ranging.tag_lever_arm_m), std=config.ranging.std_m
        )
    return CoarsePad(
        SurveyedPad(
            position_ned=np.array([survey.north_m, survey.east_m, survey.down_m + body_height(config)]),
            yaw=math.radians(survey.heading_deg),
            position_std=survey.position_std_m,
            heading_std=math.radians(survey.heading_std_deg),
        ),
        ranging,
        config.estimation.coarse,
    )


def _shaper(flight: Flight) -> Shaper:
    vehicle = flight.config.vehicle
    if floats(flight.config):
        return FreeFlyerShaper(FreeFlyer(parameters=vehicle.free_flyer))
    if on_ground(flight.config):
        return RoverShaper(vehicle.rover)
    return HolonomicShaper(Multicopter(parameters=vehicle.multicopter).limits)


def _policy(flight: Flight) -> Policy:
    if on_ground(flight.config):
        return GroundGuidance(flight.plan, flight.config.guidance, stands=not floats(flight.config))
    return Guidance(flight.plan, flight.config.guidance)


def _pilot(flight: Flight, odometry: Odometry, clock: Clock | None) -> Pilot:
    config = flight.config
    if floats(config):
        flyer = FreeFlyer(parameters=config.vehicle.free_flyer)
        boards = Boards(ahead=flight.pad.boards_ahead, radius=flight.pad.boards_radius)
        return Floating(config.floating, config.planning, flyer, boards=boards)
    if on_ground(config):
        rover, meeting = Rover(parameters=config.vehicle.rover), config.driving.meeting
        return Driving(
            config.driving,
            rover.motion,
            rear_axle=rover.parameters.rear_axle,
            odometry=odometry,
            reach=make_reach(meeting.reach, rover.car(gear_time=meeting.gear_s)),
            clock=clock,
        )
    return Piloting(
        config.planning,
        config.control,
        config.guidance.approach,
        Multicopter(parameters=config.vehicle.multicopter),
        position_gain=config.guardian.autopilot_position_gain,
        heading_gain=config.guardian.autopilot_heading_gain,
    )


def _odometry(flight: Flight) -> Odometry:
    if on_ground(flight.config) and not floats(flight.config):
        return GroundOdometry(flight.config.estimation.ground, rear_axle=flight.config.vehicle.rover.rear_axle)
    return AutopilotOdometry()


def _reach(flight: Flight) -> Reachability:
    vehicle = flight.config.vehicle
    if floats(flight.config):
        return AcceleratingReach(speed=vehicle.free_flyer.speed, acceleration=vehicle.free_flyer.acceleration)
    if on_ground(flight.config):
        return AcceleratingReach(speed=vehicle.rover.speed_forward, acceleration=vehicle.rover.acceleration)
    limits = Multicopter(parameters=vehicle.multicopter).limits
    return AcceleratingReach(speed=limits.speed_horizontal, acceleration=limits.acceleration_horizontal)


def build_pipeline(flight: Flight, recorder: Recorder, *, auto_engage: bool = True) -> Pipeline:
    """Build both sides for one process; by default it engages by itself, as simulations do."""
    return Pipeline(
        helm=build_helm(flight, auto_engage=auto_engage),
        planner=build_planner(flight, recorder, auto_engage=auto_engage),
        decoder=None
        if flight.anchors is None
        else RangingDecoder(decode_packet, flight.anchors, flight.config.ranging),
    )


def _autopilot_lands(flight: Flight) -> bool:
    return flight.plan.land is not None and flight.plan.land.by_autopilot


def _landing_targets(flight: Flight) -> LandingTargets | None:
    """Build what tells the autopilot of the pad, where the mission lets it land by itself."""
    if not _autopilot_lands(flight):
        return None
    return LandingTargets(
        flight.config.link.mavlink.pilot,
        measurements=flight.config.guidance.acquisition.measurements,
        board=flight.pad.size,
    )
