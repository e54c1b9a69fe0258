"""For each mode of a docking: the event that leads out of it, with a plain sentence that has the numbers."""

from __future__ import annotations

import math

from companion.guidance.docking.goal_point import minus, norm
from companion.guidance.docking.modes import DockingEvent
from companion.guidance.docking.parameters import CorridorParameters, DockingParameters, SettlingParameters
from companion.guidance.docking.port import Port
from companion.guidance.docking.view import DockingMemory, DockingView
from companion.messages.docking import DockingMode

Event = tuple[DockingEvent, str] | None
_AT_POINT = 0.005  # [m] the goal has reached a point


def check_timeout(m: DockingMemory, view: DockingView, p: DockingParameters) -> Event:
    """Look whether the time is used up; a chaser about to touch is not called back."""
    took = view.t - m.t_start
    if m.given_up or took <= p.timeout:
        return None
    if m.mode is DockingMode.DOCK and view.out <= p.corridor.straight:
        return None
    return DockingEvent.GIVEN_UP, f"not docked after {took:.0f} s > {p.timeout:.0f} s"


def check_wait(m: DockingMemory, view: DockingView, p: SettlingParameters) -> Event:
    """Look whether the position is known well enough to set off."""
    waited = view.t - m.t_start
    if view.position_std <= p.start_std and not view.silent:
        return (
            DockingEvent.POSITION_KNOWN,
            f"position known to {1000.0 * view.position_std:.0f} mm <= {1000.0 * p.start_std:.0f} mm",
        )
    if waited >= p.start_patience and not view.silent:
        return DockingEvent.POSITION_KNOWN, f"waited {waited:.1f} s >= {p.start_patience:.1f} s for a better position"
    return None


def check_direct(m: DockingMemory, view: DockingView, *, turned: bool, p: DockingParameters) -> Event:
    """Look whether alignment may be left out: turned, with vision, near the normal and far enough out for the curve."""
    c = p.corridor
    seen = view.t - m.vision_since
    if not turned or seen < p.settling.dwell or view.position_std > c.direct_std:
        return None
    near_normal = view.angle <= c.direct_angle and view.goal_out >= c.direct_range <= view.out
    if not near_normal:
        return None
    return (
        DockingEvent.DIRECT,
        f"{math.degrees(view.angle):.0f} deg off the normal, vision for {seen:.1f} s, position known to "
        f"{1000.0 * view.position_std:.1f} mm: no separate alignment needed",
    )


def check_align(m: DockingMemory, view: DockingView, port: Port, p: SettlingParameters) -> Event:
    """Look whether the chaser stands at the alignment point, seeing, for long enough; or has failed to for too long."""
    error = norm(minus(view.position, port.before(m.align_range or 0.0)))
    settled = (
        view.vision
        and error <= p.position
        and view.speed <= p.speed
        and view.attitude_error <= p.angle
        and view.position_std <= p.position_std
    )
    m.settled_since = min(m.settled_since, view.t) if settled else math.inf
    if view.t - m.settled_since >= p.dwell:
        return (
            DockingEvent.SETTLED,
            f"{1000.0 * error:.1f} mm and {view.attitude_error:.4f} rad off, vision for "
            f"{view.t - m.vision_since:.1f} s",
        )
    at_point = norm(minus(view.goal, port.before(m.align_range or 0.0))) <= _AT_POINT
    m.at_end_since = min(m.at_end_since, view.t) if at_point else m.at_end_since
    waited = view.t - m.at_end_since
    if waited <= p.patience:
        return None
    seen = "seen" if view.vision else "not seen"
    return (
        DockingEvent.ATTEMPT_FAILED,
        f"after {waited:.0f} s still {1000.0 * error:.0f} mm and {view.attitude_error:.3f} rad off, target {seen}",
    )


def check_dock(m: DockingMemory, view: DockingView, c: CorridorParameters) -> Event:
    """Look whether the chaser is inside the corridor, sees, and gets on."""
    allowed = c.floor + math.tan(c.half_angle) * max(view.out, 0.0)
    if view.deviation > allowed:
        return (
            DockingEvent.ATTEMPT_FAILED,
            f"{1000.0 * view.deviation:.1f} mm > {1000.0 * allowed:.1f} mm beside the way in, "
            f"{1000.0 * view.out:.0f} mm out",
        )
    if view.attitude_error > c.angle:
        return DockingEvent.ATTEMPT_FAILED, f"attitude {view.attitude_error:.3f} rad > {c.angle:.3f} rad off"
    if view.out > c.blind_range and view.blind_for > c.vision_lost:
        return (
            DockingEvent.ATTEMPT_FAILED,
            f"no vision for {view.blind_for:.1f} s, {1000.0 * view.out:.0f} mm out",
        )
    at_end = view.goal_out <= -c.past_contact + _AT_POINT
    m.at_end_since = min(m.at_end_since, view.t) if at_end else math.inf
    if view.t - m.at_end_since >= c.contact_patience:
        return DockingEvent.ATTEMPT_FAILED, f"no contact {view.t - m.at_end_since:.0f} s after it was due"
    return None


def check_retreat(m: DockingMemory, view: DockingView, port: Port, p: DockingParameters) -> Event:
    """Look whether the goal is clear of the docking face."""
    point = retreat_distance(m, p)
    if norm(minus(view.goal, port.before(point))) > _AT_POINT:
        return None
    if m.given_up:
        return DockingEvent.CLEAR, f"{point:.2f} m in front of the docking face: holding"
    return DockingEvent.BACKED_OFF, f"{point:.2f} m in front of the docking face: attempt {m.failed_attempts + 1}"


def retreat_distance(m: DockingMemory, p: DockingParameters) -> float:
    """Give how far [m] in front of the docked position the retreat ends."""
    return p.retreat_range if m.given_up or m.align_range is None else m.align_range
