"""What has happened: for each mode, the event that leads out of it and the numbers that decided."""

from __future__ import annotations

import math
from collections.abc import Callable

from companion.guidance.autopilot_landing import by_autopilot, check_autopilot_land, check_precland_asked
from companion.guidance.conditions import (
    cone,
    deviation_floor,
    has_stopped,
    is_acquired,
    is_complete,
    is_looking,
    is_on_pad,
    is_sighted,
    probabilities,
    why_lost,
    without_frames,
)
from companion.guidance.memory import Context
from companion.guidance.modes import CHASING, Event
from companion.guidance.plan import FollowUntil
from companion.guidance.view import RelativeState, View
from companion.messages.decision import Mode
from companion.messages.ownship import FlightMode

Verdict = tuple[Event, str] | None  # the event and a plain sentence with its numbers


def check_always(c: Context, view: View) -> Verdict:
    """Look for what ends a mission from any mode."""
    m = c.memory
    asked = check_precland_asked(c, view)
    if asked is not None:
        return asked
    if m.mode not in (Mode.PREFLIGHT, Mode.AUTOPILOT_LAND) and view.taken_over:
        if view.status.mode is FlightMode.OFFBOARD:
            return Event.TAKEN_OVER, f"the guardian gave up the vehicle: {view.guardian_reason}"
        return Event.TAKEN_OVER, f"the vehicle is flown by somebody else: mode {view.status.mode.value}"
    if m.mode not in (Mode.PREFLIGHT, Mode.TOUCHDOWN) and view.commanding and not view.status.armed:
        if m.mode is Mode.GO_AROUND and is_on_pad(c, view):
            return Event.LANDED, "the autopilot has disarmed on the pad, just as another attempt began"
        return Event.DISARMED, "the autopilot disarmed in flight"
    return _check_fence(c, view)


def _check_fence(c: Context, view: View) -> Verdict:
    """Look whether the target has led to the fence, and stays beyond it."""
    m = c.memory
    m.fence_since, verdict = watch_fence(
        view, m.fence_since, chasing=m.mode in CHASING, patience_s=c.parameters.fence_patience_s
    )
    return verdict


def watch_fence(view: View, since: float | None, *, chasing: bool, patience_s: float) -> tuple[float | None, Verdict]:
    """Look how long the fence has been in the way of a vehicle that goes where its target leads.

    Args:
        view: of this step.
        since: [s] when that began, None: it has not.
        chasing: the mode follows the target.
        patience_s: after which it is enough.

    Returns:
        When it began, and the verdict.
    """
    if not view.at_fence or not chasing:
        return None, None
    since = view.t if since is None else since
    waited = view.t - since
    if waited < patience_s:
        return since, None
    return since, (Event.BEYOND_FENCE, f"the target leads out of the fence; waited inside for {waited:.0f} s")


def _dwelt(c: Context, condition: bool, t: float, duration: float) -> bool:
    m = c.memory
    if not condition:
        m.dwell_since = None
        return False
    if m.dwell_since is None:
        m.dwell_since = t
    return t - m.dwell_since >= duration


def _check_preflight(c: Context, view: View, _relative: RelativeState | None) -> Verdict:
    if view.commanding and view.status.armed and view.flying:
        if c.plan.transit is not None and view.coarse is not None:
            return Event.TRANSIT_DUE, "engaged in flight: on to where the target was surveyed"
        return Event.RESUMED, "engaged in flight: searching from here"
    if view.commanding and view.status.armed:
        return Event.ENGAGED, f"armed and in {view.status.mode.value}"
    return None


def _check_takeoff(c: Context, view: View, _relative: RelativeState | None) -> Verdict:
    height = float(c.memory.origin_ned[2] - view.ownship.position_ned[2])
    if height > c.plan.takeoff_height_m - c.parameters.takeoff.tolerance_m:
        event = Event.HEIGHT_REACHED if c.plan.transit is None else Event.TRANSIT_DUE
        return event, f"height {height:.1f} m of {c.plan.takeoff_height_m:.1f} m"
    return None


def _check_search(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    m = c.memory
    if relative is not None and view.track is not None and is_acquired(c, view, relative):
        if c.plan.land is None and c.plan.follow is None:
            return Event.STEP_COMPLETE, f"target found at {relative.range:.1f} m"
        return (
            Event.TARGET_ACQUIRED,
            f"target seen {view.track.fused} times, {relative.range:.1f} m away, known to "
            f"{relative.position_std:.2f} m",
        )
    silent = without_frames(c.parameters.acquisition, view)
    if silent is not None:
        return Event.CAMERA_SILENT, f"{silent}: searching would be pointless"
    if view.t - m.search_started > m.search_budget:
        return Event.SEARCH_EXPIRED, f"target not found in {m.search_budget:.0f} s"
    return None


def _check_approach(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    lost = why_lost(c, view, relative)
    if lost is not None or relative is None:
        return Event.TARGET_LOST, lost or ""
    if is_looking(c, view, relative):
        return None
    p, numbers = c.parameters.markov, probabilities(c, relative)
    if numbers is not None and numbers.a11 <= p.keep_approach_threshold:
        return (
            Event.REORIENT_DUE,
            f"A11 = {numbers.a11:.2f} <= {p.keep_approach_threshold:.2f} at range {relative.range:.2f} m, "
            f"heading error {math.degrees(relative.heading_error):.0f} deg",
        )
    nearest = deviation_floor(c)
    if relative.lateral <= nearest:
        return Event.REORIENT_DUE, f"distance {relative.lateral:.2f} m <= {nearest:.2f} m"
    return None


def _check_reorient(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    lost = why_lost(c, view, relative)
    if lost is not None or relative is None:
        return Event.TARGET_LOST, lost or ""
    p, d, follow = c.parameters.markov, c.parameters.descent, c.plan.follow
    if follow is not None and not c.memory.followed:
        near = relative.lateral < c.parameters.follow.capture_lateral_m
        if near and abs(relative.height - follow.height_m) < 0.5:
            return Event.STATION_REACHED, f"{relative.lateral:.2f} m from the point above the target"
        return None
    if c.plan.land is None:
        return None
    numbers = probabilities(c, relative)
    at_point = relative.lateral < 0.5 and relative.height < d.align_height_m + 0.35
    confident = numbers is not None and numbers.steady_align > p.align_threshold and not by_autopilot(c)
    if at_point and confident and numbers is not None and is_sighted(c, view.track):
        inside = relative.lateral < 0.6 * cone(c, relative.height)
        if inside and relative.lateral_speed < d.align_speed_mps and abs(relative.heading_error) < 0.15:
            return (
                Event.CONFIDENT,
                f"P(align) = {numbers.steady_align:.2f} > {p.align_threshold:.2f}, {relative.lateral:.2f} m off "
                f"at height {relative.height:.2f} m: no separate alignment needed",
            )
    if at_point and relative.range <= max(p.align_floor_m, d.align_height_m + 0.1):
        return Event.ALIGN_DUE, f"range {relative.range:.2f} m: alignment point reached"
    if numbers is not None and numbers.steady_align <= p.align_threshold:
        return Event.ALIGN_DUE, f"P(align) = {numbers.steady_align:.2f} <= {p.align_threshold:.2f}"
    waited = view.t - c.memory.t_entered
    if waited > c.parameters.reorient_patience_s:
        return Event.NO_PROGRESS, f"after {waited:.0f} s still {relative.lateral:.2f} m beside the target"
    return None


def _check_follow(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    lost = why_lost(c, view, relative)
    if lost is not None or relative is None or view.track is None:
        return Event.TARGET_LOST, lost or ""
    m, follow = c.memory, c.plan.follow
    if follow is None:
        return Event.FOLLOW_COMPLETE, "nothing to follow"
    elapsed = view.t - m.follow_started
    done = Event.FOLLOW_COMPLETE if c.plan.land is not None else Event.STEP_COMPLETE
    if follow.until is FollowUntil.TIME:
        return (done, f"followed for {elapsed:.0f} s") if elapsed >= follow.for_s else None
    if elapsed >= follow.at_most_s:
        return done, f"followed for {elapsed:.0f} s, the longest allowed"
    stopped = has_stopped(c, view, view.track)
    if stopped and elapsed >= follow.for_s:
        return done, f"target stopped, after {elapsed:.0f} s"
    return None


def _check_align(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    lost = why_lost(c, view, relative)
    if lost is not None or relative is None:
        return Event.TARGET_LOST, lost or ""
    d = c.parameters.descent
    patient = view.t - c.memory.t_entered < d.gate_patience_s
    lateral = d.align_lateral_m if patient else 0.6 * cone(c, relative.height)
    settled = (
        is_sighted(c, view.track)
        and relative.lateral < lateral
        and (not patient or relative.lateral_speed < d.align_speed_mps)
        and abs(relative.heading_error) < (d.align_heading_rad if patient else 0.2)
        and abs(relative.height - d.align_height_m) < 0.3
    )
    dwelt = _dwelt(c, settled, view.t, d.align_dwell_s)
    event = Event.SETTLED
    if by_autopilot(c) and view.track is not None:  # it aims for where the pad was seen last: only a pad at rest
        event = Event.HAND_OVER
        dwelt = has_stopped(c, view, view.track) and dwelt
        waited = view.t - c.memory.t_entered
        if waited > c.parameters.hold_timeout_s:
            return Event.TARGET_MOVES, f"not settled above a pad at rest in {waited:.0f} s: the autopilot cannot land"
    if dwelt:
        return (
            event,
            f"{relative.lateral:.2f} m and {math.degrees(relative.heading_error):.1f} deg off at height "
            f"{relative.height:.2f} m for {d.align_dwell_s:.1f} s",
        )
    return None


def _check_land(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    m, d = c.memory, c.parameters.descent
    committed = m.height_reference < d.commit_height_m
    lost = why_lost(c, view, relative, descending=True)
    if relative is None or view.prediction is None:
        return Event.TARGET_LOST, lost or "no track of the target"
    if lost is not None and not committed:
        return Event.TARGET_LOST, lost
    allowed = cone(c, relative.height)
    bound = d.commit_lateral_m if committed else d.cone_abort_factor * allowed
    if relative.lateral > bound:
        return (
            Event.OUTSIDE_CONE,
            f"{relative.lateral:.2f} m off at height {relative.height:.2f} m (at most {bound:.2f} m)",
        )
    if view.t - m.t_progress > d.stall_s:
        return Event.OUTSIDE_CONE, f"no progress in the descent for {d.stall_s:.0f} s"
    near = d.contact_height_m if m.gate_passed else d.surprise_height_m
    touching = relative.height <= near or m.height_reference < -0.15
    if touching:
        return Event.CONTACT, f"feet {relative.height:.2f} m above the pad, {relative.lateral:.3f} m off"
    return None


def _check_touchdown(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    m, d = c.memory, c.parameters.descent
    if view.landed:
        return Event.LANDED, "the autopilot says landed and has disarmed"
    if relative is not None and view.track is not None and view.track.age < 0.2 and relative.height > 0.35:
        return Event.OUTSIDE_CONE, f"{relative.height:.2f} m above the pad after contact"
    patience = d.standing_timeout_s if is_on_pad(c, view) else d.contact_timeout_s
    if view.t - m.t_entered > patience:
        return Event.OUTSIDE_CONE, f"no landing detected in {patience:.0f} s after contact"
    return None


def _check_hold(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    m, lost = c.memory, c.plan.lost
    elapsed = view.t - m.t_entered
    if is_complete(c):
        return (Event.STEP_COMPLETE, f"held for {elapsed:.0f} s") if elapsed >= c.plan.hold_s else None
    if relative is not None and view.track is not None and is_acquired(c, view, relative):
        return Event.TARGET_ACQUIRED, f"target seen again, {relative.range:.1f} m away"
    silent = without_frames(c.parameters.acquisition, view)
    looked_s = m.looked.add(view.t, since=m.t_entered, pictures=silent is None)
    if silent is not None:
        if elapsed >= lost.no_camera_s:
            return Event.CAMERA_EXPIRED, f"{silent}; held for {elapsed:.0f} s"
        return None
    if looked_s >= lost.hold_s:
        return Event.HOLD_EXPIRED, f"target not seen while holding for {elapsed:.0f} s"
    return None


def _check_go_around(c: Context, view: View, relative: RelativeState | None) -> Verdict:
    m, land = c.memory, c.plan.land
    lost = why_lost(c, view, relative)
    climbed = view.t - m.t_entered > 1.0 and (
        relative is not None and relative.height > c.parameters.descent.align_height_m
    )
    if (climbed or lost is not None) and land is not None and m.attempts >= land.max_attempts:
        return Event.ATTEMPTS_USED, f"{m.attempts} attempts, none succeeded"
    if climbed and lost is None and relative is not None:
        return Event.CLIMBED, f"height {relative.height:.2f} m above the pad"
    if lost is not None and view.t - m.t_entered > 3.0:
        return Event.TARGET_LOST, lost
    return None


CHECKS: dict[Mode, Callable[[Context, View, RelativeState | None], Verdict]] = {
    Mode.PREFLIGHT: _check_preflight,
    Mode.TAKEOFF: _check_takeoff,
    Mode.SEARCH: _check_search,
    Mode.APPROACH: _check_approach,
    Mode.REORIENT: _check_reorient,
    Mode.FOLLOW: _check_follow,
    Mode.ALIGN: _check_align,
    Mode.LAND: _check_land,
    Mode.TOUCHDOWN: _check_touchdown,
    Mode.AUTOPILOT_LAND: check_autopilot_land,
    Mode.HOLD: _check_hold,
    Mode.GO_AROUND: _check_go_around,
}
