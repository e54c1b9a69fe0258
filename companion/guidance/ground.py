"""The guidance on the ground: meet a target at a distance behind it, follow it, and stand there when it has stopped.

    preflight → search → approach → follow → align → done

with hold and abort beside the way. The vehicle's place is `standoff` behind the target's reference point, at its
heading. It stands still to look for a target that it has not seen yet: it cannot look about without driving somewhere.
One that it has lost is looked for (`lookout.py`).

When a target has stopped cannot be read off its speed over ground where the odometry drifts, a rover's by 0.2 m/s. So
the rover stops itself where it has arrived and the target seems slow; then whatever moves in its view is the target. A
free-flyer has no brakes and goes on keeping its place; its odometry tells whether the target moves.
"""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.checks import Verdict, watch_fence
from companion.guidance.conditions import without_frames
from companion.guidance.goals import Goal, behind_target, stand_still
from companion.guidance.looked import Looked
from companion.guidance.lookout import Lookout
from companion.guidance.memory import pose_moved_by_reset
from companion.guidance.modes import FINAL_MODES, Event, leads_to
from companion.guidance.near_sight import FRESH_S, NearSight
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan, FollowUntil, GroundPlan
from companion.guidance.standing import Standing, standing_of
from companion.guidance.view import View
from companion.messages.decision import Decision, Mode, Switch

_E, _M = Event, Mode

TRANSITIONS: dict[tuple[Mode, Event], Mode] = {
    (_M.PREFLIGHT, _E.ENGAGED): _M.SEARCH,
    (_M.SEARCH, _E.TARGET_ACQUIRED): _M.APPROACH,
    (_M.SEARCH, _E.SEARCH_EXPIRED): _M.ABORT,
    (_M.SEARCH, _E.CAMERA_SILENT): _M.HOLD,
    (_M.APPROACH, _E.STATION_REACHED): _M.FOLLOW,
    (_M.APPROACH, _E.TARGET_LOST): _M.HOLD,
    (_M.FOLLOW, _E.ARRIVED): _M.ALIGN,
    (_M.FOLLOW, _E.FOLLOW_COMPLETE): _M.DONE,
    (_M.FOLLOW, _E.TARGET_LOST): _M.HOLD,
    (_M.ALIGN, _E.SETTLED): _M.DONE,
    (_M.ALIGN, _E.FOLLOW_COMPLETE): _M.DONE,
    (_M.ALIGN, _E.TARGET_MOVES): _M.FOLLOW,
    (_M.ALIGN, _E.TARGET_LOST): _M.HOLD,
    (_M.HOLD, _E.TARGET_ACQUIRED): _M.APPROACH,
    (_M.HOLD, _E.HOLD_EXPIRED): _M.SEARCH,
    (_M.HOLD, _E.CAMERA_EXPIRED): _M.ABORT,
}
for _mode in Mode:
    if _mode not in FINAL_MODES:
        TRANSITIONS[(_mode, _E.TAKEN_OVER)] = _M.ABORT
    if _mode not in (*FINAL_MODES, _M.PREFLIGHT):
        TRANSITIONS[(_mode, _E.DISARMED)] = _M.ABORT
for _mode in (_M.APPROACH, _M.FOLLOW):
    TRANSITIONS[(_mode, _E.BEYOND_FENCE)] = _M.ABORT


class GroundGuidance:
    """Holds the mode between steps.

    Args:
        plan: of the mission; its `ground` part is what is done.
        parameters: of the guidance.
        stands: to see whether the target has stopped it stands itself; False: it goes on following meanwhile.

    Raises:
        ValueError: the plan has no part for a vehicle on the ground.
    """

    def __init__(self, plan: FlightPlan, parameters: GuidanceParameters, *, stands: bool = True) -> None:
        if plan.ground is None:
            raise ValueError("the mission has no step for a vehicle on the ground: it needs intercept or follow")
        self._plan = plan
        self._ground: GroundPlan = plan.ground
        self._p = parameters
        self._stands = stands
        self._following = frozenset({Mode.APPROACH, Mode.FOLLOW} | (set() if stands else {Mode.ALIGN}))
        self.mode = Mode.PREFLIGHT
        self._t_entered = -math.inf
        self._has_approached = False  # it has once known where the target is
        self._t_followed: float | None = None  # [s] of the first time on station
        self._hold = (np.zeros(3), 0.0)  # position [m] and heading [rad] at which it stands
        self._lookout_place = self._hold  # where it looks about from
        self._sight = NearSight(parameters, standoff=plan.ground.standoff_m)
        self._lookout = Lookout(parameters.ground.lookout)
        self._searched = 0.0  # [s] allowed for the present search
        self._search_left: float | None = None  # [s] of one that was broken off because no pictures came
        self._looked = Looked()  # stood with pictures since it last knew where the target is
        self._believed_s = FRESH_S  # [s] how old the newest sighting may be that ends it
        self._fence_since: float | None = None
        self._arrived_since: float | None = None
        self._slow_for = 0.0  # [s] the target has seemed slow, less what it has seemed fast since
        self._t_asked = math.inf  # [s] of the last step in which that was asked
        self._near = 0.0  # [m] off its place that was near enough when it was last asked
        self._settled_at: Standing | None = None  # when it has come to rest
        self._wants_return = False

    @property
    def wants_return(self) -> bool:
        """Whether the autopilot is to be asked for Return instead of Hold."""
        return self._wants_return

    @property
    def wants_precision_landing(self) -> bool:
        """Nothing lands here."""
        return False

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator."""

        def moved(place: tuple[Array, float]) -> tuple[Array, float]:
            return pose_moved_by_reset(place, translation_ned, yaw, pivot_ned)

        self._hold, self._lookout_place = moved(self._hold), moved(self._lookout_place)
        self._lookout.turn(yaw)
        self._sight.rebase(translation_ned, yaw, pivot_ned)

    def restart(self) -> None:
        """Begin anew, as the operator engages again."""
        self.mode, self._t_entered, self._t_followed = Mode.PREFLIGHT, -math.inf, None
        self._has_approached, self._search_left = False, None
        self._looked.forget()
        self._sight.forget()
        self._fence_since, self._wants_return = None, False

    def update(self, view: View) -> Decision:
        """Decide the mode of this step."""
        switched: Switch | None = None
        if self.mode not in FINAL_MODES:
            self._sight.watch(view)
            standing = None if view.track is None else standing_of(view.track, self._ground.standoff_m)
            verdict = self._check_always(view) or self._check(view, standing)
            if verdict is not None:
                switched = self._enter(view, *verdict)
        return Decision(t=view.t, mode=self.mode, switched=switched, probabilities=None)

    def goal(self, view: View, dt: float) -> Goal | None:  # noqa: ARG002  # the interface's
        """Give the goal of the present mode, None where nothing is to be done."""
        if self.mode in (Mode.PREFLIGHT, *FINAL_MODES):
            return None
        if self.mode in self._following and view.prediction is not None:
            standoff = self._ground.standoff_m
            retreat = self._sight.retreat(view, view.prediction)
            if retreat is not None:
                place = stand_still(*retreat)
            else:
                if self.mode is Mode.APPROACH and view.track is not None:
                    standoff += self._lead_in(standing_of(view.track, standoff))
                place = behind_target(view.prediction, standoff)
            return Goal(
                at=place,
                t_reach=view.t,
                relative=True,
                direct=False,
                backs_out=retreat is not None,
                may_stand_at=self._sight.may_stand_at(view),
            )
        if self.mode is Mode.SEARCH and self._has_approached:
            return self._look_about(view)
        return Goal(at=stand_still(*self._hold), t_reach=view.t, relative=False, direct=True)

    def _look_about(self, view: View) -> Goal:
        """Look for a target that is lost, from where it was given up; from some way back where that is beside it."""
        (place, yaw), expected = self._hold, None
        if view.prediction is not None:
            forecast = view.prediction.at(view.t)
            north, east = (forecast.position_ned - place)[:2].tolist()
            expected = math.atan2(east, north)
            place = self._sight.farther_back(place, forecast)
            self._lookout_place = (place, yaw)
        else:
            place, _ = self._lookout_place  # not on again, to a target that nobody knows the place of any more
        heading = self._lookout.heading(view.t, yaw=view.ownship.yaw, expected=expected)
        # one that cannot turn on the spot needs the forecast for its plan: without it, it stands
        relative = self._stands and view.prediction is not None
        direct = self._stands and not relative
        return Goal(
            at=stand_still(place, heading),
            t_reach=view.t,
            relative=relative,
            direct=direct,
            may_stand_at=self._sight.may_stand_at(view),
        )

    def _lead_in(self, standing: Standing) -> float:
        """Give how far [m] behind its place the vehicle lines up first: the more, the less it is in line with it."""
        p = self._p.ground
        aside = max(0.0, abs(standing.across) - p.line_up_m)
        turned = max(0.0, abs(standing.heading) - p.line_up_rad)
        return min(p.lead_in_most_m, p.lead_in * aside + p.lead_in_per_rad_m * turned)

    def _check_always(self, view: View) -> Verdict:
        if self.mode is not Mode.PREFLIGHT:
            if view.taken_over:
                return Event.TAKEN_OVER, f"the guardian gave up the vehicle: {view.guardian_reason}"
            if view.commanding and not view.status.armed:
                return Event.DISARMED, "the autopilot disarmed on the way"
        chasing = (self.mode, Event.BEYOND_FENCE) in TRANSITIONS
        self._fence_since, verdict = watch_fence(
            view, self._fence_since, chasing=chasing, patience_s=self._p.fence_patience_s
        )
        return verdict

    def _check(self, view: View, standing: Standing | None) -> Verdict:
        if self.mode is Mode.PREFLIGHT:
            if view.commanding and view.status.armed:
                return Event.ENGAGED, f"armed and in {view.status.mode.value}"
            return None
        if self.mode in (Mode.SEARCH, Mode.HOLD):
            return self._check_waiting(view, standing)
        lost = self._why_lost(view, standing)
        if lost is not None or standing is None:
            return Event.TARGET_LOST, lost or "no track of the target"
        if self.mode is Mode.APPROACH:
            # not by where an old sighting would have the place: a target that has set off since is elsewhere
            seen = view.track is not None and view.track.age <= FRESH_S
            if seen and standing.distance < self._p.ground.capture_m:
                return Event.STATION_REACHED, f"{standing.distance:.2f} m from its place"
            return None
        return self._check_follow(view, standing) if self.mode is Mode.FOLLOW else self._check_align(view, standing)

    def _check_waiting(self, view: View, standing: Standing | None) -> Verdict:
        a, track, waited = self._p.acquisition, view.track, view.t - self._t_entered
        if (
            track is not None
            and standing is not None
            and view.prediction is not None
            and track.fused >= a.measurements
            and standing.position_std < a.position_std_m
            and track.age < self._believed_s
            and waited >= (self._p.ground.look_s if self._t_followed is None else FRESH_S)
        ):
            return Event.TARGET_ACQUIRED, f"target seen {track.fused} times, {standing.range:.1f} m away"
        silent = without_frames(self._p.acquisition, view)
        if self.mode is Mode.HOLD:
            looked_s = self._looked.add(view.t, since=self._t_entered, pictures=silent is None)
            if silent is not None:
                expired = waited >= self._plan.lost.no_camera_s
                return (Event.CAMERA_EXPIRED, f"{silent}; stood for {waited:.0f} s") if expired else None
            expired = looked_s >= self._plan.lost.hold_s
            return (Event.HOLD_EXPIRED, f"target not seen while standing for {waited:.0f} s") if expired else None
        if silent is not None:
            self._search_left = self._searched - waited
            return Event.CAMERA_SILENT, f"{silent}: searching would be pointless"
        if waited > self._searched:
            return Event.SEARCH_EXPIRED, f"target not seen in {waited:.0f} s"
        return None

    def _why_lost(self, view: View, standing: Standing | None) -> str | None:
        a, track = self._p.acquisition, view.track
        if track is None or standing is None or view.prediction is None:
            return "no track of the target"
        if track.age > self._plan.lost.coast_s:
            coast_s = self._plan.lost.coast_s
            unseen = f"target not seen for {track.age:.1f} s (coasting is allowed for {coast_s:.1f} s)"
            return without_frames(a, view) or unseen
        if self._sight.is_backing_out(view):
            return None  # it backs out, for which it need not know where the target is
        if standing.position_std > a.position_std_m:
            return f"position known to {standing.position_std:.2f} m only (at most {a.position_std_m:.2f} m)"
        if track.nis_mean > a.nis_mean:
            return f"estimate not consistent: mean NIS {track.nis_mean:.1f} (at most {a.nis_mean:.1f})"
        return None

    def _check_time(self, view: View) -> Verdict:
        """Look whether it has followed for long enough, whatever the target does."""
        g, elapsed = self._ground, self._on_station(view)
        if g.until is FollowUntil.TIME and elapsed >= g.for_s:
            return Event.FOLLOW_COMPLETE, f"followed for {elapsed:.0f} s"
        if elapsed >= g.at_most_s:
            return Event.FOLLOW_COMPLETE, f"followed for {elapsed:.0f} s, the longest allowed"
        return None

    def _on_station(self, view: View) -> float:
        return 0.0 if self._t_followed is None else view.t - self._t_followed

    def _check_follow(self, view: View, standing: Standing) -> Verdict:
        if not self._has_arrived(view, standing):
            self._arrived_since = None
            return self._check_time(view)
        self._arrived_since = view.t if self._arrived_since is None else self._arrived_since
        if view.t - self._arrived_since < self._p.ground.arrived_dwell_s:
            return self._check_time(view)
        turned = math.degrees(abs(standing.heading))
        return Event.ARRIVED, f"{standing.distance:.2f} m and {turned:.1f} deg off its place"

    def _has_arrived(self, view: View, standing: Standing) -> bool:
        """Say whether the vehicle is at its place and both seem slow; what is near enough widens while they are."""
        p, track = self._p.ground, view.track
        if track is None or track.age > FRESH_S or view.relative_velocity_ned is None:
            return False
        speed = math.hypot(float(track.velocity_ned[0]), float(track.velocity_ned[1]))
        slow = speed < p.slow_mps
        # odometry that drifts makes a standing target seem to drive for a moment: that is not to begin anew for
        elapsed, self._t_asked = max(view.t - self._t_asked, 0.0), view.t
        self._slow_for = max(self._slow_for + (elapsed if speed <= 2.0 * p.slow_mps else -elapsed), 0.0)
        still = math.hypot(*view.relative_velocity_ned[:2].tolist()) < p.still_mps
        share = min(max(self._slow_for - p.strict_s, 0.0) / p.patience_s, 1.0)
        self._near = p.arrived_m + share * (p.arrived_last_m - p.arrived_m)
        near = standing.distance < self._near
        turned = abs(standing.heading) < p.arrived_rad + share * (p.arrived_last_rad - p.arrived_rad)
        return slow and still and near and turned

    def _check_align(self, view: View, standing: Standing) -> Verdict:
        """A rover stands: see whether the target does too."""
        p, waited = self._p.ground, view.t - self._t_entered
        if waited < p.rest_s:
            return None
        if not self._stands and view.track is not None:
            speed = math.hypot(float(view.track.velocity_ned[0]), float(view.track.velocity_ned[1]))
            if speed > 2.0 * p.slow_mps:
                return Event.TARGET_MOVES, f"the target moves at {speed:.2f} m/s"
        if self._settled_at is None:
            self._settled_at = standing
        at = self._settled_at
        moved = math.hypot(standing.along - at.along, standing.across - at.across)
        if moved > p.moved_m or abs(wrap_angle(standing.heading - at.heading)) > p.moved_rad:
            return Event.TARGET_MOVES, f"the target has moved by {moved:.2f} m"
        # one that has rolled on, or had just set off again, comes back
        most = min(self._near + p.rolled_m, p.arrived_last_m) if self._stands else p.arrived_last_m
        if standing.distance > most or abs(standing.heading) > p.arrived_last_rad:
            return Event.TARGET_MOVES, f"{standing.distance:.2f} m off its place after stopping"
        g = self._ground
        still_due = g.until is FollowUntil.TIME or self._on_station(view) < g.for_s
        if still_due or waited < p.rest_s + max(p.settle_s, self._plan.hold_s):
            return self._check_time(view)
        turned = math.degrees(abs(standing.heading))
        return Event.SETTLED, f"{standing.distance:.3f} m and {turned:.1f} deg off its place, by its own estimate"

    def _enter(self, view: View, event: Event, reason: str) -> Switch:
        mode = leads_to(TRANSITIONS, self.mode, event)
        self.mode, self._t_entered = mode, view.t
        self._hold = (view.ownship.position_ned, view.ownship.yaw)
        self._arrived_since = self._settled_at = None
        if mode is Mode.SEARCH:
            self._lookout_place = self._hold
            self._sight.end_retreat()
            first = not self._has_approached
            self._lookout.begin(view.t, view.ownship.yaw)
            whole = self._plan.search.timeout_s if first else self._plan.lost.search_s
            self._searched = whole if self._search_left is None else self._search_left
            self._search_left = None
            # one that has driven out of the picture while the rover looked is gone after by the forecast; one that was
            # lost on the way must be seen again
            self._believed_s = self._plan.lost.coast_s if first else FRESH_S
        if mode is Mode.HOLD:
            self._believed_s = FRESH_S
        if mode is Mode.APPROACH:
            self._has_approached, self._search_left = True, None
            self._looked.forget()
        if mode is Mode.FOLLOW and self._t_followed is None:
            self._t_followed = view.t
        if event in (Event.SEARCH_EXPIRED, Event.CAMERA_EXPIRED):
            self._wants_return = self._plan.lost.then_return
        return Switch(t=view.t, mode=mode, reason=reason)
