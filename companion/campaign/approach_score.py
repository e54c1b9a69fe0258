"""What a flight to a pad out of sight came to: where it left the way there, and what way and landing cost."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.campaign.result import ApproachFigures
from companion.campaign.truth import TruthSample
from companion.messages.decision import Mode
from companion.planning.energy_path import AirframeEnergy, electric_power
from companion.runtime.planner import Snapshot

_EVERY_S = 0.02
_ROUNDING_S = 1e-6
_NOT_COUNTED = (Mode.PREFLIGHT, Mode.TAKEOFF, Mode.TOUCHDOWN, Mode.DONE)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Leaving:
    """Where the way was left; see `ApproachFigures`."""

    t: float
    distance: float
    height: float
    seen: bool
    offset: tuple[float, float] | None


class ApproachScorer:
    """Notes the true motion from the end of the climb to the touchdown, and where the way was left the first time.

    Args:
        airframe: what the power depends on.
        target: name of the pad in the world; None: its first target.
    """

    def __init__(self, airframe: AirframeEnergy, target: str | None = None) -> None:
        self._airframe, self._target = airframe, target
        self._motion: list[tuple[float, float, float]] = []  # [s], [m/s] horizontal, [m/s] up
        self._on_the_way = False
        self._left: _Leaving | None = None

    def watch(self, sample: TruthSample, snapshot: Snapshot) -> None:
        """Take in one step: the truth, and what was known and decided."""
        decision = snapshot.decision
        if decision is None:
            return
        if self._on_the_way and decision.mode is not Mode.TRANSIT and self._left is None:
            self._left = self._leaves(sample, snapshot, seen=decision.mode is Mode.REORIENT)
        self._on_the_way = decision.mode is Mode.TRANSIT
        due = not self._motion or sample.t >= self._motion[-1][0] + _EVERY_S - _ROUNDING_S
        if due and decision.mode not in _NOT_COUNTED:
            north, east, down = sample.velocity_ned
            self._motion.append((sample.t, math.hypot(north, east), -down))

    @property
    def figures(self) -> ApproachFigures | None:
        """All of it; None: the climb never ended."""
        if len(self._motion) < 2:
            return None
        t, speed, climb = np.array(self._motion).T
        power = electric_power(speed, climb, np.gradient(speed, t), self._airframe)
        left = self._left
        return ApproachFigures(
            way_left_s=None if left is None else left.t,
            way_left_m=None if left is None else left.distance,
            height_m=None if left is None else left.height,
            seen=None if left is None else left.seen,
            coarse_offset_m=None if left is None else left.offset,
            duration_s=float(t[-1] - t[0]),
            energy_j=float(power[1:] @ np.diff(t)),
        )

    def _leaves(self, sample: TruthSample, snapshot: Snapshot, *, seen: bool) -> _Leaving:
        pad = sample.target(self._target).position_ned
        north, east, down = (there - here for there, here in zip(pad, sample.position_ned, strict=True))
        offset = None
        if snapshot.coarse is not None and snapshot.ownship is not None:
            told = snapshot.coarse.position_ned - snapshot.ownship.position_ned
            offset = (float(told[0]) - north, float(told[1]) - east)
        return _Leaving(t=sample.t, distance=math.hypot(north, east), height=down, seen=seen, offset=offset)
