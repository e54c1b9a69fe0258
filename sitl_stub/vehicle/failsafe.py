"""PX4's failsafe state machine: which action the active failures ask for, when, and when a user may take over.

Follows commander/failsafe/framework.cpp of PX4 v1.17. What counts as a failure is in `failsafe_conditions.py`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from sitl_stub.vehicle.failsafe_actions import (
    ACTION_MODES,
    Action,
    Cause,
    Clear,
    FailsafeFlags,
    Notification,
    Response,
    Takeover,
)
from sitl_stub.vehicle.modes import Mode

_LADDER = (
    Action.FALLBACK_POSITION,
    Action.FALLBACK_ALTITUDE,
    Action.FALLBACK_STABILIZED,
    Action.HOLD,
    Action.RETURN,
    Action.LAND,
    Action.DESCEND,
)
"""An action whose mode cannot run falls through to the next one, at the end to TERMINATE."""
_NEVER_DELAYED = frozenset({Action.NONE, Action.WARN, Action.HOLD, Action.DISARM, Action.TERMINATE})
_TAKEOVER_NEEDED = frozenset({Action.HOLD, Action.RETURN, Action.LAND, Action.DESCEND})
"""Actions that fly by themselves; the stick modes need no takeover."""


@dataclass(slots=True)
class _Active:
    response: Response
    action: Action
    takeover: Takeover
    failing: bool = True


@dataclass(slots=True)
class FailsafeState:
    """Result of one update."""

    action: Action = Action.NONE
    intended: Mode = Mode.AUTO_LOITER
    """The user's mode; a takeover by sticks changes it."""
    notifications: list[Notification] = field(default_factory=list)
    took_over: bool = False
    """A user has just ended a failsafe."""

    @property
    def mode(self) -> Mode:
        """The mode in force."""
        return ACTION_MODES.get(self.action, self.intended)


class FailsafeMachine:
    """Holds the active failures and the delay before an action (COM_FAIL_ACT_T)."""

    def __init__(self, parameters: Mapping[str, float], t: float) -> None:
        self._parameters = parameters
        self._active: dict[str, _Active] = {}
        self._t = t
        self._delay = 0.0
        """Rest [s] of Hold before the action."""
        self._start_delay = float(parameters["COM_FAIL_ACT_T"])
        self._action = Action.NONE
        self._intended = Mode.AUTO_LOITER
        self._armed = False
        self._user_has_it = False
        self._notify = False

    @property
    def action(self) -> Action:
        """The action in force."""
        return self._action

    @property
    def active(self) -> bool:
        """Whether a failsafe changes what the vehicle does."""
        return self._action > Action.WARN

    def update(
        self,
        t: float,
        failures: Mapping[str, Response],
        fallback: Callable[[Mode], Action],
        flags: FailsafeFlags,
        *,
        armed: bool,
        intended: Mode,
        mode_changed: bool,
        sticks: bool,
    ) -> FailsafeState:
        """Judge the failures at `t` [s].

        Args:
            failures: what each present failure asks for, by name.
            fallback: gives the action for a mode whose own needs are not met (NONE when they are).
            flags: what is wrong; actions whose mode cannot run are replaced.
            armed: whether the motors may turn.
            intended: the user's mode.
            mode_changed: the user has asked for a mode since the last update, the same one included.
            sticks: moved sticks ask for a takeover.
        """
        elapsed, self._t = t - self._t, t
        if armed != self._armed:
            self._drop(Clear.ON_MODE_CHANGE_OR_DISARM)
            self._user_has_it = False
        mode_changed |= intended is not self._intended
        if mode_changed or self._user_has_it:
            self._drop(Clear.ON_MODE_CHANGE_OR_DISARM)
        self._delay = max(0.0, self._delay - elapsed)
        self._collect(failures, Response(action=fallback(intended), takeover=Takeover.ALWAYS))
        if self._action > Action.HOLD or not flags.can_run(Mode.AUTO_LOITER) or self._user_has_it:
            self._delay = 0.0
        state, delayed, cause = self._select(fallback, flags, armed, intended, mode_changed, sticks)
        change = -elapsed if delayed is not Action.NONE else elapsed / 4.0
        self._start_delay = max(0.0, min(float(self._parameters["COM_FAIL_ACT_T"]), self._start_delay + change))
        if state.action > self._action or (state.action is not Action.NONE and self._notify):
            state.notifications.append(
                Notification(
                    intended=intended, action=state.action, delayed=delayed, cause=cause, delay=int(self._delay + 0.5)
                )
            )
        self._notify = False
        self._intended, self._action, self._armed = state.intended, state.action, armed
        return state

    def _drop(self, clear: Clear) -> None:
        """Drop actions that waited for this; those whose failure persists stay."""
        for name in [n for n, a in self._active.items() if not a.failing and a.response.clear is clear]:
            del self._active[name]

    def _collect(self, failures: Mapping[str, Response], fallback: Response) -> None:
        present = dict(failures)
        if fallback.action is not Action.NONE:
            present["mode fallback"] = fallback
        for name, response in present.items():
            known = self._active.get(name)
            if known is not None:
                known.failing, known.action = True, response.action
            else:
                self._begin(name, response)
        for name in [n for n in self._active if n not in present]:
            active = self._active[name]
            if active.response.clear is Clear.AT_ONCE:
                del self._active[name]
            else:
                active.failing = False

    def _begin(self, name: str, response: Response) -> None:
        takeover = response.takeover
        if takeover is Takeover.AUTO:
            delayed = self._parameters["COM_FAIL_ACT_T"] > 0.1
            if delayed and response.action is not Action.WARN and self._delay == 0.0:
                self._delay = self._start_delay
            takeover = Takeover.ALWAYS if delayed else Takeover.MODE_SWITCH_ONLY
        self._active[name] = _Active(response, response.action, takeover)
        self._notify |= response.action is Action.WARN
        if response.action >= Action.HOLD:
            self._user_has_it = False

    def _select(
        self,
        fallback: Callable[[Mode], Action],
        flags: FailsafeFlags,
        armed: bool,
        intended: Mode,
        mode_changed: bool,
        sticks: bool,
    ) -> tuple[FailsafeState, Action, Cause]:
        state = FailsafeState(intended=intended)
        if intended is Mode.TERMINATION or self._action is Action.TERMINATE:
            state.action = Action.TERMINATE
            return state, Action.NONE, Cause.GENERIC
        if not armed:
            return state, Action.NONE, Cause.GENERIC
        action, cause, takeover = self._worst()
        delayed = Action.NONE
        if (
            self._delay > 0.0
            and not self._user_has_it
            and takeover <= Takeover.MODE_SWITCH_ONLY
            and action not in _NEVER_DELAYED
        ):
            action, delayed, takeover = Action.HOLD, action, Takeover.MODE_SWITCH_ONLY
        by_mode = mode_changed and self._action > Action.WARN
        wanted = self._user_has_it or by_mode or (sticks and takeover is Takeover.ALWAYS)
        taken = False
        if action in _TAKEOVER_NEEDED and wanted and takeover <= Takeover.MODE_SWITCH_ONLY:
            if sticks and not self._user_has_it:
                state.intended = Mode.POSCTL
            action, delayed, taken = Action.WARN, Action.NONE, True
            state.took_over = not self._user_has_it
            action = max(action, fallback(state.intended))
        self._user_has_it = taken
        possible = _possible(action, flags)
        if possible is not action:
            action, cause = possible, Cause.GENERIC
        action, delayed = _already_on_the_way(state.intended, action, delayed, flags)
        state.action = action
        return state, delayed, cause

    def _worst(self) -> tuple[Action, Cause, Takeover]:
        action, cause, takeover = Action.NONE, Cause.GENERIC, Takeover.ALWAYS
        for active in self._active.values():
            takeover = max(takeover, active.takeover)
            if active.action > action:
                action, cause = active.action, active.response.cause
        return action, cause, takeover


def _possible(action: Action, flags: FailsafeFlags) -> Action:
    """The action itself, or the next one down the ladder whose mode can run."""
    if action not in _LADDER:
        return action
    for candidate in _LADDER[_LADDER.index(action) :]:
        if flags.can_run(ACTION_MODES[candidate]):
            return candidate
    return Action.TERMINATE


def _already_on_the_way(intended: Mode, action: Action, delayed: Action, flags: FailsafeFlags) -> tuple[Action, Action]:
    """A vehicle that lands or returns at its user's wish is not sent home again: a warning is enough."""
    ends = {Mode.AUTO_LAND: {Action.RETURN}, Mode.AUTO_RTL: {Action.RETURN}}
    ends[Mode.AUTO_PRECLAND] = {Action.RETURN, Action.LAND}
    if intended in ends and flags.can_run(intended) and ends[intended] & {action, delayed}:
        return Action.WARN, Action.NONE
    return action, delayed
