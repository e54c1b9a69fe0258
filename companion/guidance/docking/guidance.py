"""The docking guidance: modes after Parikh et al. (figures 1 and 4), their goals, and what happens when one fails."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.geometry.arrays import Array
from companion.guidance.docking import checks
from companion.guidance.docking.courses import along_sight, inwards, least_range, round_target, towards, waypoint_of
from companion.guidance.docking.goal_point import ZERO, GoalPoint, Triple, closing_velocity, minus, norm
from companion.guidance.docking.modes import DockingEvent, next_mode
from companion.guidance.docking.parameters import DockingParameters
from companion.guidance.docking.policies import SwitchingPolicy
from companion.guidance.docking.port import DockingSetup, Port, triple
from companion.guidance.docking.turn import Turn
from companion.guidance.docking.view import DockingMemory, DockingView, look
from companion.messages.docking import (
    DockingDecision,
    DockingMode,
    DockingSwitch,
    SwitchingSituation,
    SwitchingVerdict,
)
from companion.messages.proximity import PoseGoal, ProximityState

_ROOM_TOLERANCE = 0.02  # [m] the turn may begin this much nearer than where it must not be flown yet: it starts slowly
_RUN_ON = 0.04  # [m] where the line of sight is left in motion, the goal does not brake for its end
_AT_AIM = 0.02  # [m] nearer to what it aims at, the chaser aligns
_ASKED = (DockingMode.APPROACH, DockingMode.REORIENT, DockingMode.ALIGN)


class DockingGuidance:
    """Decides the mode and gives the pose to be had, once per control period."""

    def __init__(self, parameters: DockingParameters, setup: DockingSetup, policy: SwitchingPolicy) -> None:
        self._p = parameters
        self._setup = setup
        self._policy = policy
        self._port = Port(setup)
        self._goal = GoalPoint(self._port.position, parameters.motion)
        self._memory: DockingMemory | None = None
        self._t = -math.inf

    def step(self, t: float, state: ProximityState, *, contact: bool = False) -> tuple[DockingDecision, PoseGoal]:
        """Decide, and give the goal at `t`; its acceleration holds until the next step.

        Args:
            t: now [s].
            state: the estimate, of now.
            contact: the docking switch is closed.

        Raises:
            ValueError: time runs backwards, or the estimate is not finite.
        """
        m = self._begun(t, state)
        view = look(t, state, goal=self._goal, port=self._port, setup=self._setup, settling=self._p.settling)
        m.vision_since = min(m.vision_since, t) if view.vision else math.inf
        situation, verdict = self._ask(view, state) if not contact else (None, None)
        if m.mode is DockingMode.APPROACH and verdict is not None and verdict.ahead:
            m.ahead = True
        event = self._event(view, verdict, contact=contact)
        near = verdict is not None and verdict.near
        switched = None if event is None else self._enter(view, *event, near=near)
        if m.mode is DockingMode.WAIT:
            self._goal.move_to(view.position)
        elif m.mode is DockingMode.APPROACH:
            self._goal.carry(view.position, self._p.motion.period / self._p.motion.carry_time)
        self._begin_turn(view)
        self._goal.steer(self._wanted(view))
        decision = DockingDecision(
            t=t,
            mode=m.mode,
            switched=switched,
            situation=situation,
            verdict=verdict,
            reorient_range=m.reorient_range,
            align_range=m.align_range,
            failed_attempts=m.failed_attempts,
        )
        return decision, self._pose(t)

    def _begun(self, t: float, state: ProximityState) -> DockingMemory:
        """Move the goal on to `t`; at the first step, begin where the chaser is."""
        if t < self._t:
            raise ValueError(f"the step at {t:.3f} s comes after that at {self._t:.3f} s: time must not run backwards")
        if not math.isfinite(float(np.sum(state.position)) + float(np.sum(state.quaternion))):
            raise ValueError(f"the estimate at {state.t:.3f} s is not finite: it must hold numbers")
        if self._memory is None:
            self._goal.move_to(triple(state.position))
            self._memory = DockingMemory(t_start=t, t_entered=t)
        else:
            self._goal.advance(t - self._t)
        self._t = t
        return self._memory

    @property
    def _m(self) -> DockingMemory:
        if self._memory is None:
            raise RuntimeError("no step was taken yet")
        return self._memory

    def _ask(
        self, view: DockingView, state: ProximityState
    ) -> tuple[SwitchingSituation | None, SwitchingVerdict | None]:
        """Ask the policy where there is a choice; the guidance's own limits overrule it."""
        m, c = self._m, self._p.clearance
        if m.mode not in _ASKED or m.waypoint is not None:
            return None, None
        if m.mode is DockingMode.ALIGN and self._direct(view) is None:
            return None, None
        situation = SwitchingSituation(
            mode=m.mode,
            range=view.range,
            misalignment=view.misalignment,
            mahalanobis=state.mahalanobis,
            position_std=view.position_std,
            vision=view.vision,
            reorient_range=m.reorient_range,
            ahead=m.ahead,
        )
        if m.mode is DockingMode.ALIGN:
            return situation, self._policy.decide(situation)
        if m.mode is DockingMode.APPROACH:
            limit, passed = c.latest_reorient_range, view.range <= c.latest_reorient_range
        else:
            limit = least_range(self._port, view.goal, c)
            passed = self._turned(view) and (self._at_aim(view) or min(view.range, view.goal_range) <= limit)
        verdict = self._policy.decide(situation)
        if passed and not verdict.switch:
            why = "the way ahead ends here" if self._at_aim(view) else f"no nearer than {limit:.3f} m in this mode"
            reason = f"range {view.range:.3f} m: {why} ({verdict.reason})"
            verdict = replace(verdict, switch=True, reason=reason)
        elif verdict.near and not self._turned(view):
            reason = f"not near before the turn is complete ({verdict.reason})"
            verdict = replace(verdict, switch=False, near=False, reason=reason)
        return situation, verdict

    def _at_aim(self, view: DockingView) -> bool:
        """Say whether the goal is where the chaser aims at, ahead of the docking face: the way ends there."""
        aim = self._port.before(self._p.clearance.ahead_range)
        return self._m.ahead and norm(minus(view.goal, aim)) <= _AT_AIM

    def _event(self, view: DockingView, verdict: SwitchingVerdict | None, *, contact: bool) -> checks.Event:
        """Give what leads out of the mode in this step, None: nothing."""
        m, p = self._m, self._p
        if contact:
            return None if m.mode is DockingMode.DOCKED else (DockingEvent.CONTACT, "the docking switch is closed")
        if m.mode in (DockingMode.DOCKED, DockingMode.HOLD):
            return None
        late = checks.check_timeout(m, view, p)
        if late is not None:
            return late
        if m.mode is DockingMode.WAIT:
            return checks.check_wait(m, view, p.settling)
        if m.mode is DockingMode.ALIGN:
            settled = checks.check_align(m, view, self._port, p.settling)
            return settled if verdict is None or not verdict.switch else self._direct(view)
        if m.mode is DockingMode.DOCK:
            return checks.check_dock(m, view, p.corridor)
        if m.mode is DockingMode.RETREAT:
            return checks.check_retreat(m, view, self._port, p)
        return self._next_on_the_way(view, verdict)

    def _next_on_the_way(self, view: DockingView, verdict: SwitchingVerdict | None) -> checks.Event:
        """Give what leads out of approaching and reorienting."""
        m, p = self._m, self._p
        if m.mode is DockingMode.REORIENT:
            direct = self._direct(view)
            if direct is not None:
                return direct
        elif m.waypoint is not None and norm(minus(m.waypoint, view.goal)) <= p.clearance.waypoint_reached:
            m.waypoint = None
        if verdict is None or not verdict.switch:
            return None
        due = DockingEvent.REORIENT_DUE if m.mode is DockingMode.APPROACH else DockingEvent.ALIGN_DUE
        return due, verdict.reason

    def _enter(self, view: DockingView, event: DockingEvent, reason: str, *, near: bool) -> DockingSwitch:
        """Change the mode, and set what the new one needs."""
        m, p = self._m, self._p
        if event is DockingEvent.ATTEMPT_FAILED:
            m.failed_attempts += 1
            if m.failed_attempts >= p.attempts:
                event, reason = DockingEvent.GIVEN_UP, f"{reason}; {m.failed_attempts} attempts used up"
            m.align_range = min((m.align_range or 0.0) + p.settling.further, p.settling.farthest)
        elif event is DockingEvent.POSITION_KNOWN:
            m.waypoint = waypoint_of(self._port, view.position, p.clearance)
        elif event is DockingEvent.REORIENT_DUE:
            m.reorient_range = view.range
        elif event in (DockingEvent.ALIGN_DUE, DockingEvent.DIRECT) and m.mode is not DockingMode.ALIGN:
            floor = p.clearance.least_align_range if self._turned(view) else p.clearance.turning_range
            wanted = p.clearance.near_align_range if near else view.range
            m.align_range = min(max(wanted, floor), p.settling.farthest)
        m.given_up = m.given_up or event is DockingEvent.GIVEN_UP
        m.mode, m.t_entered = next_mode(m.mode, event), view.t
        m.settled_since = m.at_end_since = math.inf
        return DockingSwitch(t=view.t, mode=m.mode, reason=reason)

    def _direct(self, view: DockingView) -> checks.Event:
        """Give the way straight into the port, None: not from here."""
        return checks.check_direct(self._m, view, turned=self._turned(view), p=self._p)

    def _turned(self, view: DockingView) -> bool:
        """Say whether the turn is complete: planned to its end, and flown."""
        turn = self._m.turn
        return turn is not None and view.t >= turn.t_end and view.misalignment <= self._p.clearance.turned

    def _begin_turn(self, view: DockingView) -> None:
        """Begin the turn once it is due and there is room for it; a small one needs none."""
        m, p = self._m, self._p
        if m.turn is not None or m.mode in (DockingMode.WAIT, DockingMode.APPROACH, DockingMode.HOLD):
            return
        room = min(view.range, view.goal_range) >= p.clearance.turning_range - _ROOM_TOLERANCE
        if room or view.misalignment <= p.clearance.turned:
            m.turn = Turn(
                start=self._setup.start_quaternion,
                end=self._setup.quaternion,
                t_start=view.t,
                rate=p.motion.turn_rate,
                ramp=p.motion.turn_ramp,
            )

    def _wanted(self, view: DockingView) -> Triple:
        """Give the velocity [m/s] that the goal is to take up."""
        m, p, goal = self._m, self._p, self._goal.position
        motion = p.motion
        about_to_touch = m.mode is DockingMode.DOCK and view.out <= p.corridor.blind_range
        if (view.silent or view.lead > motion.lead) and not about_to_touch:
            return ZERO
        if m.mode is DockingMode.APPROACH:
            return self._approaching()
        if m.mode is DockingMode.REORIENT:
            nearest = least_range(self._port, goal, p.clearance)
            end = nearest - _RUN_ON if self._turned(view) else max(nearest, p.clearance.turning_range)
            return self._inbound(end, motion.reorient_speed)
        if m.mode is DockingMode.ALIGN:
            return closing_velocity(goal, self._port.before(m.align_range or 0.0), motion.align_speed, motion)
        if m.mode is DockingMode.DOCK:
            return inwards(self._port, goal, speed=motion.dock_speed, corridor=p.corridor, motion=motion)
        if m.mode is DockingMode.RETREAT:
            point = self._port.before(checks.retreat_distance(m, p))
            return closing_velocity(goal, point, motion.align_speed, motion)
        return ZERO

    def _approaching(self) -> Triple:
        m, p, goal = self._m, self._p, self._goal.position
        if m.waypoint is not None:
            return round_target(
                self._port,
                goal,
                m.waypoint,
                speed=p.motion.approach_speed,
                clearance=p.clearance,
                motion=p.motion,
            )
        return self._inbound(p.clearance.turning_range, p.motion.approach_speed)

    def _inbound(self, end_range: float, speed: float) -> Triple:
        """Give the velocity [m/s] towards what is aimed at, no nearer than `end_range` [m]."""
        p, goal = self._p, self._goal.position
        if self._m.ahead:
            aim = self._port.before(p.clearance.ahead_range)
            return towards(self._port, goal, aim, end_range=end_range, speed=speed, motion=p.motion)
        return along_sight(self._port, goal, end_range=end_range, speed=speed, motion=p.motion)

    def _pose(self, t: float) -> PoseGoal:
        quaternion, rate = self._attitude(t)
        goal = self._goal
        return PoseGoal(
            position=np.array(goal.position),
            velocity=np.array(goal.velocity),
            acceleration=np.array(goal.acceleration),
            quaternion=quaternion,
            rate=rate,
        )

    def _attitude(self, t: float) -> tuple[Array, Array]:
        turn = self._m.turn
        return (self._setup.start_quaternion, np.zeros(3)) if turn is None else turn.at(t)
