"""Commands that are under way: sent, acknowledged, confirmed by the state, or given up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.link.events import CommandFinished
from companion.messages.ownship import FlightMode

_ACCEPTED, _IN_PROGRESS = 0, 5
_RESULTS = {
    0: "accepted",
    1: "temporarily rejected: not possible now",
    2: "denied",
    3: "not supported",
    4: "failed",
    5: "in progress",
    6: "cancelled",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandParameters:
    """How long a command is waited for, and how often it is sent."""

    attempts: Annotated[int, Ge(1)] = 3
    ack_timeout: Annotated[float, Gt(0.0)] = 0.5  # [s] without any answer, until it is sent again
    state_timeout: Annotated[float, Gt(0.0)] = 1.5  # [s] after the ACK, until the state must show it (heartbeat: 1 Hz)


def result_text(result: int | None) -> str:
    """Give the plain words of a MAV_RESULT; None: no answer came."""
    if result is None:
        return "no answer"
    return _RESULTS.get(result, f"result {result}")


class PendingCommand:
    """One command on its way.

    PX4 answers DO_SET_MODE twice, the first time always with "accepted". So an accepting answer counts only once the
    state has followed, and a refusing one counts at once.

    Args:
        label: what the operator reads, such as "mode OFFBOARD".
        goal: the mode, or whether armed, that ends it well.
        build: makes the datagram anew for each attempt.
        parameters: how long and how often.
    """

    def __init__(
        self,
        *,
        label: str,
        goal: FlightMode | bool,
        build: Callable[[], bytes],
        parameters: CommandParameters,
    ) -> None:
        self.label = label
        self.goal = goal
        self._build = build
        self._parameters = parameters
        self._t_waiting_since = 0.0
        self._sent = 0
        self._result: int | None = None
        self._refused = False
        self._reached = False
        self._cancelled: str | None = None

    @property
    def sent(self) -> bool:
        """Whether it has been sent at least once."""
        return self._sent > 0

    def acknowledge(self, result: int, t: float) -> bool:
        """Take an answer; give whether it is the first accepting one."""
        if not self.sent:
            return False
        first = self._result is None
        self._result = result
        if result == _IN_PROGRESS:
            self._t_waiting_since = t
            return False
        if result != _ACCEPTED:
            self._refused = True
            return False
        if first:
            self._t_waiting_since = t
        return first

    def observe(self, state: FlightMode | bool) -> None:
        """Take a state that the autopilot reported after the command was sent."""
        if self.sent:
            self._reached = state == self.goal

    def cancel(self, reason: str) -> None:
        """Give up: something else has decided."""
        self._cancelled = reason

    def due(self, t: float) -> list[bytes]:
        """Give the datagram of an attempt that is due, and count it as sent."""
        if self._sent and (t - self._t_waiting_since < self._timeout() or self._sent >= self._parameters.attempts):
            return []
        self._sent += 1
        self._t_waiting_since = t
        return [self._build()]

    def finished(self, t: float) -> CommandFinished | None:
        """Give the end of it, once it has ended."""
        if self._cancelled is not None:
            return self._end(t, False, self._cancelled)
        if self._refused:
            return self._end(t, False, result_text(self._result))
        late = self.sent and t - self._t_waiting_since >= self._timeout()
        if self._reached and (self._result == _ACCEPTED or late):
            return self._end(t, True, "done" if self._result == _ACCEPTED else "done, though no answer came")
        if late and self._sent >= self._parameters.attempts:
            text = "no answer" if self._result is None else "accepted, but the autopilot did not do it"
            return self._end(t, False, f"{text} after {self._sent} attempts")
        return None

    def _timeout(self) -> float:
        return self._parameters.ack_timeout if self._result is None else self._parameters.state_timeout

    def _end(self, t: float, accepted: bool, text: str) -> CommandFinished:
        return CommandFinished(t=t, command=self.label, accepted=accepted, result=self._result, text=text)
