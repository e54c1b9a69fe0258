"""The autopilot's own estimate of a companion's clock, from replies to its TIMESYNC requests (lib/timesync, v1.17)."""

import math

CONVERGENCE_SAMPLES = 500
ROUND_TRIP_MAX_US = 10_000
"""Slower replies are dropped [us]."""
DEVIATION_MAX_US = 100_000
"""A converged estimate does not take samples farther off than this [us]..."""
DEVIATIONS_MAX = 10
"""...until this many in a row say that the other clock has jumped."""
ALPHA_START, ALPHA_END = 0.05, 0.003
BETA_START, BETA_END = 0.05, 0.003


class Timesync:
    """Double exponential smoothing of the offset, with gains that fall over the first 500 samples."""

    def __init__(self) -> None:
        self.offset_us = 0.0
        """This clock minus the companion's [us]."""
        self.round_trip_us = 0
        """Of the last reply [us], also of one that was dropped."""
        self.samples = 0
        self.dropped = 0
        """Replies that took too long."""
        self._skew = 0.0
        self._deviations = 0

    @property
    def converged(self) -> bool:
        """Whether stamps are translated with the offset."""
        return self.samples >= CONVERGENCE_SAMPLES

    def update(self, now_us: int, remote_ns: int, sent_ns: int) -> None:
        """Take a reply: `remote_ns` the companion's clock [ns], `sent_ns` the request's own stamp [ns]."""
        sent_us, remote_us = sent_ns // 1000, remote_ns // 1000
        self.round_trip_us = now_us - sent_us
        if not 0 <= self.round_trip_us < ROUND_TRIP_MAX_US:
            self.dropped += 1
            return
        offset = (sent_us + now_us - 2 * remote_us) / 2.0
        if self.converged and abs(self.offset_us - offset) > DEVIATION_MAX_US:
            self._deviations += 1
            if self._deviations > DEVIATIONS_MAX:
                self.samples, self.offset_us, self._skew, self._deviations = 0, 0.0, 0.0, 0
            return
        self._smooth(offset)
        self.samples += 1
        self._deviations = 0

    def _smooth(self, offset: float) -> None:
        share = 1.0
        if not self.converged:
            progress = self.samples / CONVERGENCE_SAMPLES
            share = 1.0 - math.exp(0.5 * (1.0 - 1.0 / (1.0 - progress)))
        alpha = share * ALPHA_END + (1.0 - share) * ALPHA_START
        beta = share * BETA_END + (1.0 - share) * BETA_START
        before = self.offset_us
        if self.samples == 0:
            self.offset_us = offset
            return
        self.offset_us = alpha * offset + (1.0 - alpha) * (before + self._skew)
        self._skew = beta * (self.offset_us - before) + (1.0 - beta) * self._skew
