"""Where each mode flies to."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array
from companion.guidance.conditions import aside_in_view, cone, is_looking, is_sighted
from companion.guidance.goals import Goal, above_target, along_spiral, climbing, in_view_of, sinking, stand_still
from companion.guidance.memory import Context
from companion.guidance.search import spiral_offset
from companion.guidance.transit import transit_goal
from companion.guidance.view import RelativeState, View, relative_state, tip_offset
from companion.messages.decision import Mode
from companion.messages.target import Prediction, TargetTrack

_GENTLE_MODES = frozenset({Mode.APPROACH, Mode.REORIENT})
_DRIFT_S = 5.0  # [s] the place that is searched moves on as the target did
_AT_CENTRE = 0.25  # of the distance between turns: so near to that place the spiral begins,
_WAY_S, _WAY_FACTOR = 5.0, 2.0  # or when the way there takes longer than this [s] and this many times what it should


def goal_of(c: Context, view: View, dt: float) -> Goal | None:
    """Give the goal of the present mode, None where nothing is to be flown.

    Args:
        view: of this step.
        dt: time since the last call [s].
    """
    m, p = c.memory, c.parameters
    if m.mode in (Mode.PREFLIGHT, Mode.AUTOPILOT_LAND, Mode.DONE, Mode.ABORT):
        return None
    settle = view.t + p.settle_time_s
    if m.mode is Mode.TAKEOFF:
        return _climb_goal(c, view, settle, dt)
    if m.mode is Mode.TRANSIT:
        relative = None if view.track is None else relative_state(view, view.track, p.descent)
        return transit_goal(c, view, relative, settle, dt)
    if m.mode is Mode.SEARCH:
        return _search_goal(c, view, settle)
    if m.mode is Mode.TOUCHDOWN:
        return _touchdown_goal(c, view)
    if m.mode is Mode.HOLD or view.prediction is None or view.track is None:
        position = m.hold_position.copy()
        if m.mode is Mode.GO_AROUND:  # without a forecast: straight up
            position[2] -= p.descent.align_height_m
        return Goal(at=stand_still(position, m.hold_yaw), t_reach=settle, relative=False, direct=False)
    return _tracking_goal(c, view, view.prediction, view.track, settle, dt)


def _climb_goal(c: Context, view: View, settle: float, dt: float) -> Goal:
    """Climb straight up, never far ahead of the vehicle.

    The autopilot keeps it on the ground for seconds after arming: the rotors spool up, then the thrust is ramped up. A
    reference that climbed meanwhile would have to be caught up with, faster than the climb was meant to be.
    """
    m, p, top = c.memory, c.parameters.takeoff, c.plan.takeoff_height_m
    most = float(m.origin_ned[2] - view.ownship.position_ned[2]) + p.lead_m
    stopping = math.sqrt(2.0 * p.rate_change_mps2 * max(0.0, top - m.climb_height))
    waiting = max(0.0, (most - m.climb_height) / p.lead_m) * p.speed_mps
    m.climb_rate = min(p.speed_mps, stopping, waiting, m.climb_rate + p.rate_change_mps2 * dt)
    m.climb_height = min(top, most, m.climb_height + m.climb_rate * dt)
    at = climbing(
        m.origin_ned, t=view.t, height=m.climb_height, climb_rate=m.climb_rate, height_end=top, yaw=m.origin_yaw
    )
    return Goal(at=at, t_reach=settle, relative=False, direct=False)


def _touchdown_goal(c: Context, view: View) -> Goal:
    """Press down with the pad's last known velocity."""
    seen = view.prediction is not None and view.track is not None and view.track.age < 1.0
    contact = view.ownship.position_ned.copy()
    contact[2] = c.memory.hold_position[2]
    d = c.parameters.descent
    at = sinking(
        contact,
        view.prediction.at(view.t).velocity_ned if seen and view.prediction is not None else np.zeros(3),
        t=view.t,
        t_contact=c.memory.t_entered,
        sink_rate=d.press_speed_mps,
        press=d.press_mps2,
        yaw=view.ownship.yaw,
    )
    return Goal(at=at, t_reach=view.t, relative=False, direct=True)


def _search_goal(c: Context, view: View, settle: float) -> Goal:
    """Fly to the place where the target is expected, and from there the spiral.

    The spiral is not begun from afar: it is as fast as the vehicle may be, which would fly it beside that place.
    """
    m, s, plan = c.memory, c.parameters.search, c.plan.search
    centre = m.origin_ned if m.centre_ned is None else m.centre_ned
    since = view.t - m.centred_at
    if m.centre_ned is not None:
        centre = centre + m.centre_velocity * min(since, _DRIFT_S)
    down = float(m.origin_ned[2]) - plan.height_m
    pitch = s.swath_fraction * s.footprint_per_height * plan.height_m
    if m.spiral_started is None:
        north, east = (centre - view.ownship.position_ned)[:2].tolist()
        aside = math.hypot(north, east)
        if aside > _AT_CENTRE * pitch and since < _WAY_S + _WAY_FACTOR * aside / s.speed_mps:
            place = np.array([centre[0], centre[1], down])
            return Goal(at=stand_still(place, m.hold_yaw), t_reach=settle, relative=False, direct=False)
        m.spiral_started = view.t
    started = m.spiral_started

    def offset_at(when: float) -> tuple[Array, Array]:
        return spiral_offset(elapsed=when - started, speed=s.speed_mps, pitch=pitch, radius=plan.radius_m)

    at = along_spiral(
        offset_at,
        t=view.t,
        centre_ned=centre,
        drift_ned=np.zeros(3),
        down=down,
        yaw=m.hold_yaw,
    )
    return Goal(at=at, t_reach=settle, relative=False, direct=False)


def _look_goal(c: Context, track: TargetTrack, relative: RelativeState, settle: float) -> Goal:
    """Come to rest where the target is in the picture: from the swing of the search it would be lost again.

    A leaning camera sees what it does not see upright: at rest where the target came into view, it may be out of sight.
    """
    m = c.memory
    m.rest_position = in_view_of(track.position_ned, m.rest_position, aside_in_view(c, relative))
    return Goal(at=stand_still(m.rest_position, m.hold_yaw), t_reach=settle, relative=False, direct=False, gentle=True)


def _tracking_goal(
    c: Context, view: View, prediction: Prediction, track: TargetTrack, settle: float, dt: float
) -> Goal:
    """Stay above the target, at the mode's height and heading."""
    m = c.memory
    relative = relative_state(view, track, c.parameters.descent)
    if m.mode is Mode.LAND:
        return _descent_goal(c, view, prediction, relative, settle, dt)
    if m.mode is Mode.APPROACH and is_looking(c, view, relative):
        return _look_goal(c, track, relative, settle)
    t_reach = settle
    if m.mode in (Mode.APPROACH, Mode.REORIENT) and view.intercept is not None:
        t_reach = max(settle, view.intercept.t)
    if m.mode is Mode.GO_AROUND:
        t_reach = view.t + 1.5
    height = _height_in_view(c, _mode_height(c), relative, seen=is_sighted(c, track))
    at = above_target(prediction, t=view.t, body_height=height + view.gear_height, climb_rate=0.0, yaw=_mode_yaw(c))
    gentle, calm = m.mode in _GENTLE_MODES, m.mode is Mode.FOLLOW
    return Goal(at=at, t_reach=t_reach, relative=True, direct=False, gentle=gentle, calm=calm)


def _mode_height(c: Context) -> float:
    """Give the height [m] of the feet above the pad that the mode wants."""
    m, d = c.memory, c.parameters.descent
    following = c.plan.follow is not None and not m.followed
    if m.mode is Mode.APPROACH:
        return m.approach_height
    if m.mode is Mode.GO_AROUND:
        return 0.5 * (c.plan.search.height_m + d.align_height_m)
    if c.plan.follow is not None and following:
        return c.plan.follow.height_m
    return d.align_height_m


def _mode_yaw(c: Context) -> float | None:
    """Give the heading [rad] to keep, None for the pad's."""
    m, follow = c.memory, c.plan.follow
    if m.mode in (Mode.APPROACH, Mode.GO_AROUND):
        return m.hold_yaw
    free = follow is not None and not m.followed and not follow.match_heading
    return m.hold_yaw if free else None


def _height_in_view(c: Context, wanted: float, relative: RelativeState, *, seen: bool) -> float:
    """Stay high while the pad is, or may be, far to the side, so that it stays in, or comes into, the picture.

    Following out of sight, the forecast's deviation counts, and grows: it climbs, to where it searches at most.
    Heights [m] of the feet above the pad.
    """
    a = c.parameters.approach
    aside, highest = relative.lateral, c.memory.approach_height
    if c.memory.mode is Mode.FOLLOW and not seen:
        aside, highest = aside + a.view_sigmas * relative.position_std, c.plan.search.height_m
    slant = wanted + a.view_slope * max(0.0, aside - a.view_margin_m)
    return min(slant, max(wanted, highest))


def _descent_goal(
    c: Context, view: View, prediction: Prediction, relative: RelativeState, settle: float, dt: float
) -> Goal:
    m = c.memory
    change = _descent_rate(c, view, relative) - m.descent_rate
    step = c.parameters.descent.rate_change_mps2 * dt
    rate = m.descent_rate = m.descent_rate + max(-2.0 * step, min(step, change))
    m.height_reference -= rate * dt
    # the reference never runs far ahead of the vehicle: it would be flown as a dive once the vehicle is free
    m.height_reference = max(m.height_reference, relative.height - 0.3)
    if relative.height < m.lowest - 0.02:
        m.lowest, m.t_progress = relative.height, view.t
    at = above_target(
        prediction,
        t=view.t,
        body_height=m.height_reference + view.gear_height,
        climb_rate=-rate,
        yaw=None,
        aside=tip_offset(view, c.parameters.descent),
    )
    return Goal(at=at, t_reach=settle, relative=True, direct=False)


def _descent_rate(c: Context, view: View, relative: RelativeState) -> float:
    """Give the wanted rate of descent [m/s]: none outside the cone, slower below, a wait at the gate."""
    m, d = c.memory, c.parameters.descent
    if m.gate_passed:
        return d.touchdown_speed_mps
    height = m.height_reference
    blend = min(1.0, max(0.0, (height - d.slow_height_m) / 0.4))
    speed = d.slow_speed_mps + blend * (d.speed_mps - d.slow_speed_mps)
    allowed = cone(c, relative.height)
    margin = min(1.0, max(0.0, (allowed - relative.lateral) / (0.4 * allowed)))
    above_gate = height - d.gate_height_m
    if above_gate > 0.02:
        return margin * min(speed, math.sqrt(2.0 * d.gate_braking_mps2 * above_gate))
    if m.gate_since is None:
        m.gate_since = view.t
    if _gate_open(c, relative, view.t - m.gate_since, seen=is_sighted(c, view.track)):
        m.gate_passed = True
        return d.touchdown_speed_mps
    return 0.0


def _gate_open(c: Context, relative: RelativeState, waited: float, *, seen: bool) -> bool:
    """Say whether it is a good moment for the last step down; what is good enough widens while waiting.

    So low a leaning camera may not see the pad any more, and the forecast gets worse: then it is now or never, and the
    heading matters no more.
    """
    d = c.parameters.descent
    if not seen:
        return max(relative.standing, relative.standing_soon) < d.gate_lateral_last_m
    patience = min(1.0, waited / d.gate_patience_s)

    def bound(first: float, last: float) -> float:
        return first + patience * (last - first)

    lateral = bound(d.gate_lateral_m, d.gate_lateral_last_m)
    return (
        relative.standing < lateral
        and relative.standing_soon < lateral
        and abs(relative.standing_turn) < bound(d.gate_heading_rad, d.gate_heading_last_rad)
    )
