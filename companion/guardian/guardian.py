"""The only sender of setpoints."""

from __future__ import annotations

import math
from dataclasses import replace

from companion.geometry.angles import wrap_angle
from companion.guardian.engagement import Circumstances, obstacle
from companion.guardian.intake import newest_ownship, reference_from, target_now, vector
from companion.guardian.limiter import Reference
from companion.guardian.machine import Event, update
from companion.guardian.motion import Vector, add
from companion.guardian.parameters import GuardianParameters
from companion.guardian.pilot import NO_SIGNS, PilotWatch
from companion.guardian.shaping import Shaper, Tick
from companion.guardian.situation import Situation, classify
from companion.messages.guardian import GuardianOutput, GuardianState, ModeRequest
from companion.messages.motion import AnySetpoint, SticksSetpoint, Trajectory
from companion.messages.ownship import FlightMode, OwnshipState, VehicleStatus
from companion.messages.target import TargetPose

__all__ = ["Guardian", "GuardianOutput"]

_S = GuardianState
_SILENT_STATES = frozenset({_S.MUTED, _S.GAP, _S.LEAVING})
_WAITING_STATES = frozenset({_S.PRESTREAM, _S.REQUESTING})
_TRACKING_STATES = frozenset({_S.FOLLOWING, _S.HOLDING, _S.BLIND})
_LEAVING_OWN_MODE = frozenset({_S.HANDOVER, _S.LEAVING})


class Guardian:
    """Samples the planner's trajectory, keeps it in its limits and decides alone who flies.

    It starts muted, and sends nothing until the operator engages. Call `tick` at 50 Hz; send what it gives at once,
    and once. It reads no clock and raises nothing on bad data.

    Args:
        parameters: of the guardian.
        shaper: makes the vehicle's setpoints, inside its limits.
    """

    def __init__(self, parameters: GuardianParameters, shaper: Shaper) -> None:
        self._parameters = parameters  # its fence moved to where it stands
        self._fence = parameters.fence  # about the place of the take-off
        self._shaper = shaper
        self._state = _S.MUTED
        self._reason = "waiting for the operator to engage"
        self._t = -math.inf  # of the last tick
        self._t_entered = -math.inf  # the state
        self._t_sent = -math.inf  # of the last setpoint
        self._t_followable = -math.inf  # last instant with a trajectory to follow, or on the ground
        self._t_requested = -math.inf
        self._requests_made = 0
        self._pilot = PilotWatch(parameters.stick_travel)
        self._mode_before = FlightMode.UNKNOWN
        self._status: VehicleStatus | None = None  # at the last tick
        self._mode_engaged: FlightMode | None = None  # when the operator engaged; None: not known
        self._was_armed = False
        self._taken_over = False
        self._ownship: OwnshipState | None = None
        self._engage = self._disengage = self._finish = False

    @property
    def state(self) -> GuardianState:
        """Who flies now."""
        return self._state

    @property
    def mode(self) -> FlightMode:
        """The autopilot's mode in which it takes our setpoints."""
        return self._shaper.mode

    @property
    def commanding(self) -> bool:
        """Whether the autopilot is in our mode, on this guardian's setpoints."""
        return self._state in _TRACKING_STATES

    @property
    def taken_over(self) -> bool:
        """Whether, since the operator engaged, the vehicle has gone to somebody else before the mission's end."""
        return self._taken_over

    def engage(self, t: float) -> None:  # noqa: ARG002  # the next tick decides; `t` keeps the events' form
        """Tell that the operator engages: the next tick begins to stream, or says why not."""
        self._engage = True
        self._mode_engaged = None if self._status is None else self._status.mode

    def obstacle(self) -> str:
        """Say what speaks against engaging, as things stood at the last tick; empty where nothing does."""
        age = math.inf if self._ownship is None else self._t - self._ownship.t
        return obstacle(self._circumstances(self._status, age, None), self._parameters)

    def disengage(self, t: float) -> None:  # noqa: ARG002
        """Tell that the vehicle is to be given back: brake, ask for Hold, fall silent when it is there."""
        self._disengage = True

    def finish(self, t: float) -> None:  # noqa: ARG002
        """Tell that the mission is over: as soon as the vehicle is disarmed, fall silent and leave OFFBOARD."""
        self._finish = True

    def tick(
        self,
        t: float,
        ownship: OwnshipState | None,
        status: VehicleStatus | None,
        trajectory: Trajectory | None,
        target: TargetPose | None,
    ) -> GuardianOutput:
        """Decide what is sent now.

        Args:
            t: now [s]; greater than at the tick before, otherwise nothing is sent.
            ownship: the newest known, however old.
            status: the newest known of the autopilot.
            trajectory: the planner's newest.
            target: where the target is about now, for the closing speed.
        """
        if not self._t < t < math.inf:
            return self._output(t, None, None, (), "the clock did not advance")
        pause = t - self._t if math.isfinite(self._t) else 0.0
        self._t = t
        self._take_ownship(ownship, t)
        age = math.inf if self._ownship is None else t - self._ownship.t
        armed = status is not None and status.armed
        if status is not None and not armed and age <= self._parameters.ownship_stale:
            self._place_fence(self._here(age))
        reference, why = self._reference(trajectory, t, armed)
        event = self._event(t, status, age, pause, reference is not None)
        self._status = status
        before = self._state
        self._enter(update(before, event), event, status, t)
        if armed and self._state is not _S.MUTED:
            self._was_armed = True
        if before is not _S.MUTED or event is not Event.STAY:
            self._explain(event, before, why)
        clips: tuple[str, ...] = ()
        setpoint = None
        if self._state not in _SILENT_STATES and age <= self._parameters.ownship_lost:
            tick = self._ticked(t, pause, age)
            clips = self._advance(tick, armed, reference, target)
            setpoint = self._shaper.setpoint(tick)
            if setpoint is not None:
                self._t_sent = t
            if isinstance(setpoint, SticksSetpoint):
                self._pilot.own_sticks(t, setpoint)
        return self._output(t, setpoint, self._request(before, status, t), clips, self._reason)

    def _take_ownship(self, given: OwnshipState | None, t: float) -> None:
        """Keep the newest own state; a reset of the estimate moves the command along with it."""
        known = self._ownship
        newest = newest_ownship(known, given, t)
        self._ownship = newest
        if known is None or newest is None or newest.reset_counter == known.reset_counter:
            return
        between = newest.t - known.t
        expected = add(vector(known.position_ned.tolist()), vector(known.velocity_ned.tolist()), between)
        offset = add(vector(newest.position_ned.tolist()), expected, -1.0)
        self._parameters = replace(self._parameters, fence=self._parameters.fence.moved(offset))
        self._shaper.rebase(offset, wrap_angle(newest.yaw - known.yaw), between)

    def _place_fence(self, place: Vector) -> None:
        """Put the fence about where the vehicle stands: there it will take off. In flight it stays."""
        self._parameters = replace(self._parameters, fence=self._fence.moved(place))

    def _reference(self, trajectory: Trajectory | None, t: float, armed: bool) -> tuple[Reference | None, str]:
        if self._state not in _TRACKING_STATES or self._ownship is None:
            return None, "a gap is over: holding here first"
        if not armed:
            self._t_followable = t
            return None, "on the ground, disarmed"
        reference, why = reference_from(trajectory, t, self._ownship.reset_counter, self._parameters)
        if reference is not None:
            self._t_followable = t
        return reference, why

    def _event(self, t: float, status: VehicleStatus | None, age: float, pause: float, followable: bool) -> Event:
        engage = False
        if self._engage and self._state is _S.MUTED:
            against = obstacle(self._circumstances(status, age, self._mode_engaged), self._parameters)
            engage = not against
            if against:
                self._reason = f"cannot engage: {against}"
        situation = Situation(
            state=self._state,
            status=status,
            own_mode=self._shaper.mode,
            mode_before=self._mode_before,
            signs=NO_SIGNS if status is None or self._state is _S.MUTED else self._pilot.look(status),
            was_armed=self._was_armed,
            ownship_age=age,
            pause=pause,
            silent_for=t - self._t_sent,
            in_state_for=t - self._t_entered,
            unfollowed_for=t - self._t_followable,
            followable=followable,
            unanswered=self._requests_made >= self._parameters.request_tries
            and t - self._t_requested >= self._parameters.request_interval,
            engage=engage,
            disengage=self._disengage,
            finish=self._finish,
        )
        self._engage = self._disengage = False
        return classify(situation, self._parameters)

    def _circumstances(
        self, status: VehicleStatus | None, age: float, mode_engaged: FlightMode | None
    ) -> Circumstances | None:
        if status is None:
            return None
        return Circumstances(
            status=status,
            mode_engaged=mode_engaged,
            ownship_age=age,
            speed=0.0 if self._ownship is None else math.hypot(*self._ownship.velocity_ned.tolist()),
            outside=self._parameters.fence.excess(self._here(age)) if math.isfinite(age) else 0.0,
        )

    def _enter(self, state: GuardianState, event: Event, status: VehicleStatus | None, t: float) -> None:
        """Change the state, if it does change, and set its clocks."""
        if state is self._state:
            return
        if state is _S.MUTED:
            self._was_armed = self._finish = False
        if state in (_S.MUTED, _S.HANDOVER) and self._state is not _S.LEAVING:
            self._taken_over = True
        if event is Event.ENGAGE and status is not None:
            self._mode_before = status.mode
            self._pilot.begin(status)
            self._finish = self._taken_over = False
        if event is Event.IN_OWN_MODE or self._state is _S.GAP:
            self._t_followable = t
        if state in _SILENT_STATES:
            self._shaper.clear()
        if state in _LEAVING_OWN_MODE or state is _S.REQUESTING:
            self._requests_made = 0
        self._state, self._t_entered = state, t

    def _explain(self, event: Event, before: GuardianState, why: str) -> None:
        """Keep the reason of the newest change."""
        if self._state is _S.FOLLOWING or (self._state is _S.HOLDING and event is Event.NOTHING_TO_FOLLOW):
            self._reason = why
        elif self._state is not before:
            self._reason = event.value

    def _ticked(self, t: float, dt: float, age: float) -> Tick:
        return Tick(
            t=t,
            dt=dt,
            ownship=self._ownship,
            here=self._here(age),
            fresh=age <= self._parameters.ownship_stale,
            parameters=self._parameters,
        )

    def _advance(
        self, tick: Tick, armed: bool, reference: Reference | None, target: TargetPose | None
    ) -> tuple[str, ...]:
        """Move the command on by one tick; give what clipped it."""
        if self._shaper.empty or (tick.fresh and (self._state in _WAITING_STATES or not armed)):
            self._shaper.hold(tick)
            return ()
        if self._state is _S.FOLLOWING and reference is not None:
            return self._shaper.follow(tick, reference, target_now(target, tick.t))
        return self._shaper.brake(tick)

    def _request(self, before: GuardianState, status: VehicleStatus | None, t: float) -> ModeRequest | None:
        """Ask for the state's mode on entering it, and again after a while, a few times."""
        own_mode = self._shaper.mode
        if self._state is _S.REQUESTING:
            wanted = ModeRequest(own_mode)
        elif self._state in _LEAVING_OWN_MODE:
            wanted = ModeRequest.HOLD
        else:
            return None
        in_own_mode = status is not None and status.mode is own_mode
        if wanted is ModeRequest.HOLD and not in_own_mode and before is not _S.REQUESTING:
            return None
        again = t - self._t_requested >= self._parameters.request_interval
        if self._requests_made > 0 and (not again or self._requests_made >= self._parameters.request_tries):
            return None
        self._requests_made += 1
        self._t_requested = t
        return wanted

    def _here(self, age: float) -> Vector:
        """Give the vehicle's position [m] now, moved on at its velocity."""
        if self._ownship is None:
            return 0.0, 0.0, 0.0
        return add(
            vector(self._ownship.position_ned.tolist()), vector(self._ownship.velocity_ned.tolist()), max(age, 0.0)
        )

    def _output(
        self,
        t: float,
        setpoint: AnySetpoint | None,
        request: ModeRequest | None,
        clips: tuple[str, ...],
        reason: str,
    ) -> GuardianOutput:
        return GuardianOutput(t=t, state=self._state, setpoint=setpoint, request=request, clips=clips, reason=reason)
