"""What the guardian's side tells the planner in each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from companion.link.events import LinkEvent
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.operator import OperatorOrder
from companion.messages.ownship import OwnshipState, VehicleStatus


@dataclass(slots=True, kw_only=True)
class TickStatistics:
    """How well the guardian's ticks kept their time."""

    ticks: int = 0
    missed: int = 0  # periods in which there was no tick
    late_max_s: float = 0.0  # longest delay of a tick
    step_max_s: float = 0.0  # longest tick
    frames: int = 0  # searched by the detector


@dataclass(slots=True, kw_only=True, eq=False)
class Telemetry:
    """Facts of the link and of the guardian, as they are before the guardian's tick."""

    t: float  # [s] of the tick
    datagrams: Sequence[tuple[float, bytes]]  # that came, with their arrival [s]; for the recording
    states: Sequence[OwnshipState]  # own motion since the last one, in order of time
    vehicle: VehicleStatus
    events: Sequence[LinkEvent]  # since the last one
    state: GuardianState
    taken_over: bool  # since the operator engaged, the vehicle has gone to somebody else
    output: GuardianOutput | None  # of the last tick
    sent: Sequence[bytes]  # at the last tick; for the recording
    orders: Sequence[OperatorOrder]  # accepted since the last one
    heard: str  # what the link has heard instead of a vehicle that is missing; empty where nothing
    ticks: TickStatistics | None = None  # None: time is virtual

    @property
    def guardian_reason(self) -> str:
        """Why the guardian is in its state, in plain words."""
        return "" if self.output is None else self.output.reason
