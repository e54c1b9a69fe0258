"""How far off forecasts are that led the vehicle while the target was out of sight, against the truth."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt

from companion.campaign.truth import TargetSample, TruthSample
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction


@dataclass(frozen=True, slots=True, kw_only=True)
class ForecastScoring:
    """Which forecasts count."""

    lost_s: Annotated[float, Gt(0.0)] = 0.5  # without a measurement: the forecast made then is kept,
    gone_s: Annotated[float, Gt(0.0)] = 1.0  # and counts if the target is gone for so long
    step_s: Annotated[float, Gt(0.0)] = 0.1  # between the instants compared


Place = tuple[float, float, float]  # t [s], north and east [m]


class ForecastScorer:
    """Compares, instant by instant over its horizon, the forecast with which each loss of sight begins.

    A forecast knows places relative to the vehicle as it believes to stand; they are put to the vehicle as it truly
    stood when the forecast was made. Instants at which the target has stopped meanwhile are left out: that is no matter
    of the forecast.

    Args:
        parameters: which forecasts count.
    """

    def __init__(self, parameters: ForecastScoring | None = None) -> None:
        self._p = parameters or ForecastScoring()
        self._due: deque[Place] = deque()  # t [s], north and east [m] of the newest loss
        self._lost = self._counts = False
        self._pending: list[float] = []  # [m^2] of the newest loss, before it counts
        self._squares, self._count = 0.0, 0
        self._kept: tuple[Place, ...] = ()  # of the newest loss
        self.first: tuple[Place, ...] | None = None
        """The forecast of the first loss that counts: t [s], north and east [m] by the truth; None: there was none."""

    @property
    def rmse(self) -> float | None:
        """Root of the mean square distance [m]; None: the target was never gone."""
        return math.sqrt(self._squares / self._count) if self._count else None

    def look(
        self,
        *,
        age: float,
        prediction: Prediction,
        ownship: OwnshipState,
        sample: TruthSample,
        target: TargetSample,
    ) -> None:
        """Take what was known at one step.

        Args:
            age: since the newest measurement [s].
            prediction: the forecast of this step, in the frame of `ownship`.
            ownship: where the vehicle believes to stand.
            sample: where it stands.
            target: where the target stands.
        """
        p = self._p
        if age < p.lost_s:
            self._lost = False
        elif not self._lost:
            self._lost, self._counts = True, False
            self._pending.clear()
            self._due.clear()
            self._kept = ()
            if target.moving:
                self._keep(prediction, ownship, sample)
        self._counts |= self._lost and age >= p.gone_s
        while self._due and self._due[0][0] <= sample.t:
            _, north, east = self._due.popleft()
            if target.moving:
                off = (north - target.position_ned[0], east - target.position_ned[1])
                self._pending.append(off[0] * off[0] + off[1] * off[1])
        if self._counts:
            self._squares += sum(self._pending)
            self._count += len(self._pending)
            self.first = self.first or self._kept or None
            self._pending.clear()

    def _keep(self, prediction: Prediction, ownship: OwnshipState, sample: TruthSample) -> None:
        turn = sample.yaw - ownship.yaw
        cosine, sine = math.cos(turn), math.sin(turn)
        for ahead in np.arange(0.0, prediction.horizon, self._p.step_s).tolist():
            away = prediction.at(sample.t + ahead).position_ned - ownship.position_ned
            north, east = float(away[0]), float(away[1])
            self._due.append(
                (
                    sample.t + ahead,
                    sample.position_ned[0] + cosine * north - sine * east,
                    sample.position_ned[1] + sine * north + cosine * east,
                )
            )
        self._kept = tuple(self._due)
