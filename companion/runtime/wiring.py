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
from companion.runtime.announcer import Announcer
from companion.runtime.conductor import Conductor
from companion.runtime.landing_targets import LandingTargets
from companion.runtime.piloting import Piloting
from companion.runtime.pipeline import Pipeline
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


def build_pipeline(flight: Flight, recorder: Recorder, signing: Signing | None = None) -> Pipeline:
    """Build everything that a step runs; `signing` as for `AutopilotLink`."""
    config = flight.config
    vehicle = Multicopter(parameters=config.vehicle.multicopter)
    return Pipeline(
        link=AutopilotLink(config.link.mavlink, signing, ground_station=config.link.ground_station is not None),
        tracking=Tracking(
            config.estimation,
            config.prediction,
            frd_from_cam=config.camera.mount.frd_from_cam,
            reach=AcceleratingReach(
                speed=vehicle.limits.speed_horizontal, acceleration=vehicle.limits.acceleration_horizontal
            ),
        ),
        guidance=Guidance(flight.plan, config.guidance),
        piloting=Piloting(config.planning, config.control, config.guidance.approach, vehicle),
        guardian=Guardian(config.guardian, vehicle.limits),
        conductor=Conductor(config.engagement, config.preflight.autopilot),
        announcer=Announcer(
            unseen_s=config.link.mavlink.pilot.unseen_s, gear_height=config.vehicle.multicopter.gear_height
        ),
        landing_targets=_landing_targets(flight),
        recorder=recorder,
        gear_height=config.vehicle.multicopter.gear_height,
    )


def _landing_targets(flight: Flight) -> LandingTargets | None:
    """Build what tells the autopilot of the pad, where the mission lets it land by itself."""
    if flight.plan.land is None or not flight.plan.land.by_autopilot:
        return None
    return LandingTargets(
        flight.config.link.mavlink.pilot,
        measurements=flight.config.guidance.acquisition.measurements,
        board=flight.pad.size,
    )
