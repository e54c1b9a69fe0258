"""Where the free-flyer is and how it moves, from positions and from what its thrusters were told.

The autopilot's velocity is biased (`motion_observer.py`), so only its position is used. With u the commanded
acceleration as it acts, d the disturbance (slope of the floor, weak thrusters, drag) and e = p_est - p, per axis:

    dp/dt = v + 3 w e,    dv/dt = u + d + 3 w^2 e,    dd/dt = w^3 e

all three poles at -w. Taking d out of the command is the controller's integral action, and it does not wind up: what
the thrusters could not give is not in u.
"""

from __future__ import annotations

import math
from collections import deque

from companion.messages.ownship import OwnshipState

_LONGEST = 0.25  # [s] between two positions; after more the observer begins anew


class CommandHistory:
    """The accelerations that were commanded, each in force until the next."""

    def __init__(self) -> None:
        self._commands: deque[tuple[float, float, float]] = deque()  # [s] from when on, north and east [m/s^2]

    def add(self, t: float, north: float, east: float) -> None:
        """A command [m/s^2] acts from `t` [s] on."""
        self._commands.append((t, north, east))

    def mean(self, begin: float, end: float) -> tuple[float, float]:
        """Mean acceleration [m/s^2] north and east between two instants [s]; before the first command it is zero."""
        if end <= begin:
            return 0.0, 0.0
        north = east = 0.0
        until = end
        for t, a_north, a_east in reversed(self._commands):
            since = max(t, begin)
            if until > since:
                north += a_north * (until - since)
                east += a_east * (until - since)
                until = since
            if t <= begin:
                break
        return north / (end - begin), east / (end - begin)

    def forget_before(self, t: float) -> None:
        """Drop what is over before `t` [s]."""
        commands = self._commands
        while len(commands) > 1 and commands[1][0] <= t:
            commands.popleft()


class PlaneObserver:
    """Position, velocity and disturbance in the plane; north and east apart, scalar for speed."""

    def __init__(self, bandwidth: float, disturbance_max: float) -> None:
        self._w = bandwidth
        self._most = disturbance_max
        self.t = -math.inf  # [s] instant of the state below
        self._counter = -1
        self.position = (0.0, 0.0)  # [m] north, east
        self.velocity = (0.0, 0.0)  # [m/s] rate of the estimated position
        self.disturbance = (0.0, 0.0)  # [m/s^2]

    def add(self, state: OwnshipState, commands: CommandHistory) -> None:
        """Take the next odometry. After a pause or a reset the disturbance is kept, the rest begins anew."""
        dt = state.t - self.t
        if dt <= 0.0:
            return
        north, east = float(state.position_ned[0]), float(state.position_ned[1])
        if dt > _LONGEST or state.reset_counter != self._counter:
            self._counter = state.reset_counter
            self.position = (north, east)
            self.velocity = (float(state.velocity_ned[0]), float(state.velocity_ned[1]))
        else:
            u = commands.mean(self.t, state.t)
            # discrete gains with all poles at exp(-w dt)
            z = math.exp(-self._w * dt)
            gains = (1.0 - z**3, 1.5 * (1.0 - z) ** 2 * (1.0 + z) / dt, (1.0 - z) ** 3 / (dt * dt))
            p0, v0, d0 = self._axis(0, north, u[0], dt, gains)
            p1, v1, d1 = self._axis(1, east, u[1], dt, gains)
            self.position, self.velocity, self.disturbance = (p0, p1), (v0, v1), (d0, d1)
        self.t = state.t

    def _axis(
        self, i: int, measured: float, u: float, dt: float, gains: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        push = u + self.disturbance[i]
        ahead = self.position[i] + self.velocity[i] * dt + 0.5 * push * dt * dt
        error = measured - ahead
        disturbance = self.disturbance[i] + gains[2] * error
        return (
            ahead + gains[0] * error,
            self.velocity[i] + push * dt + gains[1] * error,
            max(-self._most, min(self._most, disturbance)),
        )

    def predict(self, t: float, commands: CommandHistory) -> tuple[tuple[float, float], tuple[float, float]]:
        """Give position [m] and velocity [m/s] at `t` [s], with the commands that act until then."""
        dt = t - self.t
        u = commands.mean(self.t, t)
        push = (u[0] + self.disturbance[0], u[1] + self.disturbance[1])
        position = (
            self.position[0] + self.velocity[0] * dt + 0.5 * push[0] * dt * dt,
            self.position[1] + self.velocity[1] * dt + 0.5 * push[1] * dt * dt,
        )
        return position, (self.velocity[0] + push[0] * dt, self.velocity[1] + push[1] * dt)
