"""Parameters of the guidance."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Gt, Interval

from companion.guidance.lookout import LookoutParameters
from companion.planning.energy_path import AirframeEnergy

Positive = Annotated[float, Gt(0.0)]
Fraction = Annotated[float, Interval(ge=0.0, le=1.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkovParameters:
    """Thresholds and scales of the transition probabilities (Parikh et al., Algorithm 1)."""

    activation_range_m: Positive = 6.0  # r_t: the model is asked only nearer than this
    reorient_floor_m: Positive = 1.5  # least r2, horizontally: reorient at the latest here
    align_floor_m: Positive = 1.4  # least r1: align at the latest here
    touchdown_range_m: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0  # r_d
    keep_approach_threshold: Fraction = 0.4  # A11 at or below this: reorient
    align_threshold: Fraction = 0.6  # steady-state probability of "align" at or below this: align now
    coarse_position_std_m: Positive = 0.25  # stands for sigma_UWB: position error without vision


@dataclass(frozen=True, slots=True, kw_only=True)
class AcquisitionParameters:
    """When a track may be trusted, and when it is lost."""

    measurements: Annotated[int, Gt(0)] = 5  # fused before the track is used
    position_std_m: Positive = 1.0  # largest standard deviation of the position that counts as a track
    descent_position_std_m: Positive = 0.12  # likewise while descending
    coasting_s: Positive = 0.3  # a target not seen for longer is out of sight: nothing is settled by the forecast
    camera_silence_s: Positive = 0.5  # no frames for longer: the camera is dead
    nis_mean: Positive = 6.0  # averaged NIS per degree of freedom above which the estimate is not consistent


@dataclass(frozen=True, slots=True, kw_only=True)
class DescentParameters:
    """The cone above the landing point and the way down in it. Heights are those of the feet above the pad."""

    align_height_m: Positive = 1.2
    align_lateral_m: Positive = 0.10  # settled: lateral error below this,
    align_speed_mps: Positive = 0.25  # relative speed below this,
    align_heading_rad: Positive = 0.06  # heading error below this,
    align_dwell_s: Positive = 0.6  # for this long
    cone_half_angle_rad: Annotated[float, Interval(gt=0.0, lt=1.2)] = 0.21  # allowed lateral error grows by its tangent
    cone_floor_m: Positive = 0.035  # allowed lateral error at touchdown
    cone_abort_factor: Annotated[float, Gt(1.0)] = 3.0  # outside this many times the allowed error: go around
    speed_mps: Positive = 0.5  # descent while high
    touchdown_speed_mps: Annotated[float, Interval(ge=0.28, le=0.7)] = 0.4  # PX4 detects landing from 0.275 m/s
    press_speed_mps: Annotated[float, Interval(ge=0.28, le=1.0)] = (
        0.6  # commanded on the pad, until landing is detected
    )
    press_mps2: Annotated[float, Interval(ge=0.0, le=4.0)] = 2.0  # on top of it: takes the thrust away at once
    # set down, a leaning vehicle tips upright, which moves it by this many gear heights times the sine of its lean,
    tip_factor: Annotated[float, Interval(ge=0.0, le=3.0)] = 1.35
    # and turns it by this much of lean times speed across it
    tip_turn_s_per_m: Annotated[float, Interval(ge=0.0, le=10.0)] = 3.0
    rate_change_mps2: Positive = 1.5  # the descent quickens by no more than this
    slow_height_m: Positive = 0.5  # from here on down to the gate:
    slow_speed_mps: Positive = 0.3
    gate_braking_mps2: Positive = 0.35  # so gently that the vehicle does not sink through
    gate_height_m: Positive = 0.05  # wait here until the errors, now and at contact, are below
    gate_lateral_m: Positive = 0.015
    gate_heading_rad: Positive = 0.005
    gate_patience_s: Positive = 25.0  # in this time what is good enough widens to
    gate_lateral_last_m: Positive = 0.06
    gate_heading_last_rad: Positive = 0.02
    commit_height_m: Positive = 0.05  # below: no go-around unless the error exceeds the commit bound
    commit_lateral_m: Positive = 0.25
    contact_height_m: float = 0.10  # past the gate the feet are taken to touch at this height or below,
    surprise_height_m: float = 0.015  # before it at this
    contact_timeout_s: Positive = 20.0  # no landing detected this long after contact: go around,
    standing_timeout_s: Positive = 60.0  # this long where the vehicle is seen to stand on the pad
    stall_s: Positive = 60.0  # a descent that makes no progress for this long goes around


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowParameters:
    """Keeping station, and when a target counts as stopped."""

    capture_lateral_m: Positive = 0.6  # nearer than this: keeping station
    stopped_speed_mps: Positive = 0.30  # apparent speed (drifting odometry adds some)
    stopped_turn_radps: Positive = 0.10
    stopped_dwell_s: Positive = 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchParameters:
    """The spiral flown where the target is expected."""

    speed_mps: Positive = 1.0
    swath_fraction: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.55  # distance of the turns per camera footprint
    footprint_per_height: Positive = 1.0  # width seen per metre of height


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachParameters:
    """The flight towards the target: gentle, because a tilted vehicle looks elsewhere."""

    acceleration_mps2: Positive = 1.0  # horizontal
    jerk_mps3: Positive = 3.0
    speed_mps: Positive = 2.0
    look_s: Annotated[float, Interval(ge=0.0, le=10.0)] = 1.5  # come to rest first, and look at the target,
    look_slope: Positive = (
        2.5  # from where it is no farther aside than the height by this: seen by a leaning vehicle too
    )
    look_near_m: Positive = 0.3  # while it is so much farther aside, the look goes on,
    look_most_s: Annotated[float, Interval(ge=0.0, le=30.0)] = 5.0  # but no longer than this
    view_slope: Positive = 2.0  # the height falls by no more than this per metre that the vehicle comes nearer,
    view_margin_m: Positive = 0.3  # down to this horizontal distance,
    view_sigmas: Annotated[float, Interval(ge=0.0, le=3.0)] = (
        1.0  # out of sight with so many standard deviations of it on top
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeoffParameters:
    """The climb."""

    speed_mps: Positive = 1.0
    rate_change_mps2: Positive = 1.0  # the climb quickens, and slows towards its end, by no more than this
    lead_m: Positive = 0.8  # the reference is never farther above the vehicle, and slows in proportion on the way there
    tolerance_m: Positive = 0.5  # below the wanted height, at which the climb counts as done


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundParameters:
    """When a vehicle on the ground is at its place behind a target, and when the target stands."""

    look_s: Annotated[float, Interval(ge=0.0, le=10.0)] = 1.5  # stand and look, before it sets off
    line_up_m: Positive = 0.3  # farther aside than this, or
    line_up_rad: Positive = 0.3  # turned farther away, it lines up behind its place first: so far behind
    lead_in: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.5  # per metre aside
    lead_in_per_rad_m: Annotated[float, Interval(ge=0.0, le=5.0)] = 1.0
    lead_in_most_m: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.6
    blind_s: Positive = 0.35  # a target that is not seen for so long
    blind_ahead_rad: Positive = 0.3  # though it should be no farther aside than this, or the vehicle is
    blind_still_mps: Positive = 0.1  # told to drive no faster than this and so turns to nothing,
    blind_most_s: Positive = 0.8  # or has been out of sight for so long already and may stand where it was seen last,
    blind_near_m: Positive = 1.0  # and no farther off than this and the standoff, is backed out from,
    retreat_m: Positive = 1.0  # to this behind its place
    # [m/s] slower when it was seen last, it may stand, whichever way it seemed to drive: odometry drifts as much
    slow_unseen_mps: Positive = 0.3
    capture_m: Positive = 0.5  # nearer to its place than this: keeping station
    arrived_m: Positive = 0.025  # at its place, when no farther off than this
    arrived_rad: Positive = 0.02  # and turned no farther off; after
    strict_s: Annotated[float, Interval(ge=0.0, le=300.0)] = 30.0  # of trying, what is good enough widens,
    patience_s: Positive = 30.0  # in this time, to
    arrived_last_m: Positive = 0.20
    arrived_last_rad: Positive = 0.15
    slow_mps: Positive = 0.15  # apparent speed of the target (drifting odometry adds some), and
    still_mps: Positive = 0.10  # speed relative to it, below which both seem to stand,
    arrived_dwell_s: Positive = 0.3  # for this long: then a rover stops
    rest_s: Positive = 0.8  # in which it comes to rest
    rolled_m: Positive = 0.02  # no farther from its place than was near enough, else it tries again;
    settle_s: Positive = 2.0  # then the target must not move in its view for this long:
    moved_m: Positive = 0.06
    moved_rad: Positive = 0.06
    lookout: LookoutParameters = field(default_factory=LookoutParameters)  # for a target that is lost


@dataclass(frozen=True, slots=True, kw_only=True)
class TransitParameters:
    """The way to where the pad should be, before it is seen."""

    activation_range_m: Positive = 15.0  # r_t of Algorithm 1 on the way: at 6 m, as above the pad, it would be over
    speed_mps: Positive = 2.5  # along the way at most; what takes the least energy is faster still
    sink_rate_mps: Positive = 0.8  # on the way, at most; a tenth of the induced velocity: far from the vortex ring
    flare_m: Positive = 0.8  # above the lowest height the descent begins to end: with at most 0.4 m/s^2
    acceleration_mps2: Positive = 0.6  # along the way: the vehicle tilts by less than 4 degrees, its camera looks down
    lead_m: Positive = 1.0  # that the reference is ahead of the vehicle at most
    silence_s: Positive = 0.5  # without a fused range for longer: coasting on odometry,
    coast_s: Positive = 5.0  # for this long, then hold: the autopilot's velocity alone is wrong by 0.1 to 0.3 m/s
    position_std_m: Positive = 3.0  # a pad known no better than this is not flown to: it could stand beside the search
    mahalanobis: Positive = 3.0  # root mean square per degree of freedom above which the estimate is not consistent
    far_m: Positive = 6.0  # lost farther away than this: back to the way there instead of a search
    settle_s: Positive = 1.5  # held at least so long before


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceParameters:
    """All parameters of the guidance."""

    takeoff: TakeoffParameters = TakeoffParameters()
    transit: TransitParameters = TransitParameters()
    airframe: AirframeEnergy = field(default_factory=AirframeEnergy)  # what the way there costs
    markov: MarkovParameters = MarkovParameters()
    acquisition: AcquisitionParameters = AcquisitionParameters()
    approach: ApproachParameters = ApproachParameters()
    descent: DescentParameters = DescentParameters()
    follow: FollowParameters = FollowParameters()
    search: SearchParameters = SearchParameters()
    ground: GroundParameters = GroundParameters()
    settle_time_s: Positive = 0.8  # least duration of a plan to a goal that moves with the target
    fence_patience_s: Positive = 5.0  # a target that stays beyond the fence so long ends the mission
    reorient_patience_s: Positive = 60.0  # the point above the target not reached in this time: an attempt that failed
    hold_timeout_s: Positive = 60.0  # above a pad that does not rest, which the autopilot is to land on: give up
