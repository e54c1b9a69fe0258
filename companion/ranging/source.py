"""Opens the ranging input of a configuration and delivers its readings."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from companion.clock import Clock
from companion.errors import InputError
from companion.link.endpoints import Endpoint, UdpEndpoint, parse_endpoint
from companion.link.stream_transport import StreamTransport
from companion.link.transport import Transport, UdpTransport
from companion.messages.proximity import RangeReading
from companion.ranging.decoder import RangingDecoder, RangingStatistics
from companion.ranging.lines import LineFramer, decode_line
from companion.ranging.packet import decode_packet, is_packet
from companion.ranging.parameters import NO_INPUT, RangingParameters
from companion.ranging.survey import AnchorSurvey
from companion.ranging.wire import Fault, WireMessage

EXAMPLES = ("udp://0.0.0.0:14660", "serial:///dev/ttyUSB0?baud=115200", "none")
_PORTED = re.compile(r".*:[0-9]+/?")

# What DWM1001's shell wants before it prints ranges: two returns, then, a second later, the command. `lec` switches the
# output on or off, so it is sent only after silence.
_SHELL = b"\r\r"
_PRINT = b"lec\r"
_SHELL_PAUSE = 1.1  # [s]
_WAKE_INTERVAL = 5.0  # [s] between tries


@dataclass(frozen=True, slots=True, kw_only=True)
class RangesSilent:
    """No usable range for too long."""

    t: float  # [s]
    silence: float  # [s] since the last one, or since the source was opened
    reason: str  # plain: what is known of the cause

    def __str__(self) -> str:
        """Give it in plain words."""
        return f"no ranges for {self.silence:.1f} s: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class RangesBack:
    """Usable ranges come again, after a silence."""

    t: float  # [s]

    def __str__(self) -> str:
        """Give it in plain words."""
        return "ranges come again"


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingRemark:
    """Something that the operator should know."""

    t: float  # [s]
    text: str

    def __str__(self) -> str:
        """Give it in plain words."""
        return self.text


RangingEvent = RangesSilent | RangesBack | RangingRemark


class RangingSource:
    """Readings from one transport. Synchronous: `poll` takes what the transport has received since the last call.

    Args:
        transport: gives one message as one datagram.
        decoder: of the transport's format.
        parameters: when it counts as silent, and whether the shell of a DWM1001 is then asked for ranges.
        t: [s] instant at which it was opened.
    """

    def __init__(self, transport: Transport, decoder: RangingDecoder, parameters: RangingParameters, t: float) -> None:
        self._transport = transport
        self._decoder = decoder
        self._silence = parameters.silence_s
        self._wakes = parameters.dwm1001_shell
        self._t_reading = t  # arrival of the newest
        self._silent = False
        self._since_silence = decoder.statistics()
        self._events: list[RangingEvent] = []
        self._t_shell: float | None = None  # when the shell was called
        self._t_woken = float("-inf")  # when it was told to print

    def poll(self, t: float) -> tuple[RangeReading, ...]:
        """Give the readings that have come until `t` [s], in the order of arrival; each once. Never raises."""
        readings: list[RangeReading] = []
        for t_arrival, data in self._transport.receive():
            decoded = self._decoder.decode(data, t_arrival)
            self._events += [RangingRemark(t=t_arrival, text=text) for text in decoded.remarks]
            if decoded.readings:
                self._heard(t_arrival)
                readings += decoded.readings
        self._look(t)
        return tuple(readings)

    def events(self) -> list[RangingEvent]:
        """Give what has happened since the last call; each trouble once when it begins, and its end once."""
        events, self._events = self._events, []
        return events

    def silence(self, t: float) -> float:
        """Give for how long [s] there has been no usable range, at `t` [s]."""
        return max(0.0, t - self._t_reading)

    def statistics(self) -> RangingStatistics:
        """Give what has been counted."""
        return self._decoder.statistics()

    async def close(self) -> None:
        """Close the transport."""
        await self._transport.close()

    def _heard(self, t: float) -> None:
        if self._silent:
            self._events.append(RangesBack(t=t))
        self._silent = False
        self._t_reading = t
        self._t_shell = None
        self._since_silence = self._decoder.statistics()

    def _look(self, t: float) -> None:
        """Notice silence."""
        silence = self.silence(t)
        if silence < self._silence:
            return
        if not self._silent:
            self._silent = True
            reason = _cause(self._since_silence, self._decoder.statistics())
            self._events.append(RangesSilent(t=t, silence=silence, reason=reason))
        if self._wakes:
            self._wake(t)

    def _wake(self, t: float) -> None:
        """Ask a shell that is silent for ranges."""
        if self._t_shell is None:
            if t - self._t_woken >= _WAKE_INTERVAL:
                self._t_shell = t
                self._transport.send(_SHELL)
        elif t - self._t_shell >= _SHELL_PAUSE:
            self._t_shell, self._t_woken = None, t
            self._transport.send(_PRINT)


def parse_ranging_input(text: str) -> Endpoint | None:
    """Read where ranges come from; None for "none".

    Raises:
        InputError: it is no such place.
    """
    if text.strip() == NO_INPUT:
        return None
    try:
        endpoint = parse_endpoint(text)
    except InputError as error:
        right = f"write it as one of {', '.join(EXAMPLES)}"
        raise InputError([replace(problem, right=right) for problem in error.problems]) from None
    if text.strip().startswith(("udp://", "tcp://")) and not _PORTED.fullmatch(text.strip()):
        raise InputError.single(
            source=text, wrong=f"{text!r}: the port is missing", right=f"write it as one of {', '.join(EXAMPLES)}"
        )
    return endpoint


async def open_ranging(parameters: RangingParameters, survey: AnchorSurvey, clock: Clock) -> RangingSource | None:
    """Open the input that is configured; None where there is none.

    Args:
        parameters: the section `ranging` of the configuration.
        survey: the anchors.
        clock: stamps arrivals.

    Raises:
        InputError: the input is wrong.
        VehicleError: the port or device cannot be opened.
    """
    endpoint = parse_ranging_input(parameters.input)
    if endpoint is None:
        return None
    decode: Callable[[bytes], WireMessage | Fault]
    transport: Transport
    if isinstance(endpoint, UdpEndpoint):
        decode, transport = decode_packet, await UdpTransport.open(endpoint, clock=clock, recognises=is_packet)
    else:
        decode = decode_line
        transport = await StreamTransport.open(endpoint, clock=clock, framer=LineFramer())
    decoder = RangingDecoder(decode, survey, parameters)
    return RangingSource(transport, decoder, parameters, clock.now())


def _cause(before: RangingStatistics, now: RangingStatistics) -> str:
    """Say what has come instead of ranges."""
    if now.messages == before.messages:
        return "nothing comes; check power, cable, address and rate of the radio"
    grown = {fault: count - before.faults.get(fault, 0) for fault, count in now.faults.items()}
    worst = max(grown, key=lambda fault: grown[fault], default=None)
    if worst is None or not grown[worst]:
        return "the radio hears no anchor; check that the anchors have power"
    return f"of {now.messages - before.messages} messages none was usable; most often: {worst.value}"
