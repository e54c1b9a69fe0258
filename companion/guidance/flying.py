"""Where each mode flies to."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array
from companion.guidance.checks import cone
from companion.guidance.goals import Goal, above_target, along_spiral, sinking, stand_still
from companion.guidance.memory import Context
from companion.guidance.search import spiral_offset
from companion.guidance.view import RelativeState, View, relative_state
from companion.messages.decision import Mode
from companion.messages.target import Prediction, TargetTrack


def goal_of(c: Context, view: View, dt: float) -> Goal | None:
    """Give the goal of the present mode, None where nothing is to be flown.

    Args:
        view: of this step.
        dt: time since the last call [s].
    """
    m, p = c.memory, c.parameters
    if m.mode in (Mode.PREFLIGHT, Mode.DONE, Mode.ABORT):
        return None
    settle = view.t + p.settle_time_s
    if m.mode is Mode.TAKEOFF:
        position = m.origin_ned.copy()
        position[2] -= c.plan.takeoff_height_m
        t_reach = m.t_entered + 1.6 * c.plan.takeoff_height_m / p.takeoff_speed_mps
        return Goal(
            at=stand_still(position, m.origin_yaw),
            t_reach=max(t_reach, settle),
            relative=False,
            direct=False,
        )
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


def _touchdown_goal(c: Context, view: View) -> Goal:
    """Press down with the pad's last known velocity."""
    seen = view.prediction is not None and view.track is not None and view.track.age < 1.0
    contact = view.ownship.position_ned.copy()
    contact[2] = c.memory.hold_position[2]
    at = sinking(
        contact,
        view.prediction.at(view.t).velocity_ned if seen and view.prediction is not None else np.zeros(3),
        t=view.t,
        t_contact=c.memory.t_entered,
        sink_rate=c.parameters.descent.press_speed_mps,
        press=c.parameters.descent.press_mps2,
        yaw=c.memory.contact_yaw,
    )
    return Goal(at=at, t_reach=view.t, relative=False, direct=True)


def _search_goal(c: Context, view: View, settle: float) -> Goal:
    m, s, plan = c.memory, c.parameters.search, c.plan.search
    centre = m.origin_ned if m.centre_ned is None else m.centre_ned
    drift = np.zeros(3) if m.centre_ned is None else m.centre_velocity
    since = view.t - m.search_started
    if m.centre_ned is not None:
        centre = centre + drift * min(since, 5.0)
    pitch = s.swath_fraction * s.footprint_per_height * plan.height_m
    started = m.search_started

    def offset_at(when: float) -> tuple[Array, Array]:
        return spiral_offset(elapsed=when - started, speed=s.speed_mps, pitch=pitch, radius=plan.radius_m)

    at = along_spiral(
        offset_at,
        t=view.t,
        centre_ned=centre,
        drift_ned=np.zeros(3),
        down=float(m.origin_ned[2]) - plan.height_m,
        yaw=m.hold_yaw,
    )
    return Goal(at=at, t_reach=settle, relative=False, direct=False)


def _tracking_goal(
    c: Context, view: View, prediction: Prediction, track: TargetTrack, settle: float, dt: float
) -> Goal:
    m, d = c.memory, c.parameters.descent
    intercept = view.intercept
    gear = view.gear_height
    yaw: float | None
    if m.mode in (Mode.APPROACH, Mode.REORIENT):
        if m.mode is Mode.APPROACH:
            height, yaw = m.approach_height, m.hold_yaw
        else:
            follow = c.plan.follow if not m.followed else None
            height = follow.height_m if follow is not None else d.align_height_m
            yaw = None if follow is None or follow.match_heading else m.hold_yaw
        at = above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=yaw)
        t_reach = max(settle, intercept.t if intercept is not None else settle)
        return Goal(at=at, t_reach=t_reach, relative=True, direct=False)
    if m.mode is Mode.FOLLOW:
        follow = c.plan.follow
        height = follow.height_m if follow is not None else c.plan.search.height_m
        yaw = None if follow is None or follow.match_heading else m.hold_yaw
        at = above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=yaw)
        return Goal(at=at, t_reach=settle, relative=True, direct=False)
    if m.mode is Mode.ALIGN:
        at = above_target(prediction, t=view.t, body_height=d.align_height_m + gear, climb_rate=0.0, yaw=None)
        return Goal(at=at, t_reach=settle, relative=True, direct=False)
    if m.mode is Mode.GO_AROUND:
        height = c.plan.search.height_m * 0.5 + 0.5 * d.align_height_m
        at = above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=m.hold_yaw)
        return Goal(at=at, t_reach=view.t + 1.5, relative=True, direct=False)
    return _descent_goal(c, view, prediction, relative_state(view, track), settle, dt)


def _descent_goal(
    c: Context, view: View, prediction: Prediction, relative: RelativeState, settle: float, dt: float
) -> Goal:
    m = c.memory
    rate = _descent_rate(c, view, relative)
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
    )
    return Goal(at=at, t_reach=settle, relative=True, direct=False)


def _descent_rate(c: Context, view: View, relative: RelativeState) -> float:
    """Give the rate of descent [m/s]: fast while high, none outside the cone, a wait at the gate."""
    m, d = c.memory, c.parameters.descent
    height = m.height_reference
    if height > d.slow_height_m:
        blend = min(1.0, (height - d.slow_height_m) / 0.4)
        speed = d.touchdown_speed_mps + blend * (d.speed_mps - d.touchdown_speed_mps)
    else:
        speed = d.touchdown_speed_mps
    if m.gate_passed:
        return speed
    allowed = cone(c, relative.height)
    margin = min(1.0, max(0.0, (allowed - relative.lateral) / (0.4 * allowed)))
    if height > d.gate_height_m:
        brake = math.sqrt(2.0 * 1.0 * max(height - d.gate_height_m, 0.0)) + 0.02
        return margin * min(speed, brake) if not _gate_open(c, relative) else margin * speed
    if m.gate_since is None:
        m.gate_since = view.t
    waited = view.t - m.gate_since > d.gate_patience_s and relative.lateral < allowed
    if _gate_open(c, relative) or waited:
        m.gate_passed = True
        return speed
    return 0.0


def _gate_open(c: Context, relative: RelativeState) -> bool:
    d = c.parameters.descent
    return (
        relative.lateral < d.gate_lateral_m
        and relative.lateral_speed < d.gate_speed_mps
        and abs(relative.heading_error) < d.gate_heading_rad
    )
