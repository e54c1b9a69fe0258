"""The bias of the autopilot's velocity estimate.

PX4's estimated velocity is wrong by 0.1 to 0.3 m/s for seconds, and its estimated position does not drift accordingly:
over a hover of the recorded autopilot the two disagree by 0.11, 0.25 and 0.17 m/s (north, east, down). Its velocity
loop flies the biased velocity, so a velocity setpoint must carry the same bias, and a relative velocity must not.
The bias is observed against the position estimate of the same autopilot by a second-order observer:

    dp/dt = v - b + 2 w (p_est - p),    db/dt = -w^2 (p_est - p)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from companion.geometry.arrays import Array
from companion.messages.ownship import OwnshipState


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityBiasParameters:
    """Tuning of the observer."""

    bandwidth: Annotated[float, Interval(gt=0.0, le=20.0)] = 5.0  # w [rad/s]
    largest_mps: Annotated[float, Gt(0.0)] = 0.8  # a larger bias is not believed
    pause_s: Annotated[float, Gt(0.0)] = 0.5  # a longer pause of the odometry begins anew


class VelocityBias:
    """Holds the observer between odometry messages."""

    def __init__(self, parameters: VelocityBiasParameters) -> None:
        self._p = parameters
        self._position: Array | None = None
        self._bias = np.zeros(3)
        self._t = 0.0
        self._counter = 0

    @property
    def bias_ned(self) -> Array:
        """Estimated velocity minus the rate of the estimated position, (3,) [m/s]."""
        return self._bias

    def add(self, state: OwnshipState) -> None:
        """Take the next odometry message. A pause or a reset of the estimator begins anew with the bias as known."""
        dt = state.t - self._t
        if self._position is None or state.reset_counter != self._counter or not 0.0 < dt <= self._p.pause_s:
            if dt == 0.0:
                return
            self._position, self._t, self._counter = state.position_ned.copy(), state.t, state.reset_counter
            return
        w = self._p.bandwidth
        predicted = self._position + (state.velocity_ned - self._bias) * dt
        error = state.position_ned - predicted
        self._position = predicted + min(1.0, 2.0 * w * dt) * error
        self._bias = np.clip(self._bias - min(1.0, w * w * dt) * error, -self._p.largest_mps, self._p.largest_mps)
        self._t = state.t
