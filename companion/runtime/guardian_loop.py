"""The guardian's process in real time: 50 Hz, and nothing that could hold up a tick."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Annotated, Protocol

from annotated_types import Gt

from companion.clock import Clock
from companion.guardian.handover import Stage
from companion.link.transport import Transport
from companion.messages.guardian import GuardianState
from companion.messages.operator import OperatorOrder
from companion.runtime.channel import PlannerPort
from companion.runtime.helm import Helm
from companion.runtime.planner import TICK_S
from companion.runtime.service import ServiceNotifier
from companion.runtime.telemetry import TickStatistics

Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardianLoopParameters:
    """Patience at the end."""

    drain_s: Positive = 3.0  # after the mission's end or the operator's stop, to leave OFFBOARD properly
    answer_s: Positive = 1.0  # that a silent planner may take to notice the operator's stop


class GroundStation(Protocol):
    """A ground station with an address of its own."""

    def send(self, data: bytes) -> None:
        """Send one datagram; must not block."""


class GuardianLoop:
    """Ticks the guardian's side until the mission is over and the vehicle given back, or the planner is gone.

    A tick that comes late is run at once and the next one keeps its place; ticks that were missed altogether are not
    made up for.

    Args:
        helm: the guardian's side.
        transport: to the autopilot, open.
        planner: the other process.
        clock: the one that stamps datagrams, here and in the planner.
        parameters: patience.
        notifier: of the service manager; its watchdog is kicked by the ticks.
        stop: set where the operator asks for an orderly end: brake, hand over to the autopilot's Hold, then return.
        ground: takes what is for the ground station's own address; None: there is none.
    """

    def __init__(
        self,
        *,
        helm: Helm,
        transport: Transport,
        planner: PlannerPort,
        clock: Clock,
        parameters: GuardianLoopParameters,
        notifier: ServiceNotifier,
        stop: asyncio.Event,
        ground: GroundStation | None = None,
    ) -> None:
        self._helm = helm
        self._transport = transport
        self._planner = planner
        self._clock = clock
        self._p = parameters
        self._notifier = notifier
        self._stop = stop
        self._ground = ground
        self._t_end: float | None = None  # [s] at which it ends at the latest
        self._said = ""
        self.statistics = TickStatistics()

    async def run(self) -> None:
        """Guard until the end."""
        due, stopping = self._clock.now(), False
        while True:
            now = self._clock.now()
            if now < due:
                await asyncio.sleep(due - now)
                continue
            self._tick(now)
            self._note_time(due, now)
            due = max(due + TICK_S, now)
            if self._stop.is_set() and not stopping:
                stopping = True
                self._helm.order(OperatorOrder.ABORT)
                self._t_end = now + self._p.drain_s
            if self._over(now, stopping):
                return
            await asyncio.sleep(0.0)

    def _tick(self, t: float) -> None:
        telemetry = self._helm.receive(t, self._transport.receive())
        telemetry.ticks = self.statistics
        self._planner.send(telemetry)
        handover = self._planner.receive()
        output = self._helm.tick(t, handover)
        for datagram in output.datagrams:
            self._transport.send(datagram)
        if self._ground is not None:
            for datagram in output.ground:
                self._ground.send(datagram)
        self._notifier.tick(t)
        if handover is not None and handover.reason != self._said:
            self._said = handover.reason
            self._notifier.status(f"{handover.stage.value}: {handover.reason}")

    def _over(self, now: float, stopping: bool) -> bool:
        """Say whether nothing is left to do."""
        muted = self._helm.state is GuardianState.MUTED
        ended = self._helm.stage is Stage.ENDED
        if self._planner.closed:
            if muted:
                return True
            self._helm.planner_gone(now)
        if (ended or stopping) and self._t_end is None:
            self._t_end = now + self._p.drain_s
        if self._t_end is None:
            return False
        silent = self._helm.planner_age(now) > self._p.answer_s
        return now >= self._t_end or (muted and (ended or (stopping and silent)))

    def _note_time(self, due: float, began: float) -> None:
        late, statistics = began - due, self.statistics
        statistics.ticks += 1
        statistics.missed += int(late / TICK_S)
        statistics.late_max_s = max(statistics.late_max_s, late)
        statistics.step_max_s = max(statistics.step_max_s, self._clock.now() - began)
