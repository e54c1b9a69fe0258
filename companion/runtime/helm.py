"""The guardian's side: the link, the guardian, and who may engage it.

All that can move the vehicle goes through here. It needs the planner for nothing but the trajectory: without one the
guardian brakes, hovers, and gives the vehicle to the autopilot. In flight it runs in a process of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.guardian.guardian import Guardian
from companion.guardian.handover import Handover, Order, Stage
from companion.link.autopilot_link import AutopilotLink
from companion.link.events import Connected, LinkEvent
from companion.messages.decision import Mode
from companion.messages.guardian import GuardianOutput, GuardianState, ModeRequest
from companion.messages.operator import Answer, OperatorOrder
from companion.messages.ownship import FlightMode, LandedState, OwnshipState, VehicleStatus
from companion.runtime.guardian_announcer import NEAR_GROUND_PARAMETER, GuardianAnnouncer, GuardianGlance
from companion.runtime.telemetry import Telemetry

_S = GuardianState
_GIVING_BACK = frozenset({_S.HANDOVER, _S.LEAVING})
_PRECLAND_TRIES = 2  # times that the precision landing is asked for; then Hold
_GRANT_S = 3.0  # [s] within which the mission must have engaged after the operator's word


@dataclass(frozen=True, slots=True, kw_only=True)
class HelmParameters:
    """What the mission may ask of the guardian's side."""

    auto_engage: bool = False  # the mission engages by itself, once: for simulations
    arm_tries: Annotated[int, Ge(1)] = 3  # in one engagement
    arm_interval_s: Annotated[float, Gt(0.0)] = 2.0
    handover_age_s: Annotated[float, Gt(0.0)] = 0.5  # after its arrival a handover says nothing any more
    parameters: tuple[str, ...] = ()  # of the autopilot, that preflight judges
    landing_targets: bool = False  # the mission lets the autopilot land by itself, and tells it where the pad is


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HelmOutput:
    """What a tick decided and what is to be sent."""

    guardian: GuardianOutput
    datagrams: Sequence[bytes]  # to the autopilot
    ground: Sequence[bytes]  # to the ground station's own address, where there is one


class Helm:
    """Decides what is sent to the autopilot.

    In each tick: `receive` what came, then `tick` with what the planner has handed over since the last one.

    Args:
        link: to the autopilot.
        guardian: muted.
        parameters: what the mission may ask for.
        announcer: what this side tells people.
    """

    def __init__(
        self, *, link: AutopilotLink, guardian: Guardian, parameters: HelmParameters, announcer: GuardianAnnouncer
    ) -> None:
        self._link = link
        self._guardian = guardian
        self._p = parameters
        self._announcer = announcer
        self._events: Sequence[LinkEvent] = ()  # since the last tick
        self._told = 0  # texts of the planner that have been passed on
        self._precland_asked = 0
        self._granted_until = math.inf if parameters.auto_engage else -math.inf  # [s] the mission may engage
        self._newest: OwnshipState | None = None
        self._vehicle: VehicleStatus | None = None
        self._handover: Handover | None = None
        self._t_handover = -math.inf
        self._landing = False  # the operator wants the autopilot to land
        self._armings = 0
        self._t_armed = -math.inf
        self._t = -math.inf
        self._orders: list[OperatorOrder] = []
        self._answers: list[bytes] = []
        self._output: GuardianOutput | None = None
        self._sent: Sequence[bytes] = ()

    @property
    def state(self) -> GuardianState:
        """Who flies now."""
        return self._guardian.state

    @property
    def output(self) -> GuardianOutput | None:
        """What the last tick decided."""
        return self._output

    @property
    def vehicle(self) -> VehicleStatus | None:
        """The vehicle's mode and health at the last tick."""
        return self._vehicle

    @property
    def stage(self) -> Stage:
        """How far the mission is, by the planner's last word."""
        return Stage.WAITING if self._handover is None else self._handover.stage

    @property
    def reason(self) -> str:
        """Why it is there, by the planner's last word."""
        return "" if self._handover is None else self._handover.reason

    def planner_age(self, t: float) -> float:
        """Give the time [s] since the planner's last word; infinite before the first."""
        return t - self._t_handover

    def planner_gone(self, t: float) -> None:
        """The planner will not come back: on the ground leave OFFBOARD; in the air its silence is answer enough."""
        self._granted_until = -math.inf
        if self._vehicle is not None and not self._vehicle.armed:
            self._guardian.finish(t)

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram comes from the configured vehicle."""
        return self._link.recognises(datagram)

    def receive(self, t: float, datagrams: Sequence[tuple[float, bytes]]) -> Telemetry:
        """Take what came from the autopilot since the last tick, with its time of arrival [s]; give the facts."""
        self._t = t
        for t_arrival, datagram in datagrams:
            self._link.receive(datagram, t_arrival)
        states = self._link.take_ownship()
        if states:
            self._newest = states[-1]
        vehicle = self._vehicle = self._link.status(t)
        for request in self._link.operator.take():
            accepted = request.order is not None and self.order(request.order).accepted
            self._answers.append(self._link.operator.answer(request, accepted=accepted))
        self._events = self._link.events()
        if self._p.landing_targets and any(isinstance(event, Connected) for event in self._events):
            self._link.request_parameter(NEAR_GROUND_PARAMETER)
        orders, self._orders = self._orders, []
        return Telemetry(
            t=t,
            datagrams=datagrams,
            states=states,
            vehicle=vehicle,
            events=self._events,
            state=self._guardian.state,
            taken_over=self._guardian.taken_over,
            output=self._output,
            sent=self._sent,
            orders=orders,
            heard="" if vehicle.connected else self._link.statistics().heard_instead,
        )

    def tick(self, t: float, handover: Handover | None) -> HelmOutput:
        """Decide what is sent now.

        Args:
            t: now [s].
            handover: that came since the last tick, None where none did; the last one's trajectory goes on until it
                expires.
        """
        vehicle = self._vehicle = self._link.status(t)
        if handover is not None:
            self._handover, self._t_handover = handover, t
            for order in Order:
                if order in handover.orders:
                    self._obey(order, t, vehicle)
        alive = self._handover if self.planner_age(t) <= self._p.handover_age_s else None
        before = self._guardian.state
        output = self._guardian.tick(
            t,
            self._newest,
            vehicle,
            None if alive is None else alive.trajectory,
            None if alive is None else alive.target,
        )
        self._follow_state(before, output.state)
        self._announce(vehicle, output, handover)
        datagrams, self._answers = self._answers, []
        if output.request is not None:
            mode = self._mode_for(output.request)
            self._precland_asked += mode is FlightMode.AUTO_PRECLAND
            self._link.request_mode(mode, t)
        datagrams += self._link.poll(t)
        target = None if handover is None else handover.news.landing_target
        if target is not None and self._p.landing_targets:
            datagrams += self._link.landing_target(target)
        if output.setpoint is not None:
            datagrams.append(self._link.setpoint(output.setpoint, t))
        self._output, self._sent = output, datagrams
        return HelmOutput(guardian=output, datagrams=datagrams, ground=self._link.pilot.take_ground())

    def _announce(self, vehicle: VehicleStatus, output: GuardianOutput, handover: Handover | None) -> None:
        """Tell people what is new: of the mission as the planner has put it, of the rest without asking it."""
        pilot, known = self._link.pilot, self._handover
        if handover is not None:
            news = handover.news
            fresh = min(news.said - self._told, len(news.texts))
            self._told = max(self._told, news.said)
            for text in news.texts[len(news.texts) - fresh :] if fresh > 0 else ():
                pilot.say(text)
            pilot.show(news.values)
        glance = GuardianGlance(
            vehicle=vehicle, guardian=output, mission=None if known is None else known.news, events=self._events
        )
        self._events = ()
        for text in self._announcer.news(glance):
            pilot.say(text)
        pilot.present(self._announcer.stand(glance), Mode.PREFLIGHT if known is None else known.news.mode)

    def give_back(self, t: float) -> None:
        """Give the vehicle to the autopilot's Hold: brake, ask for it, fall silent when it is there."""
        self._granted_until = -math.inf
        self._guardian.disengage(t)

    def order(self, order: OperatorOrder) -> Answer:
        """Take an order of the operator, as things stood at the last tick."""
        if order is OperatorOrder.ENGAGE:
            against = self.against_engaging()
            if against:
                return Answer(accepted=False, text=f"cannot engage: {against}")
            self._granted_until = self._t + _GRANT_S
            self._orders.append(order)
            return Answer(accepted=True, text="engaging")
        silent = self._guardian.state is _S.MUTED
        if silent and order is not OperatorOrder.ABORT:
            mode = "unknown" if self._vehicle is None else self._vehicle.mode.value
            return Answer(accepted=False, text=f"the vehicle is not flown by this program: its mode is {mode}")
        self._landing = order is OperatorOrder.LAND
        self.give_back(self._t)
        self._orders.append(order)
        if silent:
            return Answer(accepted=True, text="the mission is over; nothing was flown by this program")
        receiver = self._mode_for(ModeRequest.HOLD).value
        ends = "is over" if order is OperatorOrder.ABORT else "waits for engage"
        return Answer(accepted=True, text=f"braking, then {receiver}; the mission {ends}")

    def against_engaging(self) -> str:
        """Say what speaks against engaging, as things stood at the last tick; empty where nothing does."""
        state, handover = self._guardian.state, self._handover
        if state in _GIVING_BACK:
            return "the vehicle is just being given back; try again when it has left our mode"
        if state is not _S.MUTED:
            return "it is engaged already"
        if handover is None or self.planner_age(self._t) > self._p.handover_age_s:
            return "the planner is silent"
        if handover.stage is not Stage.STANDBY:
            return f"the mission is {handover.stage.value}: {handover.reason}"
        return self._guardian.obstacle()

    def _obey(self, order: Order, t: float, vehicle: VehicleStatus) -> None:
        """Do what the mission asks for, where it may."""
        if order is Order.READ_PARAMETERS:
            for name in self._p.parameters:
                self._link.request_parameter(name)
        elif order is Order.ENGAGE:
            if t <= self._granted_until:
                self._guardian.engage(t)
        elif order is Order.ARM:
            if self._may_arm(t, vehicle):
                self._armings += 1
                self._t_armed = t
                self._link.arm(t)
        elif vehicle.armed:
            self._guardian.disengage(t)
        else:
            self._guardian.finish(t)

    def _may_arm(self, t: float, vehicle: VehicleStatus) -> bool:
        return (
            self._guardian.commanding
            and vehicle.mode is self._guardian.mode
            and not vehicle.armed
            and vehicle.landed in (LandedState.ON_GROUND, LandedState.UNDEFINED)
            and self._armings < self._p.arm_tries
            and t - self._t_armed >= self._p.arm_interval_s - 1e-6
        )

    def _follow_state(self, before: GuardianState, state: GuardianState) -> None:
        """Silence ends what was granted and what was under way: no mode, no arming is asked for again."""
        if before is _S.MUTED and state is not _S.MUTED:
            self._armings, self._t_armed, self._landing, self._precland_asked = 0, -math.inf, False, 0
        if state is _S.MUTED and before is not _S.MUTED:
            self._granted_until = -math.inf
            self._link.cancel_commands("the guardian is silent")

    def _mode_for(self, request: ModeRequest) -> FlightMode:
        """Give the mode for a request; the receiver of the vehicle is the operator's choice, then the mission's."""
        if request is not ModeRequest.HOLD:
            return request.mode
        if self._landing:
            return FlightMode.AUTO_LAND
        receiver = FlightMode.AUTO_LOITER if self._handover is None else self._handover.receiver
        refused = receiver is FlightMode.AUTO_PRECLAND and self._precland_asked >= _PRECLAND_TRIES
        return FlightMode.AUTO_LOITER if refused else receiver
