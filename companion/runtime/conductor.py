"""The ground part of a mission: wait for the vehicle and the operator, engage, arm, and finish.

By itself it engages only where it was told so (`auto_engage`, for simulations). Otherwise the operator does, and does
it again after somebody has taken the vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from companion.config.sections import EngagementSection
from companion.guardian.handover import Order, Stage
from companion.link import events as link_events
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.operator import OperatorOrder
from companion.messages.ownship import FlightMode, VehicleStatus
from companion.preflight.autopilot_parameters import ParameterGate, Rules
from companion.runtime.ports import MissionState, MissionStatus

_ENGAGE_AGAIN_S = 0.5  # an obstacle may have passed by then, such as a late odometry message
_ENGAGE_PATIENCE_S = 2.5  # after the operator's word; shorter than the guardian's side grants
_ORDERED = {
    OperatorOrder.HOLD: "the operator asked for Hold; engage goes on with the mission",
    OperatorOrder.LAND: "the operator asked for the autopilot's Land; engage goes on with the mission",
}
_READ_AGAIN_S = 5.0  # parameters that will not do
_READY = "ready: waiting for the operator to engage"


class Conductor:
    """Holds the mission's state between steps.

    Args:
        parameters: patience.
        rules: what the autopilot's parameters must be; otherwise the mission does not begin.
        mode: of the autopilot in which it takes the vehicle's setpoints.
        auto_engage: engage once telemetry is good, and end when somebody takes the vehicle; otherwise wait for the
            operator, each time.
    """

    def __init__(
        self,
        parameters: EngagementSection,
        rules: Rules,
        *,
        auto_engage: bool,
        mode: FlightMode = FlightMode.OFFBOARD,
    ) -> None:
        self._mode = mode
        self._p = parameters
        self._auto = auto_engage
        self._engaged = False  # the guardian has begun to stream since the operator's word
        self._gate = ParameterGate(rules)
        self._t_asked = -math.inf  # [s] for the autopilot's parameters
        self._ready_since: float | None = None
        self._t_first: float | None = None
        self._t_connected: float | None = None
        self._t_engaged: float | None = None
        self._t_engage_try = self._t_armed_try = -1e9
        self._tries = 0
        self._followed: Switch | None = None
        self._refusals: list[str] = []
        self.status = MissionStatus(
            state=MissionState.WAITING, mode=Mode.PREFLIGHT, reason="waiting for the vehicle", t=0.0
        )

    def stop(self, t: float, reason: str = "stopped by the operator") -> None:
        """End the mission."""
        if not self.status.ended:
            self._set(t, MissionState.ABORTED, self.status.mode, reason)

    def _set(self, t: float, state: MissionState, mode: Mode, reason: str) -> None:
        self.status = MissionStatus(state=state, mode=mode, reason=reason, t=t)

    def update(
        self,
        *,
        t: float,
        vehicle: VehicleStatus,
        telemetry_fresh: bool,
        events: Sequence[link_events.LinkEvent],
        decision: Decision | None,
        muted: bool,
        taken_over: bool,
        guardian: str,
        heard: str,
        operator: Sequence[OperatorOrder] = (),
        missing: str = "",
    ) -> list[Order]:
        """Give the orders of this step.

        Args:
            t: now [s].
            vehicle: mode and health.
            telemetry_fresh: odometry is arriving.
            events: from the link, since the last step.
            decision: the newest of the guidance; one that is older than a step is not followed again.
            muted: the guardian is silent.
            taken_over: since it was engaged, the vehicle has gone to somebody else.
            guardian: why it is in its state, in plain words.
            heard: what the link has heard instead of the vehicle, empty where nothing.
            operator: orders, already accepted by the guardian's side.
            missing: what the mission needs and does not have, in plain words: it does not begin without; or empty.
        """
        if self._t_first is None:
            self._t_first = t
        if vehicle.connected and self._t_connected is None:
            self._t_connected = t
        if self.status.ended:
            return []
        running = self.status.state is MissionState.RUNNING
        self._look(t, vehicle, events, operator)
        if running and not self._auto and self.status.state is MissionState.RUNNING:
            landing = decision is not None and decision.mode is Mode.AUTOPILOT_LAND
            self._watch_engagement(t, muted, taken_over and not landing, guardian)
        if self.status.state is not MissionState.RUNNING:
            if running:
                return [Order.FINISH]
            if self.status.stage is Stage.ENDED:  # by `_look`
                return []
            return [
                *self._read_parameters(t, vehicle),
                *self._wait(t, vehicle, telemetry_fresh, heard, operator, missing),
            ]
        if decision is not None and self._follow(t, decision):
            return [Order.FINISH]
        if decision is not None and decision.mode is Mode.PREFLIGHT:
            return self._prepare(t, vehicle, guardian, idle=muted and not (taken_over and self._auto))
        return []

    def _look(
        self,
        t: float,
        vehicle: VehicleStatus,
        events: Sequence[link_events.LinkEvent],
        operator: Sequence[OperatorOrder],
    ) -> None:
        """See what ends the mission, or makes it wait."""
        for event in events:
            self._note(t, event)
        if self.status.state is MissionState.RUNNING and not vehicle.connected:
            self._set(t, MissionState.LOST, self.status.mode, "the vehicle is lost: its heartbeat has stopped")
        for order in operator:
            if order is OperatorOrder.ABORT:
                self.stop(t)
            elif order in _ORDERED and self.status.state is MissionState.RUNNING:
                self._set(t, MissionState.STANDBY, Mode.PREFLIGHT, _ORDERED[order])

    def _watch_engagement(self, t: float, muted: bool, taken_over: bool, guardian: str) -> None:
        """Wait for the operator again when the vehicle goes to somebody else, or could not be had."""
        if not self._engaged:
            self._engaged = not muted
            if muted and self._t_engaged is not None and t - self._t_engaged > _ENGAGE_PATIENCE_S:
                self._set(t, MissionState.STANDBY, Mode.PREFLIGHT, guardian)
        elif taken_over:
            self._set(t, MissionState.STANDBY, Mode.PREFLIGHT, f"the vehicle is not ours any more: {guardian}")

    def _note(self, t: float, event: link_events.LinkEvent) -> None:
        if isinstance(event, link_events.ArmingRefused):
            self._refusals.extend(reason for reason in event.reasons if reason not in self._refusals)
            if self._tries >= self._p.arm_tries and self.status.state is MissionState.RUNNING:
                self._refuse(t, f"the autopilot refused to arm {self._tries} times")
        if isinstance(event, link_events.ParameterRead):
            self._gate.take(event.name, event.value)
        if isinstance(event, link_events.Connected | link_events.AutopilotRestarted):
            self._gate.forget()
            self._t_asked = -math.inf
        if isinstance(event, link_events.WrongVehicle) and not self.status.ended:
            text = f"the vehicle is a {event.type_name} flown by {event.autopilot}; {event.wanted}"
            self._set(t, MissionState.WRONG_VEHICLE, self.status.mode, text)

    def _refuse(self, t: float, what: str) -> None:
        reasons = "; ".join(self._refusals) or "it gave no reason"
        state = MissionState.REFUSED if self._auto else MissionState.STANDBY
        self._set(t, state, Mode.PREFLIGHT, f"{what}: {reasons}")

    def _read_parameters(self, t: float, vehicle: VehicleStatus) -> list[Order]:
        """Ask for them once; for those that will not do again and again: they may be changed meanwhile."""
        again = self._gate.complete and bool(self._gate.objections()) and t - self._t_asked >= _READ_AGAIN_S
        if not vehicle.connected or not (again or self._t_asked == -math.inf):
            return []
        self._t_asked = t
        return [Order.READ_PARAMETERS]

    def _wait(
        self,
        t: float,
        vehicle: VehicleStatus,
        telemetry_fresh: bool,
        heard: str,
        operator: Sequence[OperatorOrder],
        missing: str,
    ) -> list[Order]:
        if not self._auto and (vehicle.connected or self.status.state is MissionState.STANDBY):
            return self._stand_by(t, vehicle, operator, missing)
        ready = vehicle.connected and telemetry_fresh and vehicle.estimate_valid and not missing
        if not ready:
            self._ready_since = None
            self._lose_patience(t, telemetry_fresh, heard, missing)
            return []
        if vehicle.armed:
            self._set(
                t,
                MissionState.REFUSED,
                Mode.PREFLIGHT,
                "the vehicle is already armed: a mission begins on the ground, disarmed",
            )
            return []
        if self._ready_since is None:
            self._ready_since = t
        if t - self._ready_since < self._p.ready_s or not self._gate.complete:
            return []
        unsafe = self._unsafe()
        if unsafe:
            self._set(t, MissionState.REFUSED, Mode.PREFLIGHT, unsafe)
            return []
        return self._engage(t, "telemetry is good: engaging")

    def _unsafe(self) -> str:
        """Say which of the autopilot's parameters stand against flying; empty where none does."""
        objections = self._gate.objections()
        advice = "set them with the ground station, or accept them in preflight.autopilot of the configuration"
        return f"the autopilot's parameters are not safe: {'; '.join(objections)}: {advice}" if objections else ""

    def _engage(self, t: float, reason: str) -> list[Order]:
        self._t_engaged = self._t_engage_try = t
        self._t_armed_try, self._tries, self._engaged = -1e9, 0, False
        self._refusals.clear()
        self._set(t, MissionState.RUNNING, Mode.PREFLIGHT, reason)
        return [Order.ENGAGE]

    def _stand_by(
        self, t: float, vehicle: VehicleStatus, operator: Sequence[OperatorOrder], missing: str
    ) -> list[Order]:
        missing = (self._unsafe() or missing) if self._gate.complete else "reading the autopilot's parameters"
        if not vehicle.connected:
            self._t_first, self._t_connected = t, None
            self._set(t, MissionState.WAITING, Mode.PREFLIGHT, "the vehicle is lost: waiting for its heartbeat")
        elif missing:
            if self.status.reason != missing:
                self._set(t, MissionState.WAITING, Mode.PREFLIGHT, missing)
        elif OperatorOrder.ENGAGE in operator:
            return self._engage(t, "the operator engages")
        elif self.status.state is MissionState.WAITING:
            self._set(t, MissionState.STANDBY, Mode.PREFLIGHT, _READY)
        return []

    def _lose_patience(self, t: float, telemetry_fresh: bool, heard: str, missing: str) -> None:
        if self._t_connected is not None:
            if t - self._t_connected > self._p.ready_timeout_s:
                missing = missing or "its position estimate is not valid"
                missing = missing if telemetry_fresh else "no odometry arrives"
                self._set(t, MissionState.REFUSED, Mode.PREFLIGHT, f"the autopilot is not ready to fly: {missing}")
        elif self._t_first is not None and t - self._t_first > self._p.vehicle_timeout_s:
            found = heard or "nothing at all was heard; check the autopilot's power and where its MAVLink goes"
            text = f"no vehicle: no heartbeat within {self._p.vehicle_timeout_s:g} s; {found}"
            self._set(t, MissionState.NO_VEHICLE, Mode.PREFLIGHT, text)

    def _prepare(self, t: float, vehicle: VehicleStatus, guardian: str, *, idle: bool) -> list[Order]:
        """Bring it to our mode, then arm; `idle`: the guardian found an obstacle and is to be asked again."""
        if vehicle.mode is not self._mode:
            if self._t_engaged is not None and t - self._t_engaged > self._p.offboard_timeout_s:
                said = f" (guardian: {guardian})" if guardian else ""
                self._refuse(t, f"the autopilot did not enter {self._mode.value}{said}")
                return [Order.FINISH]
            if idle and t - self._t_engage_try >= _ENGAGE_AGAIN_S:
                self._t_engage_try = t
                return [Order.ENGAGE]
            return []
        if vehicle.armed or t - self._t_armed_try < self._p.arm_interval_s:
            return []
        if self._tries >= self._p.arm_tries:
            self._refuse(t, f"the autopilot did not arm in {self._tries} tries")
            return [Order.FINISH]
        self._tries += 1
        self._t_armed_try = t
        return [Order.ARM]

    def _follow(self, t: float, decision: Decision) -> bool:
        if decision.switched is None or decision.switched is self._followed:
            return False
        self._followed = decision.switched
        state = MissionState.RUNNING
        if decision.mode is Mode.DONE:
            on_ground = self.status.mode in (Mode.TOUCHDOWN, Mode.AUTOPILOT_LAND)
            state = MissionState.LANDED if on_ground else MissionState.HELD
        elif decision.mode is Mode.ABORT:
            state = MissionState.ABORTED
        self._set(t, state, decision.mode, decision.switched.reason)
        return self.status.ended or decision.mode is Mode.AUTOPILOT_LAND
