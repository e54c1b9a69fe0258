"""Map the autopilot's boot time to the companion's clock.

Each exchange gives one sample (RFC 5905, section 8, with the server's turnaround taken as zero):

    offset = (t_sent + t_received) / 2 - boot,    |error| <= round_trip / 2

and the samples of a sliding window are fitted by a straight line, weighted by 1 / (floor + round_trip - least)^2, so
that slow exchanges hardly count and a clock that runs at another rate (a paced simulator) leaves no bias.

An exchange cannot tell a slow way out from a slow way back. But no message arrives before it was stamped: where stamps
come out later than their arrival, the mapping is moved back by the excess, up to half the least round trip.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class TimesyncParameters:
    """Tuning of the clock mapping."""

    rate: Annotated[float, Gt(0.0), Le(50.0)] = 10.0  # [Hz] requests
    window: Annotated[float, Gt(0.0)] = 4.0  # [s] of samples kept
    floor: Annotated[float, Gt(0.0)] = 0.0005  # [s] round-trip differences below this mean nothing
    longest_round_trip: Annotated[float, Gt(0.0)] = 0.25  # [s] slower exchanges are dropped
    slope_span: Annotated[float, Gt(0.0)] = 1.5  # [s] of samples before a rate difference is estimated
    largest_slope: Annotated[float, Ge(0.0)] = 0.02  # rate difference of the two clocks
    jump: Annotated[float, Gt(0.0)] = 0.05  # [s] a sample off by more than half its round trip plus this is a jump
    jumps_to_restart: Annotated[int, Ge(1)] = 3  # so many jumps in a row start the mapping anew


_GRID = 1e-6  # [s] ticks that fall on a request up to rounding count as there


class _Sample(NamedTuple):
    t: float  # [s] middle of the exchange, companion clock
    offset: float  # [s] companion minus boot
    round_trip: float  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimesyncStatistics:
    """How good the mapping is."""

    requests: int  # sent since the start
    samples: int  # accepted since the start
    rejected: int  # answers that fitted no request, or came too late
    restarts: int
    offset: float | None  # [s] companion minus boot, newest
    slope: float  # rate difference
    round_trip_least: float | None  # [s] in the window
    round_trip_median: float | None  # [s] in the window
    round_trip_most: float | None  # [s] in the window


class TimesyncClient:
    """Keeps the mapping from answered TIMESYNC requests."""

    def __init__(self, parameters: TimesyncParameters) -> None:
        self._parameters = parameters
        self._outstanding: dict[int, float] = {}
        self._samples: deque[_Sample] = deque()
        self._jumps: list[_Sample] = []
        self._reference = 0.0  # [s] companion time of the line's origin
        self._offset: float | None = None
        self._slope = 0.0
        self._least = 0.0  # [s] shortest round trip in the window
        self._excess = [0.0, 0.0]  # [s] latest stamp after its arrival: in this half of the window, in the one before
        self._t_half = float("-inf")
        self._next_request = float("-inf")
        self._requests = 0
        self._accepted = 0
        self._rejected = 0
        self._restarts = 0

    def request(self, t: float) -> int | None:
        """Give the ts1 [ns] of a request that is due at `t` [s], or None."""
        if t < self._next_request - _GRID:
            return None
        self._next_request = t + 1.0 / self._parameters.rate
        stamp = max(1, round(t * 1e9))
        self._outstanding[stamp] = t
        self._requests += 1
        while len(self._outstanding) > 16:
            del self._outstanding[next(iter(self._outstanding))]
        return stamp

    def answer(self, *, tc1: int, ts1: int, t: float) -> None:
        """Take an answer: `tc1` [ns] boot time, `ts1` [ns] from our request, received at `t` [s]."""
        sent = self._outstanding.pop(ts1, None)
        if sent is None or tc1 <= 0 or not 0.0 <= t - sent <= self._parameters.longest_round_trip:
            self._rejected += 1
            return
        middle = 0.5 * (sent + t)
        sample = _Sample(middle, middle - tc1 * 1e-9, t - sent)
        if self._is_jump(sample):
            self._jumps.append(sample)
            if len(self._jumps) < self._parameters.jumps_to_restart:
                self._rejected += 1
                return
            self._samples.clear()
            self._samples.extend(self._jumps[:-1])
            self._excess = [0.0, 0.0]
            self._restarts += 1
        self._jumps.clear()
        self._accepted += 1
        self._samples.append(sample)
        while self._samples[0].t < sample.t - self._parameters.window:
            self._samples.popleft()
        self._fit()

    def forget(self) -> None:
        """Start anew: the autopilot has restarted."""
        self._samples.clear()
        self._jumps.clear()
        self._offset = None
        self._slope = 0.0
        self._excess = [0.0, 0.0]
        self._restarts += 1

    def map(self, boot: float, t_arrival: float) -> float:
        """Give the companion time [s] of boot time `boot` [s] in a message that arrived at `t_arrival` [s].

        Before the first exchange, and for a stamp that makes no sense, that is the arrival itself; never later.
        """
        if self._offset is None:
            return t_arrival
        mapped = self._reference + (boot + self._offset - self._reference) / (1.0 - self._slope)
        self._watch_causality(mapped - t_arrival, t_arrival)
        return min(mapped - self._asymmetry(), t_arrival)

    def boot_time(self, t: float) -> float:
        """Give the boot time [s] at companion time `t` [s]; `t` itself before the first exchange."""
        if self._offset is None:
            return t
        t = t + self._asymmetry()
        return t - self._offset - self._slope * (t - self._reference)

    def statistics(self) -> TimesyncStatistics:
        """Give how good the mapping is."""
        trips = sorted(sample.round_trip for sample in self._samples)
        return TimesyncStatistics(
            requests=self._requests,
            samples=self._accepted,
            rejected=self._rejected,
            restarts=self._restarts,
            offset=self._offset,
            slope=self._slope,
            round_trip_least=trips[0] if trips else None,
            round_trip_median=trips[len(trips) // 2] if trips else None,
            round_trip_most=trips[-1] if trips else None,
        )

    def _watch_causality(self, excess: float, t: float) -> None:
        """Note by how much a stamp came out later than its arrival at `t` [s]."""
        if t - self._t_half > 0.5 * self._parameters.window:
            self._t_half = t
            self._excess = [0.0, self._excess[0]]
        self._excess[0] = max(self._excess[0], excess)

    def _asymmetry(self) -> float:
        """Give how much too late [s] the exchanges place a stamp; half the round trip is the most they can."""
        return min(max(self._excess), 0.5 * self._least)

    def _is_jump(self, sample: _Sample) -> bool:
        if self._offset is None:
            return False
        expected = self._offset + self._slope * (sample.t - self._reference)
        drift = self._parameters.largest_slope * (sample.t - self._reference)
        return abs(sample.offset - expected) > 0.5 * sample.round_trip + self._parameters.jump + drift

    def _fit(self) -> None:
        """Fit offset(t) = offset + slope (t - reference) to the window."""
        least = min(sample.round_trip for sample in self._samples)
        self._least = least
        reference = self._samples[-1].t
        origin = self._samples[-1].offset
        total = along = square = value = cross = 0.0
        for sample in self._samples:
            weight = (self._parameters.floor + sample.round_trip - least) ** -2
            x, y = sample.t - reference, sample.offset - origin
            total += weight
            along += weight * x
            square += weight * x * x
            value += weight * y
            cross += weight * x * y
        mean_x, mean_y = along / total, value / total
        slope = 0.0
        spread = square / total - mean_x * mean_x
        # A window in which only a few exchanges carry the weight says nothing of the rate.
        enough = reference - self._samples[0].t >= self._parameters.slope_span
        if enough and spread > (0.2 * self._parameters.slope_span) ** 2:
            slope = (cross / total - mean_x * mean_y) / spread
            slope = max(-self._parameters.largest_slope, min(self._parameters.largest_slope, slope))
        self._reference = reference
        self._offset = origin + mean_y - slope * mean_x
        self._slope = slope
