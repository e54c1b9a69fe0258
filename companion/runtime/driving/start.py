"""Where a plan begins: the rear axle's pose when the plan takes effect, and places as seen from there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.config.driving import DrivingSection
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.motion import MotionState
from companion.messages.ownship import OwnshipState
from companion.planning.coupled.model import RoverMotion
from companion.planning.shortest.path import Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanStart:
    """The middle of the rear axle when a plan begins: that moves along the heading, also in a turn."""

    north: float  # [m]
    east: float  # [m]
    yaw: float  # [rad]
    speed: float  # [m/s]
    yaw_rate: float  # [rad/s]

    def ahead_and_right(self, position_ned: Array) -> tuple[float, float]:
        """Give a place (3,) [m] as seen from here: ahead and to the right [m]."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        north, east = float(position_ned[0]) - self.north, float(position_ned[1]) - self.east
        return cosine * north + sine * east, cosine * east - sine * north

    def axle_pose(self, wanted: MotionState, rear_axle: float) -> Pose:
        """Give the rear axle's pose in a wanted motion of the body, as seen from here; `rear_axle` [m] behind it."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        north = float(wanted.position_ned[0]) - rear_axle * math.cos(wanted.yaw) - self.north
        east = float(wanted.position_ned[1]) - rear_axle * math.sin(wanted.yaw) - self.east
        return cosine * north + sine * east, cosine * east - sine * north, wrap_angle(wanted.yaw - self.yaw)


def plan_start(
    ownship: OwnshipState,
    *,
    told: tuple[float | None, float],
    section: DrivingSection,
    motion: RoverMotion,
    rear_axle: float,
    held: bool = False,
) -> PlanStart:
    """Give the rear axle's pose in `lead_s`, with the speed that is asked for; far from that, the measured one.

    Args:
        ownship: the rover's motion now.
        told: speed [m/s] and yaw rate [rad/s] that are asked for now; no speed: nothing is.
        section: `lead_s`, and how far the two speeds may be apart.
        motion: what the rover can do.
        rear_axle: behind the body origin [m].
        held: friction may still hold it: the measured speed says nothing against the one that is asked for.
    """
    yaw = ownship.yaw
    measured = speed_along(ownship)
    speed, yaw_rate = told
    if speed is None or (not held and abs(speed - measured) > section.reference_leash_mps):
        speed = max(-motion.speed_reverse, min(motion.speed_forward, measured))
    most = float(motion.sharpest(np.array(speed)))
    yaw_rate = max(-most, min(most, yaw_rate))
    lead = section.lead_s
    course = yaw + 0.5 * lead * yaw_rate
    way = 0.5 * (measured + speed) * lead
    return PlanStart(
        north=float(ownship.position_ned[0]) - rear_axle * math.cos(yaw) + way * math.cos(course),
        east=float(ownship.position_ned[1]) - rear_axle * math.sin(yaw) + way * math.sin(course),
        yaw=yaw + lead * yaw_rate,
        speed=speed,
        yaw_rate=yaw_rate,
    )


def speed_along(ownship: OwnshipState) -> float:
    """Give the speed [m/s] along the heading."""
    north, east = float(ownship.velocity_ned[0]), float(ownship.velocity_ned[1])
    return math.cos(ownship.yaw) * north + math.sin(ownship.yaw) * east
