"""The guidance: which mode, why, and where it wants the vehicle.

    preflight → takeoff → (transit) → search → approach → reorient → (follow → reorient) → (align) → land → touchdown
    → done

with hold, go-around and abort beside the way. With `output: landing_target` align leads to autopilot_land, where the
autopilot lands by itself. What leads where stands in `modes.TRANSITIONS`, what has happened is
decided in `checks`, where to fly in `flying`. Markov probabilities decide when approaching turns to reorienting and
whether to align before the descent (Parikh et al., Algorithm 1).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from companion.geometry.arrays import Array
from companion.guidance.checks import CHECKS, check_always
from companion.guidance.conditions import TRACKING_MODES, is_acquired, probabilities
from companion.guidance.flying import goal_of
from companion.guidance.goals import Goal
from companion.guidance.memory import Context, Memory
from companion.guidance.modes import FINAL_MODES, Event, next_mode
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan
from companion.guidance.transit import check_hold, check_transit, probabilities_on_the_way
from companion.guidance.view import RelativeState, View, relative_state
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.target import TargetTrack

_CHECKS = CHECKS | {Mode.TRANSIT: check_transit, Mode.HOLD: check_hold}
_REST_TIME = 0.6  # [s] of the present velocity: how far on the vehicle can come to rest


class Guidance:
    """Holds the mode between steps; `update` decides, `goal` says where to fly."""

    def __init__(self, plan: FlightPlan, parameters: GuidanceParameters) -> None:
        self._c = Context(plan=plan, parameters=parameters, memory=Memory())

    @property
    def mode(self) -> Mode:
        """The present mode."""
        return self._c.memory.mode

    @property
    def wants_return(self) -> bool:
        """Whether the autopilot is to be asked for Return instead of Hold."""
        return self._c.memory.wants_return

    @property
    def wants_precision_landing(self) -> bool:
        """Whether the autopilot is to be asked for its precision landing instead of Hold."""
        return self._c.memory.mode is Mode.AUTOPILOT_LAND

    @property
    def attempts(self) -> int:
        """Descents begun so far."""
        return self._c.memory.attempts

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator.

        Args:
            translation_ned: jump of the position (3,) [m].
            yaw: jump of the heading [rad].
            pivot_ned: position before the jump (3,) [m], about which the heading turns.
        """
        self._c.memory.rebase(translation_ned, yaw, pivot_ned)

    def update(self, view: View) -> Decision:
        """Decide the mode of this step."""
        c, m = self._c, self._c.memory
        relative = self._relative(view)
        switched: Switch | None = None
        if m.mode not in FINAL_MODES:
            if m.mode is Mode.PREFLIGHT:
                self._note_origin(view)
            if relative is not None and view.track is not None and self._expects(view, view.track, relative):
                m.centre_ned, m.centre_velocity = view.track.position_ned, view.track.velocity_ned
            elif m.mode is Mode.SEARCH and view.track is not None and view.track.age < 0.2:
                self._glimpse(view, view.track)
            verdict = check_always(c, view) or _CHECKS[m.mode](c, view, relative)
            if verdict is not None:
                event, reason = verdict
                switched = self._enter(view, relative, event, reason)
        numbers = probabilities_on_the_way(c, view, relative) or probabilities(c, relative)
        return Decision(t=view.t, mode=m.mode, switched=switched, probabilities=numbers)

    def _expects(self, view: View, track: TargetTrack, relative: RelativeState) -> bool:
        """Say whether the track, or while it coasts the forecast, says where the target is."""
        if self._c.memory.mode in TRACKING_MODES:
            return track.age < self._c.plan.lost.coast_s
        return is_acquired(self._c, view, relative)

    def restart(self) -> None:
        """Begin anew, as the operator engages again: what is known of the take-off, and what is done, stays."""
        m = self._c.memory
        self._c = replace(
            self._c,
            memory=Memory(
                origin_ned=m.origin_ned, origin_yaw=m.origin_yaw, origin_known=m.origin_known, followed=m.followed
            ),
        )

    def _note_origin(self, view: View) -> None:
        """Keep the place of the take-off; engaged in flight without one, search at the height that the vehicle has."""
        m = self._c.memory
        if view.flying and m.origin_known:
            return
        m.origin_ned, m.origin_yaw = view.ownship.position_ned, view.ownship.yaw
        if view.flying:
            m.origin_ned = m.origin_ned + np.array([0.0, 0.0, self._c.plan.search.height_m])
        m.origin_known = not view.flying

    def _relative(self, view: View) -> RelativeState | None:
        return relative_state(view, view.track, self._c.parameters.descent) if view.track is not None else None

    def goal(self, view: View, dt: float) -> Goal | None:
        """Give the goal of the present mode, None where nothing is to be flown.

        Args:
            view: of this step.
            dt: time since the last call [s].
        """
        return goal_of(self._c, view, dt)

    def _glimpse(self, view: View, track: TargetTrack) -> None:
        """Search on where the target has just been glimpsed."""
        m = self._c.memory
        m.centre_ned, m.centre_velocity = track.position_ned, np.zeros(3)
        m.centred_at, m.spiral_started = view.t, None

    def _begin_search(self, view: View, previous: Mode) -> None:
        """Begin a search, or go on with one that the camera broke off."""
        m, plan = self._c.memory, self._c.plan
        m.search_started = m.centred_at = view.t
        m.spiral_started = None
        if m.search_left is not None:
            m.search_budget = m.search_left
        else:
            first = previous in (Mode.TAKEOFF, Mode.PREFLIGHT, Mode.TRANSIT)
            m.search_budget = plan.search.timeout_s if first else plan.lost.search_s

    def _end_search(self, view: View, event: Event) -> None:
        m = self._c.memory
        broken_off = event is Event.CAMERA_SILENT
        m.search_left = m.search_budget - (view.t - m.search_started) if broken_off else None
        m.found = event is Event.STEP_COMPLETE

    def _enter(self, view: View, relative: RelativeState | None, event: Event, reason: str) -> Switch:
        m, previous = self._c.memory, self._c.memory.mode
        mode = next_mode(previous, event)
        m.mode, m.t_entered = mode, view.t
        m.dwell_since = m.stopped_since = m.gate_since = None
        m.hold_position, m.hold_yaw = view.ownship.position_ned, view.ownship.yaw
        velocity = view.ownship.velocity_ned - view.velocity_bias_ned
        m.rest_position = m.hold_position + _REST_TIME * velocity
        m.rest_position[2] = m.hold_position[2]
        if mode is Mode.SEARCH:
            self._begin_search(view, previous)
        if previous is Mode.SEARCH:
            self._end_search(view, event)
        if mode is Mode.TRANSIT:
            m.way_from, m.way, m.way_speed, m.path = m.hold_position, 0.0, 0.0, None
        if mode is Mode.APPROACH or previous is Mode.TRANSIT:
            m.search_left = None
            m.looked.forget()
            m.reorient_range = 0.0
            height = relative.height if relative is not None else self._c.plan.search.height_m
            m.approach_height = min(
                max(height, self._c.parameters.descent.align_height_m), self._c.plan.search.height_m
            )
        if mode is Mode.REORIENT and relative is not None:
            m.reorient_range = max(relative.range, 1e-3)
        if event in (Event.SEARCH_EXPIRED, Event.CAMERA_EXPIRED, Event.WAY_UNKNOWN):
            m.wants_return = self._c.plan.lost.then_return
        if mode is Mode.FOLLOW:
            m.follow_started = view.t
        if previous is Mode.FOLLOW and event in (Event.FOLLOW_COMPLETE, Event.STEP_COMPLETE):
            m.followed = True
        if mode is Mode.AUTOPILOT_LAND:
            m.last_seen, m.precland_seen = None, False
        if event is Event.NO_PROGRESS:
            m.attempts += 1
        if mode is Mode.LAND and relative is not None:
            m.attempts += 1
            m.height_reference = m.lowest = relative.height
            m.descent_rate = 0.0
            m.t_progress = view.t
            m.gate_passed = False
        return Switch(t=view.t, mode=mode, reason=reason)
