"""Parameters of the docking guidance. Ranges are distances between the chaser's centre of mass and its docked position.

Sizes are those of two cubes of 0.1 m side: half the diagonal of one is 0.087 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval

Positive = Annotated[float, Gt(0.0)]
Angle = Annotated[float, Interval(gt=0.0, lt=1.5)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingMotionParameters:
    """How fast the chaser is to move and turn."""

    approach_speed: Positive = 0.020  # [m/s] along the line of sight
    reorient_speed: Positive = 0.015  # [m/s] likewise while it turns, so that the turn is over in time
    align_speed: Positive = 0.010  # [m/s] near the target, sideways and away from it
    dock_speed: Positive = 0.010  # [m/s] closing: 1 cm/s is usual for docking CubeSats
    acceleration: Positive = 0.008  # [m/s^2] a third of what the nozzles give; the rest is for feedback and turning
    braking: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.4  # share of it planned for stopping at a point
    stopping_time: Positive = 1.0  # [s] the last of a way fades out with this time constant: no overshoot
    turn_rate: Positive = 0.10  # [rad/s] at most
    turn_ramp: Positive = 3.0  # [s] from rest to that rate: 0.05 rad/s^2 at most, a tenth of what the nozzles give
    period: Positive = 0.1  # [s] usual time between two steps
    longest_step: Positive = 0.5  # [s] after a longer silence of the estimator the goal has waited for the rest of it
    # On the approach no place is to be met, only a velocity: the goal is carried to the estimated position with this
    # time constant, and what the estimate was off at the start is not flown back. Well above the 0.1 s between two
    # steps, so that the estimate's noise does not shake the goal; well below an approach of a minute.
    carry_time: Positive = 4.0  # [s]
    lead: Positive = 0.10  # [m] the goal waits while it is farther than this from the estimated position


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceParameters:
    """What keeps the chaser off the target."""

    target_depth: Positive = 0.10  # [m] from the docked position back to the target's centre: one side of a cube
    keep_out: Positive = 0.30  # [m] round the target's centre on a way round it: two half diagonals and 0.13 m to spare
    front_angle: Angle = 1.13  # [rad] (65 deg) a line of sight farther off the normal passes too close by the target:
    waypoint_angle: Angle = 0.96  # [rad] (55 deg) then a waypoint so far off the normal comes first,
    waypoint_range: Positive = 0.60  # [m] this far from the docked position (nearer, if the start is), and counts as
    waypoint_reached: Positive = 0.03  # [m] passed when this near
    # The turn sweeps a sphere of 0.087 m about the chaser; so far out it stays 5 cm off the target's (0.22 m between
    # the centres). No nearer than this until the turn is complete:
    turning_range: Positive = 0.20  # [m]
    turned: Positive = 0.05  # norm of the error quaternion's vector part below which it is (0.1 rad)
    latest_reorient_range: Positive = 0.30  # [m] the turn is begun here at the latest: 0.1 m to slow down in
    least_align_range: Positive = 0.10  # [m] (first r1) and the way in front of the docking face here,
    face_clearance: Positive = 0.05  # [m] or where the docking faces are this far apart, if that is earlier
    # Where a policy asks for the nearest: a curved way in begins no nearer than 0.12 m, and 1 cm is to slow down in.
    near_align_range: Positive = 0.13  # [m]
    # Where a policy asks to aim ahead, the way leads to a point in front of the docked position. This far out it enters
    # the camera's cone (30 deg) 7 cm of way before the curved way in may begin (20 deg): vision settles meanwhile.
    ahead_range: Positive = 0.17  # [m] to the point aimed at


@dataclass(frozen=True, slots=True, kw_only=True)
class SettlingParameters:
    """When enough is known, and when the chaser stands well enough, to go on."""

    # The way is fixed where it begins: what the estimate is off there is flown back later, and costs gas. Half a second
    # of ranges at 50 Hz gives this much; the approach begins once no axis is less certain,
    start_std: Positive = 0.015  # [m]
    start_patience: Annotated[float, Ge(0.0)] = 5.0  # [s] or after this time: anchors may give no better
    vision_age: Positive = 0.3  # [s] six pictures: vision is there while the last fused one is not older
    silence: Positive = 2.0  # [s] neither range nor picture for so long: the goal stands still
    position: Positive = 0.010  # [m] at rest in front of the docking face: estimated position within this,
    speed: Positive = 0.005  # [m/s] estimated speed,
    angle: Positive = 0.035  # [rad] attitude error, and
    position_std: Positive = 0.006  # [m] standard deviation below these,
    dwell: Positive = 1.0  # [s] with vision for so long: twenty pictures
    patience: Positive = 60.0  # [s] the goal at rest there and the chaser not, in this time: the attempt has failed
    further: Positive = 0.10  # [m] the next one aligns so much farther out, where the camera sees more
    farthest: Positive = 0.80  # [m] never beyond this, whatever the policy says: the camera sees no farther than 1 m


@dataclass(frozen=True, slots=True, kw_only=True)
class CorridorParameters:
    """The last part, straight in, and what ends it."""

    floor: Positive = 0.012  # [m] allowed distance from the planned path at contact (docked: 0.015 m), growing by
    half_angle: Angle = 0.17  # [rad] (10 deg) the tangent of this per metre of distance
    angle: Positive = 0.10  # [rad] allowed attitude error
    blind_range: Positive = 0.04  # [m] nearer than this the markers leave the picture: no vision is no failure
    vision_lost: Positive = 0.5  # [s] farther out it is, after this time
    past_contact: Positive = 0.03  # [m] the goal runs on behind the docked position, so that contact happens
    contact_patience: Positive = 10.0  # [s] the goal at rest there for so long without contact: a failed attempt
    straight: Positive = 0.05  # [m] a curved way in is straight from here on
    direct_angle: Angle = 0.35  # [rad] (20 deg) off the normal, with vision, alignment may be left out, if
    direct_range: Positive = 0.12  # [m] at least this far out: room for the curve
    direct_std: Positive = 0.010  # [m] and the position is known this well


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingParameters:
    """All parameters of the docking guidance but the policy's."""

    motion: DockingMotionParameters = DockingMotionParameters()  # speeds and accelerations
    clearance: ClearanceParameters = ClearanceParameters()  # distances that keep it off the target
    settling: SettlingParameters = SettlingParameters()  # when enough is known to go on
    corridor: CorridorParameters = CorridorParameters()  # the last part, straight in
    attempts: Annotated[int, Gt(0)] = 3  # runs at the docking face; after that the chaser retreats and holds
    retreat_range: Positive = 0.60  # [m] straight in front of the docking face: there it holds
    timeout: Positive = 300.0  # [s] since the first step; then likewise, unless contact is near


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkovSwitchingParameters:
    """Algorithm 1 of Parikh et al. as printed, and what the paper leaves open (r_t, r_d)."""

    # r_t: by then over half of a usual way is flown; A11 reaches its threshold only below 0.9 m
    activation_range: Positive = 1.0  # [m]
    docked_range: Annotated[float, Ge(0.0)] = 0.02  # [m] r_d
    align_floor: Positive = 0.1  # [m] first r1: the algorithm ends here
    reorient_floor: Positive = 0.3  # [m] first r2: the turn begins here at the latest
    keep_approach_threshold: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.4  # A11 at or below this: reorient
    align_threshold: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.6  # P(align) at or below this: align now
    coarse_std: Positive = 0.02  # [m] sigma_UWB
