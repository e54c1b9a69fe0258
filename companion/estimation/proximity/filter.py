"""The pose estimator of Parikh et al. (section IV) for readings that come late and in any order."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from companion.estimation.proximity.fusion import REFUSED, Fusion, Verdict
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.snapshot import Mover, Snapshot
from companion.geometry.arrays import Array, frozen
from companion.geometry.quaternions import rotation_of
from companion.messages.proximity import (
    FeatureReading,
    GyroReading,
    NozzlePulses,
    ProximityState,
    RangeReading,
)

_COMMAND, _GYRO, _RANGE, _FEATURES = range(4)  # the order of what happens at one instant
_MEMORY = 1.0  # [s] of measurements that the Mahalanobis distance of a state looks back on

_Key = tuple[float, int, int]  # time, kind, anchor
_Apply = Callable[[Snapshot], tuple[Snapshot, tuple[Verdict, ...]]]


class _Entry(NamedTuple):
    """Something that happened, and the filter after it."""

    apply: _Apply
    after: Snapshot
    verdicts: tuple[Verdict, ...]


class ProximityFilter:
    """Error-state EKF of position, velocity and attitude: reference quaternion, three attitude errors.

    Readings are kept for `history` seconds with the state after each. One that comes late is put in its place and
    what followed is done again, so the result depends on what was read, not on when it arrived.
    """

    def __init__(self, setup: ProximitySetup, parameters: ProximityParameters, initial: ProximityState) -> None:
        self._setup = setup
        self._history = parameters.history
        self._mover = Mover(setup, parameters)
        self._fusion = Fusion(setup, parameters)
        self._base = self._mover.first(initial, setup, parameters)
        self._keys: list[_Key] = []
        self._entries: list[_Entry] = []

    @property
    def reopenings(self) -> int:
        """How often all readings of a sensor were rejected for so long that the covariance was enlarged."""
        return self._newest().reopenings

    @property
    def gyro_bias(self) -> Array:
        """Estimated bias of the gyro, (3,) [rad/s] in d; zero if it is not estimated."""
        return frozen(self._newest().bias)

    def command(self, pulses: NozzlePulses) -> bool:
        """Let the mean force of a command act during the control period that begins at its time.

        Returns:
            Whether it was taken: not if it is older than the history, a second one for its time, or not finite.
        """
        force = pulses.force
        return (
            self._take((pulses.t, _COMMAND, 0), force, lambda s: (self._mover.command(s, pulses.t, force), ())) is None
        )

    def accelerate(self, t: float, acceleration: Array, duration: float) -> bool:
        """Let a known acceleration act: of a vehicle that measures it, instead of a command.

        Args:
            t: [s] when it begins.
            acceleration: (3,) [m/s^2] of the centre of mass, gravity removed, in d.
            duration: [s]; the next one, or a command, ends it earlier.

        Returns:
            Whether it was taken, as for `command`.
        """
        key = (t, _COMMAND, 0)
        return (
            self._take(key, acceleration, lambda s: (self._mover.accelerated(s, t, acceleration, duration), ())) is None
        )

    def gyro(self, reading: GyroReading) -> bool:
        """Take the turn rate from its time on.

        Returns:
            Whether it was taken: not if it is older than the history, a second one for its time, or not finite.
        """
        x, y, z = reading.rate.tolist()
        key = (reading.t, _GYRO, 0)
        return self._take(key, reading.rate, lambda s: (self._mover.gyro(s, reading.t, (x, y, z)), ())) is None

    def range(self, reading: RangeReading) -> Verdict:
        """Fuse a range at the time at which it was taken."""
        if not 0 <= reading.anchor < len(self._setup.anchors):
            return REFUSED["unknown"]
        key = (reading.t, _RANGE, reading.anchor)
        refused = self._take(
            key,
            reading.range,
            lambda s: self._fusion.range(self._mover.moved(s, reading.t), reading.anchor, reading.range),
        )
        return refused or self._entries[bisect_left(self._keys, key)].verdicts[0]

    def features(self, reading: FeatureReading) -> tuple[Verdict, ...]:
        """Fuse the markers of a picture at the time at which it was taken.

        Returns:
            One verdict for each marker of the reading.
        """
        count = len(reading.markers)
        if count == 0:
            return ()
        if len(set(reading.markers)) < count or not all(0 <= m < len(self._setup.markers) for m in reading.markers):
            return (REFUSED["unknown"],) * count
        key = (reading.t, _FEATURES, 0)
        refused = self._take(
            key,
            reading.positions,
            lambda s: self._fusion.features(self._mover.moved(s, reading.t), reading.markers, reading.positions),
        )
        return (refused,) * count if refused else self._entries[bisect_left(self._keys, key)].verdicts

    def state(self, t: float) -> ProximityState:
        """Give the estimate at `t` [s] from everything read up to then.

        Raises:
            ValueError: `t` lies before the history.
        """
        if t < self._base.t_translation or t < self._base.t:
            raise ValueError(f"state at {t} s: the history begins at {self._base.t} s")
        end = bisect_right(self._keys, (t, _FEATURES, 0))
        s = self._mover.moved(self._entries[end - 1].after if end else self._base, t)
        return ProximityState(
            t=t,
            position=frozen(s.position),
            velocity=frozen(s.velocity),
            quaternion=frozen(s.quaternion),
            rate=frozen(s.true_rate),
            covariance=frozen(s.covariance.joint(rotation_of(s.quaternion))[:9, :9]),
            mahalanobis=self._distance(bisect_left(self._keys, (t - _MEMORY, 0, 0)), end),
            t_vision=s.t_vision,
            t_range=s.t_range,
        )

    def _take(self, key: _Key, numbers: Array | float, apply: _Apply) -> Verdict | None:
        """Put something in its place and do again what follows; give the refusal, or None if it was taken."""
        if not (math.isfinite(key[0]) and np.isfinite(numbers).all()):
            return REFUSED["not finite"]
        if key[0] < max(self._base.t, self._base.t_translation) or key[0] < self._oldest():
            return REFUSED["late"]
        place = bisect_left(self._keys, key)
        if place < len(self._keys) and self._keys[place] == key:
            return REFUSED["duplicate"]
        s = self._entries[place - 1].after if place else self._base
        later = [entry.apply for entry in self._entries[place:]]
        self._keys.insert(place, key)
        del self._entries[place:]
        for again in (apply, *later):
            s, verdicts = again(s)
            self._entries.append(_Entry(again, s, verdicts))
        self._forget()
        return None

    def _newest(self) -> Snapshot:
        return self._entries[-1].after if self._entries else self._base

    def _oldest(self) -> float:
        """Time [s] before which nothing is taken any more: fixed by the newest reading, not by what is still kept."""
        return self._keys[-1][0] - self._history if self._keys else -math.inf

    def _forget(self) -> None:
        """Drop what is older than the history, many at a time."""
        old = bisect_left(self._keys, (self._oldest(), 0, 0))
        if old > _SLACK:
            self._base = self._entries[old - 1].after
            del self._keys[:old], self._entries[:old]

    def _distance(self, begin: int, end: int) -> float:
        """Root mean square Mahalanobis distance per degree of freedom of the measurements of some entries.

        Rejected ones count only where they are the majority: a few outliers say nothing about the filter, a filter that
        rejects most of what it is told is wrong itself.
        """
        fused, gated = [0.0, 0], [0.0, 0]
        for entry in self._entries[begin:end]:
            for verdict in entry.verdicts:
                if verdict.degrees:
                    total = fused if verdict.accepted else gated
                    total[0] += verdict.squared_distance
                    total[1] += verdict.degrees
        if gated[1] > fused[1]:
            fused = [fused[0] + gated[0], fused[1] + gated[1]]
        return math.sqrt(fused[0] / fused[1]) if fused[1] else 0.0


_SLACK = 64  # readings beyond the history before they are dropped together
