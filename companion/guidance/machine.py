"""The guidance: which mode, why, and where it wants the vehicle.

    preflight → takeoff → search → approach → reorient → (follow → reorient) → (align) → land → touchdown → done

with hold, go-around and abort beside the way. What leads where stands in `modes.TRANSITIONS`; this file decides which
event has happened. Markov probabilities decide when approaching turns to reorienting and whether to align before the
descent (Parikh et al., Algorithm 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from companion.geometry.arrays import Array
from companion.guidance import goals
from companion.guidance.goals import Goal, allowed_lateral_error
from companion.guidance.markov import transition_probabilities
from companion.guidance.modes import FINAL_MODES, Event, next_mode
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, FollowUntil
from companion.guidance.search import spiral_offset
from companion.guidance.view import RelativeState, View, relative_state
from companion.messages.decision import Decision, Mode, Switch, TransitionProbabilities
from companion.messages.target import TURN_RATE, TargetTrack

Verdict = tuple[Event, str] | None
_BIG = 1e9
_TRACKING_MODES = frozenset({Mode.APPROACH, Mode.REORIENT, Mode.FOLLOW, Mode.ALIGN, Mode.LAND, Mode.GO_AROUND})


@dataclass(slots=True, kw_only=True)
class _Memory:
    """What the guidance remembers between steps."""

    mode: Mode = Mode.PREFLIGHT
    t_entered: float = -_BIG
    t: float = -_BIG
    origin_ned: Array = field(default_factory=lambda: np.zeros(3))  # where the take-off began
    origin_yaw: float = 0.0
    reset_counter: int = 0
    hold_position: Array = field(default_factory=lambda: np.zeros(3))
    hold_yaw: float = 0.0
    reorient_range: float = 0.0  # r2
    attempts: int = 0
    followed: bool = False
    search_started: float = -_BIG
    search_budget: float = _BIG
    centre_ned: Array | None = None  # where the target was last expected
    centre_velocity: Array = field(default_factory=lambda: np.zeros(3))
    dwell_since: float | None = None
    stopped_since: float | None = None
    follow_started: float = -_BIG
    approach_height: float = 0.0
    height_reference: float = 0.0  # of the feet above the pad, while landing
    lowest: float = _BIG
    t_progress: float = -_BIG
    contact_since: float | None = None
    gate_since: float | None = None
    gate_passed: bool = False
    cone_out_since: float | None = None
    contact_down: float = 0.0
    lost_reason: str = ""


class Guidance:
    """Holds the mode between steps; `update` decides, `goal` says where to fly."""

    def __init__(self, plan: FlightPlan, parameters: GuidanceParameters) -> None:
        self._plan = plan
        self._p = parameters
        self._m = _Memory()
        self._checks: dict[Mode, Callable[[View, RelativeState | None], Verdict]] = {
            Mode.PREFLIGHT: self._check_preflight,
            Mode.TAKEOFF: self._check_takeoff,
            Mode.SEARCH: self._check_search,
            Mode.APPROACH: self._check_approach,
            Mode.REORIENT: self._check_reorient,
            Mode.FOLLOW: self._check_follow,
            Mode.ALIGN: self._check_align,
            Mode.LAND: self._check_land,
            Mode.TOUCHDOWN: self._check_touchdown,
            Mode.HOLD: self._check_hold,
            Mode.GO_AROUND: self._check_go_around,
        }

    @property
    def mode(self) -> Mode:
        """The present mode."""
        return self._m.mode

    @property
    def attempts(self) -> int:
        """Descents begun so far."""
        return self._m.attempts

    @property
    def finished(self) -> bool:
        """Whether the mission has ended."""
        return self._m.mode in FINAL_MODES

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator.

        Args:
            translation_ned: jump of the position (3,) [m].
            yaw: jump of the heading [rad].
            pivot_ned: position before the jump (3,) [m], about which the heading turns.
        """
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

        def moved(point: Array) -> Array:
            result: Array = pivot_ned + translation_ned + turn @ (point - pivot_ned)
            return result

        m = self._m
        m.origin_ned, m.hold_position = moved(m.origin_ned), moved(m.hold_position)
        m.origin_yaw += yaw
        m.hold_yaw += yaw
        m.contact_down += float(translation_ned[2])
        if m.centre_ned is not None:
            m.centre_ned, m.centre_velocity = moved(m.centre_ned), turn @ m.centre_velocity

    def update(self, view: View) -> Decision:
        """Decide the mode of this step."""
        m = self._m
        m.t = view.t
        relative = relative_state(view, view.track) if view.track is not None else None
        probabilities = self._probabilities(relative)
        switched: Switch | None = None
        if m.mode not in FINAL_MODES:
            if m.mode is Mode.PREFLIGHT:
                self._remember_origin(view)
            if relative is not None and self._acquired(view, relative) and view.track is not None:
                m.centre_ned, m.centre_velocity = view.track.position_ned, view.track.velocity_ned
            verdict = self._always(view) or self._checks[m.mode](view, relative)
            if verdict is not None:
                event, reason = verdict
                switched = self._enter(view, relative, next_mode(m.mode, event), reason)
        return Decision(t=view.t, mode=m.mode, switched=switched, probabilities=probabilities)

    # ------------------------------------------------------------------ what has happened

    def _remember_origin(self, view: View) -> None:
        m = self._m
        m.origin_ned, m.origin_yaw = view.ownship.position_ned, view.ownship.yaw
        m.hold_position, m.hold_yaw = view.ownship.position_ned, view.ownship.yaw

    def _probabilities(self, relative: RelativeState | None) -> TransitionProbabilities | None:
        m = self._m
        if relative is None or m.mode not in _TRACKING_MODES or relative.range > self._p.markov.activation_range_m:
            return None
        return transition_probabilities(
            range_m=relative.range,
            reorient_range_m=m.reorient_range or max(relative.range, self._p.markov.reorient_floor_m),
            inconsistency=relative.inconsistency,
            heading_error=relative.heading_error,
            position_std=relative.position_std,
            parameters=self._p.markov,
        )

    def _always(self, view: View) -> Verdict:
        m = self._m
        if m.mode is not Mode.PREFLIGHT and view.taken_over:
            return Event.TAKEN_OVER, f"the vehicle is flown by somebody else: mode {view.status.mode.value}"
        if m.mode not in (Mode.PREFLIGHT, Mode.TOUCHDOWN) and view.commanding and not view.status.armed:
            return Event.DISARMED, "the autopilot disarmed in flight"
        return None

    def _acquired(self, view: View, relative: RelativeState) -> bool:
        a, track = self._p.acquisition, view.track
        return (
            track is not None
            and view.prediction is not None
            and track.fused >= a.measurements
            and relative.position_std < a.position_std_m
            and track.age < self._plan.lost.coast_s
        )

    def _lost(self, view: View, relative: RelativeState | None, *, position_std: float) -> str | None:
        """Say why the target counts as lost, or None."""
        track = view.track
        if track is None or relative is None or view.prediction is None:
            return "no track of the target"
        if track.age > self._plan.lost.coast_s:
            if view.t - view.t_frame > self._p.acquisition.camera_silence_s:
                return f"no camera frames for {view.t - view.t_frame:.1f} s"
            return f"target not seen for {track.age:.1f} s (coasting is allowed for {self._plan.lost.coast_s:.1f} s)"
        if relative.position_std > position_std:
            return f"position known to {relative.position_std:.2f} m only (at most {position_std:.2f} m)"
        if track.nis_mean > self._p.acquisition.nis_mean:
            return (
                f"estimate not consistent: mean NIS {track.nis_mean:.1f} (at most {self._p.acquisition.nis_mean:.1f})"
            )
        return None

    def _dwell(self, condition: bool, t: float, duration: float) -> bool:
        m = self._m
        if not condition:
            m.dwell_since = None
            return False
        if m.dwell_since is None:
            m.dwell_since = t
        return t - m.dwell_since >= duration

    def _check_preflight(self, view: View, _relative: RelativeState | None) -> Verdict:
        if view.commanding and view.status.armed:
            return Event.ENGAGED, f"armed and in {view.status.mode.value}"
        return None

    def _check_takeoff(self, view: View, _relative: RelativeState | None) -> Verdict:
        height = float(self._m.origin_ned[2] - view.ownship.position_ned[2])
        if height > self._plan.takeoff_height_m - self._p.takeoff_tolerance_m:
            return Event.HEIGHT_REACHED, f"height {height:.1f} m of {self._plan.takeoff_height_m:.1f} m"
        return None

    def _check_search(self, view: View, relative: RelativeState | None) -> Verdict:
        m = self._m
        if relative is not None and view.track is not None and self._acquired(view, relative):
            if self._plan.land is None and self._plan.follow is None:
                return Event.STEP_COMPLETE, f"target found at {relative.range:.1f} m"
            return (
                Event.TARGET_ACQUIRED,
                f"target seen {view.track.fused} times, {relative.range:.1f} m away, known to "
                f"{relative.position_std:.2f} m",
            )
        if view.t - m.search_started > m.search_budget:
            return Event.SEARCH_EXPIRED, f"target not found in {m.search_budget:.0f} s"
        return None

    def _check_approach(self, view: View, relative: RelativeState | None) -> Verdict:
        lost = self._lost(view, relative, position_std=self._p.acquisition.position_std_m)
        if lost is not None or relative is None:
            return Event.TARGET_LOST, lost or ""
        p = self._p.markov
        if relative.range > p.activation_range_m:
            return None
        numbers = self._probabilities(relative)
        if numbers is not None and numbers.a11 <= p.keep_approach_threshold:
            return (
                Event.REORIENT_DUE,
                f"A11 = {numbers.a11:.2f} <= {p.keep_approach_threshold:.2f} at range {relative.range:.2f} m, "
                f"heading error {math.degrees(relative.heading_error):.0f} deg",
            )
        if relative.lateral <= p.reorient_floor_m:
            return Event.REORIENT_DUE, f"distance {relative.lateral:.2f} m <= {p.reorient_floor_m:.2f} m"
        return None

    def _check_reorient(self, view: View, relative: RelativeState | None) -> Verdict:
        lost = self._lost(view, relative, position_std=self._p.acquisition.position_std_m)
        if lost is not None or relative is None:
            return Event.TARGET_LOST, lost or ""
        p, d, follow = self._p.markov, self._p.descent, self._plan.follow
        if follow is not None and not self._m.followed:
            near = relative.lateral < self._p.follow.capture_lateral_m
            if near and abs(relative.height - follow.height_m) < 0.5:
                return Event.STATION_REACHED, f"{relative.lateral:.2f} m from the point above the target"
            return None
        if self._plan.land is None:
            return None
        numbers = self._probabilities(relative)
        at_point = relative.lateral < 0.5 and relative.height < d.align_height_m + 0.35
        if at_point and numbers is not None and numbers.steady_align > p.align_threshold:
            inside = relative.lateral < 0.6 * self._cone(relative.height)
            if inside and relative.lateral_speed < d.align_speed_mps and abs(relative.heading_error) < 0.15:
                return (
                    Event.CONFIDENT,
                    f"P(align) = {numbers.steady_align:.2f} > {p.align_threshold:.2f}, {relative.lateral:.2f} m off "
                    f"at height {relative.height:.2f} m: no separate alignment needed",
                )
        if at_point and relative.range <= d.align_height_m + 0.2:
            return Event.ALIGN_DUE, f"range {relative.range:.2f} m: alignment point reached"
        if numbers is not None and numbers.steady_align <= p.align_threshold:
            return Event.ALIGN_DUE, f"P(align) = {numbers.steady_align:.2f} <= {p.align_threshold:.2f}"
        return None

    def _check_follow(self, view: View, relative: RelativeState | None) -> Verdict:
        lost = self._lost(view, relative, position_std=self._p.acquisition.position_std_m)
        if lost is not None or relative is None or view.track is None:
            return Event.TARGET_LOST, lost or ""
        m, follow = self._m, self._plan.follow
        if follow is None:
            return Event.FOLLOW_COMPLETE, "nothing to follow"
        elapsed = view.t - m.follow_started
        done = Event.FOLLOW_COMPLETE if self._plan.land is not None else Event.STEP_COMPLETE
        if follow.until is FollowUntil.TIME:
            return (done, f"followed for {elapsed:.0f} s") if elapsed >= follow.for_s else None
        if elapsed >= follow.at_most_s:
            return done, f"followed for {elapsed:.0f} s, the longest allowed"
        stopped = self._stopped(view, view.track)
        if stopped and elapsed >= follow.for_s:
            return done, f"target stopped, after {elapsed:.0f} s"
        return None

    def _stopped(self, view: View, track: TargetTrack) -> bool:
        m, p = self._m, self._p.follow
        speed = math.hypot(float(track.velocity_ned[0]), float(track.velocity_ned[1]))
        quiet = speed < p.stopped_speed_mps and abs(float(track.state[TURN_RATE])) < p.stopped_turn_radps
        if not quiet:
            m.stopped_since = None
            return False
        if m.stopped_since is None:
            m.stopped_since = view.t
        return view.t - m.stopped_since >= p.stopped_dwell_s

    def _check_align(self, view: View, relative: RelativeState | None) -> Verdict:
        lost = self._lost(view, relative, position_std=self._p.acquisition.position_std_m)
        if lost is not None or relative is None:
            return Event.TARGET_LOST, lost or ""
        d = self._p.descent
        patient = view.t - self._m.t_entered < d.gate_patience_s
        lateral = d.align_lateral_m if patient else 0.6 * self._cone(relative.height)
        settled = (
            relative.lateral < lateral
            and (not patient or relative.lateral_speed < d.align_speed_mps)
            and abs(relative.heading_error) < (d.align_heading_rad if patient else 0.2)
            and abs(relative.height - d.align_height_m) < 0.3
        )
        if self._dwell(settled, view.t, d.align_dwell_s):
            return (
                Event.SETTLED,
                f"{relative.lateral:.2f} m and {math.degrees(relative.heading_error):.1f} deg off at height "
                f"{relative.height:.2f} m for {d.align_dwell_s:.1f} s",
            )
        return None

    def _cone(self, height: float) -> float:
        d = self._p.descent
        return allowed_lateral_error(height, half_angle=d.cone_half_angle_rad, floor=d.cone_floor_m)

    def _check_land(self, view: View, relative: RelativeState | None) -> Verdict:
        m, d = self._m, self._p.descent
        committed = m.height_reference < d.commit_height_m
        lost = self._lost(view, relative, position_std=self._p.acquisition.descent_position_std_m)
        if relative is None or view.prediction is None:
            return Event.TARGET_LOST, lost or "no track of the target"
        if lost is not None and not committed:
            return Event.TARGET_LOST, lost
        allowed = self._cone(relative.height)
        bound = d.commit_lateral_m if committed else d.cone_abort_factor * allowed
        if relative.lateral > bound:
            return (
                Event.OUTSIDE_CONE,
                f"{relative.lateral:.2f} m off at height {relative.height:.2f} m (at most {bound:.2f} m)",
            )
        if view.t - m.t_progress > d.stall_s:
            return Event.OUTSIDE_CONE, f"no progress in the descent for {d.stall_s:.0f} s"
        touching = relative.height <= d.contact_height_m or m.height_reference < -0.15
        if touching:
            return Event.CONTACT, f"feet {relative.height:.2f} m above the pad, {relative.lateral:.3f} m off"
        return None

    def _check_touchdown(self, view: View, relative: RelativeState | None) -> Verdict:
        m, d = self._m, self._p.descent
        if view.landed:
            return Event.LANDED, "the autopilot says landed and has disarmed"
        if relative is not None and view.track is not None and view.track.age < 0.2 and relative.height > 0.35:
            return Event.OUTSIDE_CONE, f"{relative.height:.2f} m above the pad after contact"
        if view.t - m.t_entered > d.contact_timeout_s:
            return Event.OUTSIDE_CONE, f"no landing detected in {d.contact_timeout_s:.0f} s after contact"
        return None

    def _check_hold(self, view: View, relative: RelativeState | None) -> Verdict:
        m, lost = self._m, self._plan.lost
        elapsed = view.t - m.t_entered
        if self._complete:
            return (Event.STEP_COMPLETE, f"held for {elapsed:.0f} s") if elapsed >= self._plan.hold_s else None
        if relative is not None and view.track is not None and self._acquired(view, relative):
            return Event.TARGET_ACQUIRED, f"target seen again, {relative.range:.1f} m away"
        if elapsed >= lost.hold_s:
            if view.t - view.t_frame > self._p.acquisition.camera_silence_s:
                if elapsed > self._p.hold_timeout_s:
                    return Event.SEARCH_EXPIRED, f"no camera frames for {view.t - view.t_frame:.0f} s"
                return None  # searching is useless without a camera
            return Event.HOLD_EXPIRED, f"target not seen while holding for {elapsed:.0f} s"
        return None

    @property
    def _complete(self) -> bool:
        """Whether nothing is left but the final hold."""
        if self._plan.land is not None:
            return False
        return self._m.followed if self._plan.follow is not None else self._m.centre_ned is not None

    def _check_go_around(self, view: View, relative: RelativeState | None) -> Verdict:
        m, land = self._m, self._plan.land
        lost = self._lost(view, relative, position_std=self._p.acquisition.position_std_m)
        climbed = view.t - m.t_entered > 1.0 and (
            relative is not None and relative.height > self._p.descent.align_height_m
        )
        if (climbed or lost is not None) and land is not None and m.attempts >= land.max_attempts:
            return Event.ATTEMPTS_USED, f"{m.attempts} attempts, none succeeded"
        if climbed and lost is None and relative is not None:
            return Event.CLIMBED, f"height {relative.height:.2f} m above the pad"
        if lost is not None and view.t - m.t_entered > 3.0:
            return Event.TARGET_LOST, lost
        return None

    # ------------------------------------------------------------------ entering a mode

    def _enter(self, view: View, relative: RelativeState | None, mode: Mode, reason: str) -> Switch:
        m, previous = self._m, self._m.mode
        m.mode, m.t_entered = mode, view.t
        m.dwell_since = m.stopped_since = m.contact_since = m.gate_since = m.cone_out_since = None
        m.hold_position, m.hold_yaw = view.ownship.position_ned, view.ownship.yaw
        if mode is Mode.SEARCH:
            m.search_started = view.t
            first = previous is Mode.TAKEOFF
            m.search_budget = self._plan.search.timeout_s if first else self._plan.lost.search_s
        if mode is Mode.APPROACH:
            m.reorient_range = 0.0
            height = relative.height if relative is not None else self._plan.search.height_m
            m.approach_height = min(max(height, self._p.descent.align_height_m), self._plan.search.height_m)
        if mode is Mode.REORIENT and relative is not None:
            if previous is Mode.FOLLOW:
                m.followed = True
            m.reorient_range = max(relative.range, 1e-3)
        if mode is Mode.FOLLOW:
            m.follow_started = view.t
        if previous is Mode.FOLLOW and mode is Mode.HOLD and self._plan.land is None and "followed" in reason:
            m.followed = True
        if mode is Mode.LAND and relative is not None:
            m.attempts += 1
            m.height_reference = m.lowest = relative.height
            m.t_progress = view.t
            m.gate_passed = False
        if mode is Mode.TOUCHDOWN:
            m.contact_down = float(view.ownship.position_ned[2])
        return Switch(t=view.t, mode=mode, reason=reason)

    # ------------------------------------------------------------------ where to fly

    def goal(self, view: View, dt: float) -> Goal | None:
        """Give the goal of the present mode, None where nothing is to be flown.

        Args:
            view: of this step.
            dt: time since the last call [s].
        """
        m, p = self._m, self._p
        if m.mode in (Mode.PREFLIGHT, Mode.DONE, Mode.ABORT):
            return None
        settle = view.t + p.settle_time_s
        if m.mode is Mode.TAKEOFF:
            position = m.origin_ned.copy()
            position[2] -= self._plan.takeoff_height_m
            t_reach = m.t_entered + 1.6 * self._plan.takeoff_height_m / p.takeoff_speed_mps
            return Goal(
                at=goals.stand_still(position, m.origin_yaw),
                t_reach=max(t_reach, settle),
                relative=False,
                direct=False,
            )
        if m.mode is Mode.SEARCH:
            return self._search_goal(view, settle)
        if m.mode is Mode.HOLD or view.prediction is None or view.track is None:
            at = goals.stand_still(m.hold_position, m.hold_yaw)
            return Goal(at=at, t_reach=settle, relative=False, direct=False)
        if m.mode is Mode.TOUCHDOWN:
            at = goals.sinking(
                view.ownship.position_ned,
                view.prediction.at(view.t).velocity_ned if view.track.age < 1.0 else np.zeros(3),
                t=view.t,
                sink_rate=p.descent.touchdown_speed_mps + 0.05,
                yaw=m.hold_yaw,
            )
            return Goal(at=at, t_reach=view.t, relative=False, direct=True)
        return self._tracking_goal(view, settle, dt)

    def _search_goal(self, view: View, settle: float) -> Goal:
        m, s, plan = self._m, self._p.search, self._plan.search
        centre = m.origin_ned if m.centre_ned is None else m.centre_ned
        drift = np.zeros(3) if m.centre_ned is None else m.centre_velocity
        since = view.t - m.search_started
        if m.centre_ned is not None:
            centre = centre + drift * min(since, 5.0)
        pitch = s.swath_fraction * s.footprint_per_height * plan.height_m
        started = m.search_started

        def offset_at(when: float) -> tuple[Array, Array]:
            return spiral_offset(elapsed=when - started, speed=s.speed_mps, pitch=pitch, radius=plan.radius_m)

        at = goals.along_spiral(
            offset_at,
            t=view.t,
            centre_ned=centre,
            drift_ned=np.zeros(3),
            down=float(m.origin_ned[2]) - plan.height_m,
            yaw=m.hold_yaw,
        )
        return Goal(at=at, t_reach=settle, relative=False, direct=False)

    def _tracking_goal(self, view: View, settle: float, dt: float) -> Goal:
        m, d = self._m, self._p.descent
        prediction, intercept = view.prediction, view.intercept
        assert prediction is not None  # the caller has checked
        gear = view.gear_height
        yaw: float | None
        if m.mode in (Mode.APPROACH, Mode.REORIENT):
            if m.mode is Mode.APPROACH:
                height, yaw = m.approach_height, m.hold_yaw
            else:
                follow = self._plan.follow if not m.followed else None
                height = follow.height_m if follow is not None else d.align_height_m
                yaw = None if follow is None or follow.match_heading else m.hold_yaw
            at = goals.above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=yaw)
            t_reach = max(settle, intercept.t if intercept is not None else settle)
            return Goal(at=at, t_reach=t_reach, relative=True, direct=False)
        if m.mode is Mode.FOLLOW:
            follow = self._plan.follow
            height = follow.height_m if follow is not None else self._plan.search.height_m
            yaw = None if follow is None or follow.match_heading else m.hold_yaw
            at = goals.above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=yaw)
            return Goal(at=at, t_reach=settle, relative=True, direct=False)
        if m.mode is Mode.ALIGN:
            at = goals.above_target(prediction, t=view.t, body_height=d.align_height_m + gear, climb_rate=0.0, yaw=None)
            return Goal(at=at, t_reach=settle, relative=True, direct=False)
        if m.mode is Mode.GO_AROUND:
            height = self._plan.search.height_m * 0.5 + 0.5 * d.align_height_m
            at = goals.above_target(prediction, t=view.t, body_height=height + gear, climb_rate=0.0, yaw=m.hold_yaw)
            return Goal(at=at, t_reach=view.t + 1.5, relative=True, direct=False)
        return self._descent_goal(view, settle, dt)

    def _descent_goal(self, view: View, settle: float, dt: float) -> Goal:
        m = self._m
        assert view.prediction is not None and view.track is not None  # noqa: PT018 - the caller has checked
        relative = relative_state(view, view.track)
        rate = self._descent_rate(view, relative)
        m.height_reference -= rate * dt
        # the reference never runs far ahead of the vehicle: it would be flown as a dive once the vehicle is free
        m.height_reference = max(m.height_reference, relative.height - 0.3)
        if relative.height < m.lowest - 0.02:
            m.lowest, m.t_progress = relative.height, view.t
        at = goals.above_target(
            view.prediction,
            t=view.t,
            body_height=m.height_reference + view.gear_height,
            climb_rate=-rate,
            yaw=None,
        )
        return Goal(at=at, t_reach=settle, relative=True, direct=False)

    def _descent_rate(self, view: View, relative: RelativeState) -> float:
        """Give the rate of descent [m/s]: fast while high, none outside the cone, a wait at the gate."""
        m, d = self._m, self._p.descent
        height = m.height_reference
        if height > d.slow_height_m:
            blend = min(1.0, (height - d.slow_height_m) / 0.4)
            speed = d.touchdown_speed_mps + blend * (d.speed_mps - d.touchdown_speed_mps)
        else:
            speed = d.touchdown_speed_mps
        if m.gate_passed:
            return speed
        allowed = self._cone(relative.height)
        margin = min(1.0, max(0.0, (allowed - relative.lateral) / (0.4 * allowed)))
        if height > d.gate_height_m:
            brake = math.sqrt(2.0 * 1.0 * max(height - d.gate_height_m, 0.0)) + 0.02
            return margin * min(speed, brake) if not self._gate_open(relative) else margin * speed
        if m.gate_since is None:
            m.gate_since = view.t
        waited = view.t - m.gate_since > d.gate_patience_s and relative.lateral < allowed
        if self._gate_open(relative) or waited:
            m.gate_passed = True
            return speed
        return 0.0

    def _gate_open(self, relative: RelativeState) -> bool:
        d = self._p.descent
        return (
            relative.lateral < d.gate_lateral_m
            and relative.lateral_speed < d.gate_speed_mps
            and abs(relative.heading_error) < d.gate_heading_rad
        )
