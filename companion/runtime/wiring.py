"""The composition root: from a checked flight to a pipeline."""

from __future__ import annotations

from companion.config import Flight
from companion.config.sections import LinkSection
from companion.guardian.guardian import Guardian
from companion.guidance.machine import Guidance
from companion.link.autopilot_link import AutopilotLink
from companion.link.signing import Signing, load_signing_key, signing_time
from companion.perception.pad_detector import PadDetector
from companion.prediction.reach import AcceleratingReach
from companion.recording.recorder import Recorder
from companion.runtime.conductor import Conductor
from companion.runtime.guardian_announcer import GuardianAnnouncer
from companion.runtime.helm import Helm, HelmParameters
from companion.runtime.landing_targets import LandingTargets
from companion.runtime.mission_announcer import MissionAnnouncer
from companion.runtime.piloting import Piloting
from companion.runtime.pipeline import Pipeline
from companion.runtime.planner import Planner
from companion.runtime.tracking import Tracking
from companion.vehicles.multicopter import Multicopter


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
    vehicle = Multicopter(parameters=config.vehicle.multicopter)
    return Helm(
        link=AutopilotLink(config.link.mavlink, signing, ground_station=config.link.ground_station is not None),
        guardian=Guardian(config.guardian, vehicle.limits),
        parameters=HelmParameters(
            auto_engage=auto_engage,
            arm_tries=config.engagement.arm_tries,
            arm_interval_s=config.engagement.arm_interval_s,
            handover_age_s=config.guardian.handover_age,
            landing_targets=_autopilot_lands(flight),
        ),
        announcer=GuardianAnnouncer(gear_height=config.vehicle.multicopter.gear_height),
    )


def build_planner(flight: Flight, recorder: Recorder, *, auto_engage: bool) -> Planner:
    """Build the planner's side."""
    config = flight.config
    vehicle = Multicopter(parameters=config.vehicle.multicopter)
    return Planner(
        tracking=Tracking(
            config.estimation,
            config.prediction,
            frd_from_cam=config.camera.mount.frd_from_cam,
            reach=AcceleratingReach(
                speed=vehicle.limits.speed_horizontal, acceleration=vehicle.limits.acceleration_horizontal
            ),
        ),
        guidance=Guidance(flight.plan, config.guidance),
        piloting=Piloting(
            config.planning,
            config.control,
            config.guidance.approach,
            vehicle,
            heading_gain=config.guardian.autopilot_heading_gain,
        ),
        conductor=Conductor(config.engagement, config.preflight.autopilot, auto_engage=auto_engage),
        announcer=MissionAnnouncer(
            unseen_s=config.link.mavlink.pilot.unseen_s, gear_height=config.vehicle.multicopter.gear_height
        ),
        landing_targets=_landing_targets(flight),
        recorder=recorder,
        gear_height=config.vehicle.multicopter.gear_height,
    )


def build_pipeline(flight: Flight, recorder: Recorder, *, auto_engage: bool = True) -> Pipeline:
    """Build both sides for one process; by default it engages by itself, as simulations do."""
    return Pipeline(
        helm=build_helm(flight, auto_engage=auto_engage),
        planner=build_planner(flight, recorder, auto_engage=auto_engage),
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
