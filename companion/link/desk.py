"""The commands of one vehicle: at most one mode change and one arming or disarming at a time."""

from __future__ import annotations

from collections.abc import Callable

from companion.link import incoming, outgoing
from companion.link.arming import RefusalCollector
from companion.link.commands import CommandParameters, PendingCommand
from companion.link.events import ArmingRefused, CommandFinished
from companion.link.modes import mode_numbers
from companion.messages.ownship import FlightMode

_ACCEPTED = 0


class CommandDesk:
    """Sends commands until they are acknowledged and the state shows them, or gives them up.

    Args:
        encoder: builds the datagrams.
        refusals: told of refused arm commands; collects the reasons.
        parameters: how long and how often.
    """

    def __init__(self, encoder: outgoing.Encoder, refusals: RefusalCollector, parameters: CommandParameters) -> None:
        self._encoder = encoder
        self._refusals = refusals
        self._parameters = parameters
        self._pending: dict[int, PendingCommand] = {}  # by MAV_CMD
        self._ended: list[CommandFinished] = []
        self._urgent: list[bytes] = []

    def request_mode(self, mode: FlightMode, t: float, *, obstacle: str | None) -> None:
        """Ask for a mode; `obstacle` says why nothing can be sent.

        Raises:
            ValueError: the companion never asks for this mode.
        """
        main, sub = mode_numbers(mode)
        self._start(
            outgoing.SET_MODE, f"mode {mode.value}", mode, lambda: self._encoder.set_mode(main, sub), t, obstacle
        )

    def arm(self, arm: bool, t: float, *, obstacle: str | None) -> None:
        """Ask to arm or disarm; `obstacle` says why nothing can be sent."""
        if arm:
            self._refusals.requested()
        label = "arm" if arm else "disarm"
        self._start(outgoing.ARM_DISARM, label, arm, lambda: self._encoder.arm(arm), t, obstacle)

    def acknowledge(self, ack: incoming.CommandAck, t: float) -> None:
        """Take an answer of the autopilot."""
        command = self._pending.get(ack.command)
        if command is not None and command.acknowledge(ack.result, t):
            # The state would otherwise show only with the next heartbeat, up to 1 s later.
            self._urgent.append(self._encoder.request_message(incoming.HEARTBEAT))

    def observe_armed(self, armed: bool) -> None:
        """Take the armed state of a heartbeat."""
        command = self._pending.get(outgoing.ARM_DISARM)
        if command is not None:
            command.observe(armed)

    def observe_mode(self, mode: FlightMode, previous: FlightMode) -> bool:
        """Take the mode that the autopilot reports; give whether it is the one that we have asked for."""
        command = self._pending.get(outgoing.SET_MODE)
        if command is None or not command.sent:
            return False
        command.observe(mode)
        if mode == command.goal:
            return True
        if mode != previous:
            command.cancel(f"dropped: someone else changed the mode to {mode.value}")
        return False

    def cancel_all(self, reason: str) -> None:
        """Give up everything that is under way."""
        for command in self._pending.values():
            command.cancel(reason)

    def poll(
        self, t: float, status: incoming.SysStatus | None, mode: FlightMode
    ) -> tuple[list[bytes], list[CommandFinished | ArmingRefused]]:
        """Give the datagrams that are due at `t` [s], and what has ended."""
        ended: list[CommandFinished | ArmingRefused] = [*self._ended]
        due, self._urgent, self._ended = self._urgent, [], []
        for identifier, command in tuple(self._pending.items()):
            end = command.finished(t)
            if end is None:
                due += command.due(t)
                continue
            del self._pending[identifier]
            ended.append(end)
            if command.goal is True and not end.accepted and end.result not in (None, _ACCEPTED):
                self._refusals.refused(end.result, t)
                due.append(self._encoder.run_prearm_checks())
        refusal = self._refusals.due(t, status, mode)
        if refusal is not None:
            ended.append(refusal)
        return due, ended

    def _start(
        self,
        identifier: int,
        label: str,
        goal: FlightMode | bool,
        build: Callable[[], bytes],
        t: float,
        obstacle: str | None,
    ) -> None:
        running = self._pending.pop(identifier, None)
        if running is not None:
            running.cancel("replaced by a newer command")
            self._end(running, t)
        command = PendingCommand(label=label, goal=goal, build=build, parameters=self._parameters)
        if obstacle is None:
            self._pending[identifier] = command
        else:
            command.cancel(f"not sent: {obstacle}")
            self._end(command, t)

    def _end(self, command: PendingCommand, t: float) -> None:
        end = command.finished(t)
        if end is not None:
            self._ended.append(end)
