"""Listen to the autopilot for a while: bytes and the time go in, a report comes out. It never arms or changes anything.

It asks for message rates and reads parameters, as every flight does first; nothing else is ever sent.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from companion.estimation.ownship import OwnshipHistory, OwnshipHistoryParameters
from companion.link.autopilot_link import AutopilotLink
from companion.link.events import AutopilotIdentified, EstimatorReset, Lost, ParameterRead, WrongVehicle
from companion.link.statistics import LinkStatistics
from companion.link.status import Health
from companion.messages.ownship import VehicleStatus

_KEPT_S = 3.0  # of our own motion, beyond the time of listening


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """What was heard."""

    heard: bool  # a heartbeat of the configured vehicle
    wrong: WrongVehicle | None  # another vehicle than the program flies
    lost: int  # times that its heartbeat stopped
    status: VehicleStatus
    health: Health
    identified: AutopilotIdentified | None
    statistics: LinkStatistics
    parameters: dict[str, float | None]  # by name; None: the autopilot gives none
    resets: int  # of its estimator, while listening


class VehicleListener:
    """Listens.

    Args:
        link: to the vehicle; nobody else uses it.
        listen_s: how long, from the first heartbeat [s].
        patience_s: how long the first heartbeat is waited for [s].
        parameters: names of those that are read.
    """

    def __init__(
        self, link: AutopilotLink, *, listen_s: float, patience_s: float, parameters: Collection[str] = ()
    ) -> None:
        self._wanted = tuple(parameters)
        self._link = link
        self._listen = listen_s
        self._patience = patience_s
        self._t_first: float | None = None
        self._t_heard: float | None = None
        self._wrong: WrongVehicle | None = None
        self._parameters: dict[str, float | None] = {}
        self._resets = self._lost = 0
        self.history = OwnshipHistory(
            OwnshipHistoryParameters(duration=listen_s + _KEPT_S, capacity=max(1024, round(100 * listen_s)))
        )

    def tick(self, t: float, received: Sequence[tuple[float, bytes]]) -> list[bytes]:
        """Take what has come until `t` [s]; give what is to be sent. To be called 50 times a second."""
        if self._t_first is None:
            self._t_first = t
        for t_arrival, datagram in received:
            self._link.receive(datagram, t_arrival)
        for state in self._link.take_ownship():
            self.history.add(state)
        for event in self._link.events():
            if isinstance(event, ParameterRead):
                self._parameters[event.name] = event.value
            elif isinstance(event, WrongVehicle):
                self._wrong = event
            elif isinstance(event, EstimatorReset):
                self._resets += 1
            elif isinstance(event, Lost):
                self._lost += 1
        if self._t_heard is None and self._link.status(t).connected:
            self._t_heard = t
            for name in self._wanted:
                self._link.request_parameter(name)
        return self._link.poll(t)

    def done(self, t: float) -> bool:
        """Tell whether enough has been heard, or nothing for too long."""
        if self._wrong is not None:
            return True
        if self._t_heard is not None:
            return t - self._t_heard >= self._listen
        return self._t_first is not None and t - self._t_first >= self._patience

    def report(self, t: float) -> VehicleReport:
        """Say what was heard until `t` [s]."""
        return VehicleReport(
            heard=self._t_heard is not None,
            wrong=self._wrong,
            lost=self._lost,
            status=self._link.status(t),
            health=self._link.health(),
            identified=self._link.identified,
            statistics=self._link.statistics(),
            parameters=dict(self._parameters),
            resets=self._resets,
        )
