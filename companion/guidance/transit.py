"""The way to where the pad should be, by survey, odometry and ranges, until it is seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.checks import CHECKS, Verdict
from companion.guidance.conditions import deviation_floor, is_acquired, is_sighted
from companion.guidance.goals import Goal
from companion.guidance.markov import keep_approaching
from companion.guidance.memory import Context
from companion.guidance.modes import Event
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import SwitchingPolicy
from companion.guidance.view import RelativeState, View
from companion.messages.coarse import CoarseTarget
from companion.messages.decision import Mode, TransitionProbabilities
from companion.messages.motion import MotionState
from companion.planning.energy_path import EnergyPath, PathLimits, minimum_energy_path


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the policy looks at, by the camera where it sees the pad, else by the coarse estimate."""

    lateral: float  # [m] horizontal distance of the pad
    range: float  # [m] distance of the pose when landed
    heading_error: float  # [rad] pad heading minus vehicle heading
    inconsistency: float  # averaged squared innovation per degree of freedom above one, at least 0
    seen: bool


def situation_of(c: Context, view: View, relative: RelativeState | None) -> Situation | None:
    """Give the situation, None where nothing is known of the pad."""
    if relative is not None and is_sighted(c, view.track) and is_acquired(c, view, relative):
        return Situation(
            lateral=relative.lateral,
            range=relative.range,
            heading_error=relative.heading_error,
            inconsistency=relative.inconsistency,
            seen=True,
        )
    coarse = view.coarse
    if coarse is None:
        return None
    offset = coarse.position_ned - view.ownship.position_ned
    lateral = math.hypot(float(offset[0]), float(offset[1]))
    return Situation(
        lateral=lateral,
        range=math.hypot(lateral, float(offset[2]) - view.gear_height),
        heading_error=wrap_angle(coarse.yaw - view.ownship.yaw),
        inconsistency=coarse.inconsistency,
        seen=False,
    )


def why_unusable(c: Context, view: View) -> str | None:
    """Say why the coarse estimate is not to be flown by, or None."""
    coarse, p = view.coarse, c.parameters.transit
    if coarse is None:
        return "nothing is known of where the target is"
    if coarse.by_ranges and view.t - coarse.t_range > p.silence_s + p.coast_s:
        ago = f"for {view.t - coarse.t_range:.1f} s" if math.isfinite(coarse.t_range) else "yet"
        return f"no range fused {ago} (coasting is allowed for {p.coast_s:.1f} s)"
    if coarse.position_std > p.position_std_m:
        return f"target known to {coarse.position_std:.1f} m only (at most {p.position_std_m:.1f} m)"
    if coarse.mahalanobis > p.mahalanobis:
        return f"ranges not consistent: Mahalanobis distance {coarse.mahalanobis:.1f} (at most {p.mahalanobis:.1f})"
    return None


def _is_far(c: Context, view: View) -> bool:
    """Say whether the target, by the coarse estimate, is too far away to be searched for from here."""
    if c.plan.transit is None or view.coarse is None:
        return False
    offset = view.coarse.position_ned - view.ownship.position_ned
    return math.hypot(float(offset[0]), float(offset[1])) > c.parameters.transit.far_m


def check_hold(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    """Look whether to leave a hold; far from the target by the coarse estimate or not at all."""
    verdict = CHECKS[Mode.HOLD](c, view, relative)
    if (verdict is not None and verdict[0] is not Event.HOLD_EXPIRED) or not _is_far(c, view):
        return verdict
    held, unusable, lost = view.t - c.memory.t_entered, why_unusable(c, view), c.plan.lost
    if unusable is None:
        if held < c.parameters.transit.settle_s:
            return None
        return Event.FAR_FROM_TARGET, f"held for {held:.1f} s; on by the estimate without camera"
    if held < lost.hold_s + lost.search_s:
        return None
    return Event.WAY_UNKNOWN, f"{unusable}; held for {held:.0f} s"


def check_transit(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    """Look whether to leave the way there."""
    now = situation_of(c, view, relative)
    if now is None or not now.seen:
        unusable = why_unusable(c, view)
        if now is None or unusable is not None:
            return Event.TARGET_LOST, unusable or ""
        _remember(c, view.coarse)
    reason = _why_deviate(c, now)
    if reason is None:
        return None
    if now.seen:
        return Event.REORIENT_DUE, reason
    return Event.ARRIVED_UNSEEN, f"{reason}, and the target is not seen yet: searching around where it should be"


def _remember(c: Context, coarse: CoarseTarget | None) -> None:
    if coarse is not None:
        c.memory.coarse_std = coarse.position_std
        c.memory.centre_ned, c.memory.centre_velocity = coarse.position_ned, np.zeros(3)


def keep_on(c: Context, now: Situation) -> float | None:
    """Give A11 of Algorithm 1 on the way there, None where it is not asked."""
    p, land = c.parameters, c.plan.land
    markov = land is None or land.policy is SwitchingPolicy.MARKOV
    if not markov or now.range > p.transit.activation_range_m:
        return None
    return keep_approaching(
        range_m=now.range,
        inconsistency=now.inconsistency,
        heading_error=now.heading_error,
        parameters=replace(p.markov, activation_range_m=p.transit.activation_range_m),
    )


def probabilities_on_the_way(c: Context, view: View, relative: RelativeState | None) -> TransitionProbabilities | None:
    """Give the Markov model's numbers on the way there: only A11 is asked; None where it is not."""
    now = situation_of(c, view, relative) if c.memory.mode is Mode.TRANSIT else None
    a11 = None if now is None else keep_on(c, now)
    return None if a11 is None else TransitionProbabilities(a11=a11, a22=math.nan, a32=math.nan, steady_align=math.nan)


def _why_deviate(c: Context, now: Situation) -> str | None:
    a11, threshold = keep_on(c, now), c.parameters.markov.keep_approach_threshold
    if a11 is not None and a11 <= threshold:
        return (
            f"A11 = {a11:.2f} <= {threshold:.2f} at range {now.range:.2f} m, "
            f"heading error {math.degrees(now.heading_error):.0f} deg"
        )
    nearest = deviation_floor(c)
    return f"distance {now.lateral:.2f} m <= {nearest:.2f} m" if now.lateral <= nearest else None


def transit_goal(c: Context, view: View, relative: RelativeState | None, settle: float, dt: float) -> Goal | None:
    """Fly along the way to the pad, as it is known now; None where nothing is known of it.

    The way begins where the transit began and ends above the pad. A pad that turns out to be elsewhere moves the
    reference by the share of the way that lies behind it: nothing jumps, also not when the camera takes over.
    """
    m = c.memory
    now = situation_of(c, view, relative)
    pad = _pad(view, seen=now is not None and now.seen)
    if now is None or pad is None:
        return None
    start = m.way_from
    course = np.array([pad[0] - start[0], pad[1] - start[1]])
    length = max(float(np.hypot(course[0], course[1])), 1e-6)
    course = course / length
    if m.path is None:
        height = float(pad[2]) - float(view.ownship.position_ned[2]) - view.gear_height
        m.path = cheapest_way(c.parameters, length=length, height=height)
    done = float((view.ownship.position_ned[:2] - start[:2]) @ course)
    _move_reference(c, m.path, done=done, length=length, dt=dt)
    way, speed, t = m.way, m.way_speed, view.t
    height, slope = _height(c, m.path, length - way, pad_down=float(pad[2]), gear=view.gear_height, now=now)
    down = float(pad[2]) - view.gear_height - height

    def at(when: float) -> MotionState:
        place = way + speed * (when - t)
        moving = speed if 0.0 < place < length else 0.0
        place = min(max(place, 0.0), length)
        return MotionState(
            position_ned=np.array(
                [start[0] + place * course[0], start[1] + place * course[1], down + slope * (place - way)]
            ),
            velocity_ned=np.array([moving * course[0], moving * course[1], slope * moving]),
            acceleration_ned=np.zeros(3),
            yaw=m.hold_yaw,
            yaw_rate=0.0,
        )

    return Goal(at=at, t_reach=settle, relative=False, direct=False)


def _pad(view: View, *, seen: bool) -> Array | None:
    if seen and view.track is not None:
        return view.track.position_ned
    return None if view.coarse is None else view.coarse.position_ned


def cheapest_way(p: GuidanceParameters, *, length: float, height: float) -> EnergyPath:
    """Give the way of least energy to above a pad, and straight down.

    Args:
        p: speeds, lowest height before the pad, airframe.
        length: horizontal distance of the pad [m].
        height: of the feet above the pad at the beginning [m].
    """
    limits = PathLimits(
        speed=p.transit.speed_mps,
        acceleration=p.transit.acceleration_mps2,
        sink_rate=p.transit.sink_rate_mps,
        final_sink_rate=p.descent.speed_mps,
        height_end=p.descent.align_height_m,
    )
    return minimum_energy_path(length, max(height, p.descent.align_height_m), limits, p.airframe)


def _move_reference(c: Context, path: EnergyPath, *, done: float, length: float, dt: float) -> None:
    """Move the reference along the way, never far ahead of the vehicle, to rest at its end.

    Args:
        c: memory and parameters.
        path: with its speed.
        done: by the vehicle [m].
        length: of the way [m].
        dt: since the last call [s].
    """
    m, p = c.memory, c.parameters.transit
    braking = math.sqrt(2.0 * p.acceleration_mps2 * max(0.0, length - m.way))
    waiting = path.speed * max(0.0, 1.0 + (p.lead_m - (m.way - done)))
    step = p.acceleration_mps2 * dt
    change = min(path.speed, braking, waiting) - m.way_speed
    m.way_speed += max(-2.0 * step, min(step, change))
    m.way = min(length, m.way + m.way_speed * dt)


def _height(
    c: Context, path: EnergyPath, left: float, *, pad_down: float, gear: float, now: Situation
) -> tuple[float, float]:
    """Give the height [m] of the feet above the pad with `left` [m] to go, and how fast it falls per metre of way.

    The path's; but before the pad is seen never lower than the mission allows, and then only as low as keeps it in the
    picture.
    """
    height, slope = path.height(left)
    a, plan = c.parameters.approach, c.plan.transit
    lowest = 0.0 if plan is None else pad_down - (float(c.memory.origin_ned[2]) - plan.height_m) - gear
    if now.seen:
        in_view = c.parameters.descent.align_height_m + a.view_slope * max(0.0, now.lateral - a.view_margin_m)
        lowest = min(lowest, in_view)
    return _above(height, slope, lowest, c.parameters.transit.flare_m)


def _above(height: float, slope: float, lowest: float, flare: float) -> tuple[float, float]:
    """Bend a falling height [m] and its slope smoothly into a lowest one, by a parabola `flare` [m] to both sides."""
    above = height - lowest
    if above >= flare:
        return height, slope
    if above <= -flare:
        return lowest, 0.0
    share = (above + flare) / (2.0 * flare)
    return lowest + flare * share * share, slope * share
