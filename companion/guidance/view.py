"""What the guidance looks at in one step, and the quantities it derives from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.parameters import DescentParameters
from companion.messages.coarse import CoarseTarget
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
    at_fence: bool  # the guardian keeps the vehicle from going where it was to go: the fence is in the way
    track: TargetTrack | None
    prediction: Prediction | None
    intercept: Intercept | None
    t_frame: float  # [s] capture time of the newest camera frame, -inf before the first
    gear_height: float  # [m] the body origin above the feet
    velocity_bias_ned: Array  # (3,) [m/s] of the autopilot's estimate, to be taken off the vehicle's velocity
    relative_velocity_ned: Array | None  # (3,) [m/s] to the pad, as the sightings show it; None without any
    lean_ned: Array  # (2,) the vehicle's downward axis against the pad's, north and east, smoothed: 0 parallel
    planned_speed: float = math.inf  # [m/s] horizontal, that the present plan asks for now; inf: there is none
    coarse: CoarseTarget | None = None  # the pad by survey, odometry and ranges; None: the mission has no survey

    @property
    def flying(self) -> bool:
        """Whether the autopilot says that it flies."""
        return self.status.armed and self.status.landed is LandedState.IN_AIR

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
    lateral_speed: float  # [m/s] horizontal speed relative to the pad
    standing: float  # [m] lateral distance of the place where it will stand: see `tip_offset`
    standing_soon: float  # [m] what that will be after `SOON`, moving on as now
    standing_turn: float  # [rad] heading error once it stands: lean and speed across it turn the vehicle as it tips
    range: float  # [m] distance to the pose when landed
    position_std: float  # [m] largest standard deviation of the horizontal position
    inconsistency: float  # averaged NIS per degree of freedom above one, at least 0


def relative_state(view: View, track: TargetTrack, descent: DescentParameters) -> RelativeState:
    """Derive the vehicle's pose relative to the pad from the track."""
    x, y, z = (float(v) for v in track.state[POSITION])
    c, s = math.cos(view.ownship.yaw), math.sin(view.ownship.yaw)

    def in_body(ned: Sequence[float] | Array) -> tuple[float, float]:
        north, east = float(ned[0]), float(ned[1])
        return c * north + s * east, -s * north + c * east

    if view.relative_velocity_ned is not None:
        forward, right = in_body(view.relative_velocity_ned)
    else:
        forward, right = in_body(view.ownship.velocity_ned - view.velocity_bias_ned)
        forward -= float(track.state[VELOCITY][0])
        right -= float(track.state[VELOCITY][1])
    lean_x, lean_y = in_body(view.lean_ned)
    tip_x, tip_y = in_body(tip_offset(view, descent))
    heading_error = wrap_angle(float(track.state[HEADING]))
    height = z - view.gear_height
    lateral = math.hypot(x, y)
    return RelativeState(
        lateral=lateral,
        height=height,
        heading_error=heading_error,
        lateral_speed=math.hypot(forward, right),
        standing=math.hypot(x - tip_x, y - tip_y),
        standing_soon=math.hypot(x - tip_x - SOON * forward, y - tip_y - SOON * right),
        standing_turn=heading_error - descent.tip_turn_s_per_m * (lean_x * right - lean_y * forward),
        range=math.hypot(lateral, height),
        position_std=math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1]), 0.0)),
        inconsistency=max(0.0, track.nis_mean - 1.0),
    )


def tip_offset(view: View, descent: DescentParameters) -> tuple[float, float]:
    """Give where the vehicle would stand, north and east of where it is [m], if it set down now.

    Held against the wind it leans. Set down, it tips upright about the feet that touch first, and its middle comes to
    where the middle between its feet was: down the body axis by the gear's height; farther by `tip_factor`, since the
    wind pushes it on until it stands.
    """
    arm = descent.tip_factor * view.gear_height
    return arm * float(view.lean_ned[0]), arm * float(view.lean_ned[1])
