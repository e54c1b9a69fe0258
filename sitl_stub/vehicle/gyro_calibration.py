"""Calibration of the gyros on command: what PX4 says and shows meanwhile (commander/gyro_calibration.cpp, v1.17)."""

from sitl_stub.vehicle.notices import INFO, Notice

STARTED, DONE = "[cal] calibration started: 2 gyro", "[cal] calibration done: gyro"
FIRST_SAMPLE = 0.01
"""From the start to the first sample [s]."""
SAMPLING = 1.0
"""250 samples [s], told at every tenth."""
SHOWN_AFTER = 1.0
"""HEARTBEAT shows it so long [s] after the end: PX4 waits 0.6 s, and tells its state every half second."""


class GyroCalibration:
    """One calibration of a vehicle that stands still, begun at `t` [s]."""

    def __init__(self, t: float) -> None:
        steps = [(t + FIRST_SAMPLE + SAMPLING * k / 10, f"[cal] progress <{10 * k}>") for k in range(11)]
        self._end = t + FIRST_SAMPLE + SAMPLING + FIRST_SAMPLE
        self._script = [(t, STARTED), *steps, (self._end, DONE)]

    def finished(self, t: float) -> bool:
        """Whether it is over at `t`."""
        return t >= self._end + SHOWN_AFTER

    def take_notices(self, t: float) -> list[Notice]:
        """Hand out the texts that are due at `t`."""
        due = [text for when, text in self._script if when <= t]
        del self._script[: len(due)]
        return [Notice(severity=INFO, text=text) for text in due]
