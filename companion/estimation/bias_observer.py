"""The bias of a ground vehicle's estimated velocity, against a position that is known better.

PX4's velocity without wheel odometry is wrong by 0.2 m/s for seconds; its changes are good. With p the position that is
observed and e = p - p_now:

    dp/dt = v_est - b + 2 w e,    db/dt = -w^2 e

both poles at -w. A multicopter's own observer (`motion_observer`) leans on its tilt besides; a rover does not tilt.
"""

from __future__ import annotations

import math

from companion.geometry.arrays import Array, frozen

_NONE = frozen([0.0, 0.0, 0.0])


class BiasObserver:
    """Holds the observer between odometry messages; north and east.

    Args:
        bandwidth: w [rad/s].
        bias_max: [m/s] per axis; a larger one is not believed.
        pause: [s] a longer pause begins anew.
    """

    def __init__(self, *, bandwidth: float, bias_max: float, pause: float = 0.5) -> None:
        self._w = bandwidth
        self._most = bias_max
        self._pause = pause
        self._counter = 0
        self._t = self._t_began = -math.inf
        self._position = [0.0, 0.0]
        self._bias = [0.0, 0.0]
        self.bias_ned: Array = _NONE

    @property
    def settled(self) -> bool:
        """Whether it has run without a pause for as long as its poles need."""
        return self._t - self._t_began > 3.0 / self._w

    def forget(self) -> None:
        """Begin anew, the bias kept."""
        self._t = -math.inf

    def add(self, *, t: float, reset_counter: int, velocity_ned: Array, position_ned: Array) -> None:
        """Take the next state.

        Args:
            t: of the state [s].
            reset_counter: of the odometry.
            velocity_ned: estimated (3,) [m/s].
            position_ned: observed (3,) [m]; the bias is that of the velocity against its rate.
        """
        dt = t - self._t
        if dt <= 0.0:
            return
        place, velocity = position_ned.tolist()[:2], velocity_ned.tolist()[:2]
        if dt > self._pause or reset_counter != self._counter:
            self._t_began, self._counter, self._position = t, reset_counter, place
        else:
            z = math.exp(-self._w * dt)
            for axis in (0, 1):
                predicted = self._position[axis] + (velocity[axis] - self._bias[axis]) * dt
                error = place[axis] - predicted
                self._position[axis] = predicted + (1.0 - z * z) * error
                bias = self._bias[axis] - (1.0 - z) ** 2 / dt * error
                self._bias[axis] = min(self._most, max(-self._most, bias))
        self._t = t
        self.bias_ned = frozen([*self._bias, 0.0])
