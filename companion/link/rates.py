"""Ask for messages until they come as often as they should."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.link import incoming
from companion.link.events import RateShort


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageRate:
    """One message that the companion needs."""

    message_id: int
    rate: float  # [Hz] asked
    least: float  # [Hz] that will do


# CURRENT_MODE is sent at once on a change, and about twice a second otherwise, when it is asked for often.
NEEDED = (
    MessageRate(message_id=incoming.ODOMETRY, rate=50.0, least=40.0),
    MessageRate(message_id=incoming.EXTENDED_SYS_STATE, rate=20.0, least=14.0),
    MessageRate(message_id=incoming.CURRENT_MODE, rate=20.0, least=0.8),
    MessageRate(message_id=incoming.ESTIMATOR_STATUS, rate=5.0, least=2.5),
    MessageRate(message_id=incoming.SYS_STATUS, rate=5.0, least=1.5),
    MessageRate(message_id=incoming.BATTERY_STATUS, rate=1.0, least=0.6),
    # the pilot's sticks: there may be no transmitter, and then nothing comes
    MessageRate(message_id=incoming.RC_CHANNELS, rate=20.0, least=0.0),
    MessageRate(message_id=incoming.MANUAL_CONTROL, rate=20.0, least=0.0),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RateParameters:
    """How message rates are watched."""

    period: Annotated[float, Gt(0.0)] = 2.5  # [s] over which arrivals are counted
    attempts: Annotated[int, Ge(1)] = 4  # periods that fall short before it is reported
    patience: Annotated[float, Gt(0.0)] = 10.0  # [s] between further requests once it has been reported


class RateKeeper:
    """Counts arrivals and says what to ask for."""

    def __init__(self, parameters: RateParameters, needed: tuple[MessageRate, ...] = NEEDED) -> None:
        self._parameters = parameters
        self._needed = needed
        self._arrivals = dict.fromkeys((rate.message_id for rate in needed), 0)
        self._short = dict.fromkeys(self._arrivals, 0)
        self._next_request = dict.fromkeys(self._arrivals, float("-inf"))
        self._measured: dict[int, float] = {}
        self._t_start: float | None = None

    def arrived(self, message_id: int) -> None:
        """Count one message."""
        if message_id in self._arrivals:
            self._arrivals[message_id] += 1

    def restart(self) -> None:
        """Ask for everything again: the vehicle has (re)appeared."""
        self._t_start = None

    def measured(self) -> dict[str, float]:
        """Give the rates [Hz] of the last period, by message name."""
        return {incoming.NAMES[message_id]: rate for message_id, rate in self._measured.items()}

    def poll(self, t: float) -> tuple[list[MessageRate], list[RateShort]]:
        """Give the messages to ask for at `t` [s], and those that stay short."""
        if self._t_start is None:
            self._begin(t)
            for message_id in self._short:
                self._short[message_id] = 0
                self._next_request[message_id] = float("-inf")
            return list(self._needed), []
        elapsed = t - self._t_start
        if elapsed < self._parameters.period:
            return [], []
        ask: list[MessageRate] = []
        short: list[RateShort] = []
        for need in self._needed:
            measured = self._arrivals[need.message_id] / elapsed
            self._measured[need.message_id] = measured
            if measured >= need.least:
                self._short[need.message_id] = 0
                continue
            self._short[need.message_id] += 1
            if self._short[need.message_id] == self._parameters.attempts:
                name = incoming.NAMES[need.message_id]
                short.append(RateShort(t=t, message=name, asked=need.rate, measured=measured))
            if self._may_ask(need.message_id, t):
                ask.append(need)
        self._begin(t)
        return ask, short

    def _may_ask(self, message_id: int, t: float) -> bool:
        if self._short[message_id] >= self._parameters.attempts:
            if t < self._next_request[message_id]:
                return False
            self._next_request[message_id] = t + self._parameters.patience
        return True

    def _begin(self, t: float) -> None:
        self._t_start = t
        for message_id in self._arrivals:
            self._arrivals[message_id] = 0
