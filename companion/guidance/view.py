"""What the guidance looks at in one step, and the quantities it derives from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.messages.ownship import LandedState, OwnshipState, VehicleStatus
from companion.messages.target import HEADING, POSITION, VELOCITY, Intercept, Prediction, TargetTrack

SOON = 0.4  # [s] from the gate to the touchdown, about


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """Everything that is known at one step."""

    t: float  # [s]
    ownship: OwnshipState
    status: VehicleStatus
    commanding: bool  # the guardian is engaged and its setpoints are flown
    taken_over: bool  # somebody else has changed the mode, or the guardian has handed over
    guardian_reason: str  # why the guardian is in its state, in plain words
    track: TargetTrack | None
    prediction: Prediction | None
    intercept: Intercept | None
    t_frame: float  # [s] capture time of the newest camera frame, -inf before the first
    gear_height: float  # [m] the body origin above the feet
    velocity_bias_ned: Array  # (3,) [m/s] of the autopilot's estimate, to be taken off the vehicle's velocity

    @property
    def landed(self) -> bool:
        """Whether the autopilot says that it stands on the ground, disarmed."""
        return not self.status.armed and self.status.landed is LandedState.ON_GROUND


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeState:
    """The vehicle as seen from the pad."""

    lateral: float  # [m] horizontal distance between the vehicle and the landing point
    height: float  # [m] of the feet above the pad
    heading_error: float  # [rad] pad heading minus vehicle heading
    lateral_soon: float  # [m] what it will be after `SOON`, moving on as now
    lateral_speed: float  # [m/s] horizontal speed relative to the pad
    range: float  # [m] distance to the pose when landed
    position_std: float  # [m] largest standard deviation of the horizontal position
    inconsistency: float  # averaged NIS per degree of freedom above one, at least 0


def relative_state(view: View, track: TargetTrack) -> RelativeState:
    """Derive the vehicle's pose relative to the pad from the track."""
    x, y, z = (float(v) for v in track.state[POSITION])
    yaw = view.ownship.yaw
    c, s = math.cos(yaw), math.sin(yaw)
    north = float(view.ownship.velocity_ned[0] - view.velocity_bias_ned[0])
    east = float(view.ownship.velocity_ned[1] - view.velocity_bias_ned[1])
    forward, right = c * north + s * east, -s * north + c * east
    vx, vy = float(track.state[VELOCITY][0]), float(track.state[VELOCITY][1])
    height = z - view.gear_height
    lateral = math.hypot(x, y)
    return RelativeState(
        lateral=lateral,
        height=height,
        heading_error=wrap_angle(float(track.state[HEADING])),
        lateral_soon=math.hypot(x + SOON * (vx - forward), y + SOON * (vy - right)),
        lateral_speed=math.hypot(vx - forward, vy - right),
        range=math.hypot(lateral, height),
        position_std=math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1]), 0.0)),
        inconsistency=max(0.0, track.nis_mean - 1.0),
    )
