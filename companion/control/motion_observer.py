"""What the autopilot's estimate hides: the bias of its velocity, and the acceleration that pushes the vehicle aside.

PX4's estimated velocity is wrong by 0.1 to 0.3 m/s for seconds, and its estimated position does not drift accordingly:
over a hover of the recorded autopilot the two disagree by 0.11, 0.25 and 0.17 m/s (north, east, down). Its velocity
loop flies the biased velocity, so a velocity setpoint must carry the same bias, and a relative velocity must not.
Its attitude is wrong by about a degree, which pushes like wind: 0.17 m/s^2 to the degree.

Both are observed against the position estimate of the same autopilot. Horizontally, with a_t the acceleration that the
estimated tilt alone would give and e = p_est - p:

    dp/dt = v + 3 w e,    dv/dt = a_t + d + 3 w^2 e,    dd/dt = w^3 e;    bias = v_est - v

all three poles at -w. Vertically the thrust is not known, so the estimated velocity is integrated instead:

    dp/dt = v_est - b + 2 w e,    db/dt = -w^2 e
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from companion.geometry.arrays import Array
from companion.messages.ownship import OwnshipState

GRAVITY = 9.81  # [m/s^2]
_LEAST_UP = 0.3  # cosine of the tilt below which the tilt says nothing of the thrust


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionObserverParameters:
    """Tuning of the observer."""

    bandwidth: Annotated[float, Interval(gt=0.0, le=20.0)] = 6.0  # w, horizontal [rad/s]
    bandwidth_vertical: Annotated[float, Interval(gt=0.0, le=20.0)] = 5.0  # w, vertical [rad/s]
    bias_max: Annotated[float, Gt(0.0)] = 0.8  # [m/s] a larger bias is not believed
    disturbance_max: Annotated[float, Gt(0.0)] = 2.0  # [m/s^2]
    pause: Annotated[float, Gt(0.0)] = 0.5  # [s] a longer pause of the odometry begins anew


class MotionObserver:
    """Holds the observer between odometry messages."""

    def __init__(self, parameters: MotionObserverParameters) -> None:
        self._p = parameters
        self._t = -np.inf
        self._t_began = np.inf
        self._counter = 0
        self._position = np.zeros(3)
        self._velocity = np.zeros(2)  # north, east
        self._disturbance = np.zeros(2)
        self._bias = np.zeros(3)

    @property
    def settled(self) -> bool:
        """Whether it has run without a pause for as long as its slowest pole needs."""
        return self._t - self._t_began > 3.0 / self._p.bandwidth

    @property
    def bias_ned(self) -> Array:
        """Estimated velocity minus the rate of the estimated position, (3,) [m/s]."""
        return self._bias

    @property
    def disturbance_ned(self) -> Array:
        """Acceleration beyond that of the estimated tilt (3,) [m/s^2]; zero downwards."""
        return np.array([self._disturbance[0], self._disturbance[1], 0.0])

    def add(self, state: OwnshipState, position_ned: Array) -> None:
        """Take the next state. After a pause or a reset of the estimator the bias is kept, the rest begins anew.

        Args:
            state: of the vehicle.
            position_ned: what is observed against (3,) [m]: the position in the local frame, or relative to the target.
        """
        dt = state.t - self._t
        if dt <= 0.0:
            return
        if state.reset_counter != self._counter or dt > self._p.pause:
            self._counter = state.reset_counter
            self._t_began = state.t
            self._position = position_ned.copy()
            self._velocity = state.velocity_ned[:2] - self._bias[:2]
        else:
            self._horizontal(state, position_ned, dt)
            self._vertical(state, position_ned, dt)
        self._t = state.t

    def _horizontal(self, state: OwnshipState, position_ned: Array, dt: float) -> None:
        w, p = self._p.bandwidth, self._p
        push = tilt_acceleration(state) + self._disturbance
        ahead = self._velocity * dt + 0.5 * dt * dt * push
        error = position_ned[:2] - (self._position[:2] + ahead)
        # discrete gains with all poles at exp(-w dt)
        z = float(np.exp(-w * dt))
        g1, g2, g3 = 1.0 - z**3, 1.5 * (1.0 - z) ** 2 * (1.0 + z) / dt, (1.0 - z) ** 3 / (dt * dt)
        self._position[:2] += ahead + g1 * error
        self._velocity = self._velocity + push * dt + g2 * error
        self._disturbance = np.clip(self._disturbance + g3 * error, -p.disturbance_max, p.disturbance_max)
        self._bias[:2] = np.clip(state.velocity_ned[:2] - self._velocity, -p.bias_max, p.bias_max)

    def _vertical(self, state: OwnshipState, position_ned: Array, dt: float) -> None:
        w, p = self._p.bandwidth_vertical, self._p
        predicted = self._position[2] + (state.velocity_ned[2] - self._bias[2]) * dt
        error = float(position_ned[2] - predicted)
        z = float(np.exp(-w * dt))
        self._position[2] = predicted + (1.0 - z * z) * error
        bias = self._bias[2] - (1.0 - z) ** 2 / dt * error
        self._bias[2] = min(p.bias_max, max(-p.bias_max, bias))


def tilt_acceleration(state: OwnshipState) -> Array:
    """Give the horizontal acceleration (2,) [m/s^2] that the estimated attitude gives, with the thrust that makes the
    estimated vertical acceleration.
    """
    up = float(state.ned_from_frd[2, 2])
    if up < _LEAST_UP:
        return np.zeros(2)
    thrust = (GRAVITY - float(state.acceleration_ned[2])) / up
    result: Array = -thrust * state.ned_from_frd[:2, 2]
    return result
