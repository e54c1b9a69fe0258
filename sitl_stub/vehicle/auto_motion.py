"""The setpoint of PX4's automatic modes: a trajectory with limited speed, acceleration and jerk, towards one place.

As PX4 v1.17 does it: lib/motion_planning/VelocitySmoothing.cpp (one axis), PositionSmoothing.cpp (three axes, one
waypoint), mathlib/math/TrajMath.hpp (stopping distances), navigator_main.cpp (preproject_stop_point).
"""

import math
from collections.abc import Mapping, Sequence

from sitl_stub.truth import Vector
from sitl_stub.vehicle.estimator import Estimate

TINY = 1e-7


class AxisTrajectory:
    """Three phases of constant jerk that bring the speed of one axis to a wanted one in the shortest time."""

    __slots__ = (
        "_begin",
        "_direction",
        "_local_time",
        "_phases",
        "_wanted",
        "acceleration",
        "acceleration_max",
        "jerk_max",
        "position",
        "velocity",
        "velocity_max",
    )

    def __init__(self) -> None:
        self.jerk_max = self.acceleration_max = self.velocity_max = 1.0
        self.start(0.0, 0.0, 0.0)

    def start(self, position: float, velocity: float, acceleration: float) -> None:
        """Begin at this motion [m], [m/s], [m/s^2]."""
        self.position, self.velocity, self.acceleration = position, velocity, acceleration
        self._begin = (position, velocity, acceleration)
        self._direction = self._local_time = self._wanted = 0.0
        self._phases = (0.0, 0.0, 0.0)

    @property
    def total_time(self) -> float:
        """Time [s] that the three phases take."""
        return sum(self._phases)

    def advance(self, dt: float) -> None:
        """Move on along the phases by `dt` [s]; beyond them at constant speed."""
        self._local_time += dt
        left = self._local_time
        state = self._begin
        jerk = self._direction * self.jerk_max
        for duration, phase_jerk in zip(self._phases, (jerk, 0.0, -jerk), strict=True):
            part = min(left, duration)
            state = _after(state, phase_jerk, part)
            left -= part
            if left <= 0.0:
                break
        if left > 0.0:
            state = _after((state[0], state[1], 0.0), 0.0, left)
        self.position, self.velocity, self.acceleration = state

    def aim(self, velocity: float) -> None:
        """Plan anew towards `velocity` [m/s], as fast as the limits allow."""
        self._wanted = max(-self.velocity_max, min(self.velocity_max, velocity))
        self._local_time = 0.0
        self._begin = (self.position, self.velocity, self.acceleration)
        self._direction = _sign(self._wanted - self._speed_without_acceleration()) or _sign(self.acceleration)
        jerk = self._direction * self.jerk_max
        change = self._wanted - self.velocity
        if not jerk:
            self._phases = (0.0, 0.0, 0.0)
            return
        first = self._first_phase(change, jerk)
        last = max(self.acceleration / jerk + first, 0.0)
        self._phases = (first, self._middle_phase(first, last, change, jerk), last)

    def stretch(self, total: float) -> None:
        """Plan anew towards the same speed, so that it takes `total` [s]."""
        jerk = self._direction * self.jerk_max
        if not jerk:
            return
        first = self._first_phase_in(total, self._wanted - self.velocity, jerk)
        last = max(self.acceleration / jerk + first, 0.0)
        self._phases = (first, max(total - first - last, 0.0), last)

    def _speed_without_acceleration(self) -> float:
        """Speed [m/s] at which the axis would be if it now gave up its acceleration."""
        acceleration = self.acceleration
        return self.velocity + 0.5 * acceleration * abs(acceleration) / self.jerk_max

    def _first_phase(self, change: float, jerk: float) -> float:
        a0 = self.acceleration
        delta = 2.0 * a0 * a0 + 4.0 * jerk * change
        if delta < 0.0:
            return 0.0
        root = 0.5 * math.sqrt(delta)
        for first in ((-a0 + root) / jerk, (-a0 - root) / jerk):
            if first >= 0.0 and a0 / jerk + first >= 0.0:
                return max(self._within_acceleration(first, jerk), 0.0)
        return max(self._within_acceleration(0.0, jerk), 0.0)

    def _first_phase_in(self, total: float, change: float, jerk: float) -> float:
        a0 = self.acceleration
        b = jerk * total - a0
        delta = total * total * jerk * jerk + 2.0 * total * a0 * jerk - a0 * a0 - 4.0 * jerk * change
        if delta < 0.0:
            return 0.0
        root = math.sqrt(delta)
        for first in (max((b - root) / (2.0 * jerk), 0.0), max((b + root) / (2.0 * jerk), 0.0)):
            last = a0 / jerk + first
            if last >= 0.0 and first + last <= total:
                return self._within_acceleration(first, jerk)
        return self._within_acceleration(0.0, jerk)

    def _within_acceleration(self, first: float, jerk: float) -> float:
        reached = self.acceleration + jerk * first
        limit = self.acceleration_max
        if reached > limit:
            return (limit - self.acceleration) / jerk
        if reached < -limit:
            return (-limit - self.acceleration) / jerk
        return first

    def _middle_phase(self, first: float, last: float, change: float, jerk: float) -> float:
        a0 = self.acceleration
        peak = a0 + jerk * first
        if abs(peak) < TINY:
            return 0.0
        done = 0.5 * first * first * jerk + first * last * jerk + first * a0 - 0.5 * last * last * jerk + last * a0
        return max((change - done) / peak, 0.0)


class AutoMotion:
    """Flies a smooth setpoint to a place, or down at a speed."""

    __slots__ = ("_axes", "_parameters")

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self._axes = (AxisTrajectory(), AxisTrajectory(), AxisTrajectory())

    def start(self, estimate: Estimate, acceleration: Vector = (0.0, 0.0, 0.0)) -> None:
        """Begin at the vehicle's present motion; `acceleration` [m/s^2], ned."""
        for axis, p, v, a in zip(self._axes, estimate.position, estimate.velocity, acceleration, strict=True):
            axis.start(p, v, a)

    @property
    def position(self) -> Vector:
        """Setpoint [m], local ned."""
        return _three([axis.position for axis in self._axes])

    @property
    def velocity(self) -> Vector:
        """Setpoint [m/s], ned."""
        return _three([axis.velocity for axis in self._axes])

    @property
    def acceleration(self) -> Vector:
        """Setpoint [m/s^2], ned."""
        return _three([axis.acceleration for axis in self._axes])

    def shift(self, step: Vector) -> None:
        """Move along with a step [m] of the estimate."""
        for axis, part in zip(self._axes, step, strict=True):
            axis.start(axis.position + part, axis.velocity, axis.acceleration)

    def step(self, goal: Vector, estimate: Estimate, dt: float, *, down_rate: float = math.nan) -> None:
        """Move on by `dt` [s] towards `goal` [m]; with its down NaN the height changes at `down_rate` [m/s]."""
        wanted = self._towards(goal, down_rate)
        self._limit(wanted[2])
        stretched = dt * self._time_share(estimate)
        for axis in self._axes:
            axis.advance(stretched)
        for axis, speed in zip(self._axes, wanted, strict=True):
            axis.aim(speed)
        longest = max(axis.total_time for axis in self._axes)
        if longest > TINY:
            for axis in self._axes:
                if axis.total_time < longest:
                    axis.stretch(longest)

    def _towards(self, goal: Vector, down_rate: float) -> Vector:
        """Speed towards the goal from which the trajectory can still stop there."""
        parameters, place = self._parameters, self.position
        north, east, down = (g - p for g, p in zip(goal, place, strict=True))
        level = math.hypot(north, east)
        jerk = parameters["MPC_JERK_AUTO"]
        level_max = min(
            parameters["MPC_XY_CRUISE"], stopping_speed(level, jerk=jerk, acceleration=parameters["MPC_ACC_HOR"])
        )
        if math.isnan(down):
            share = level_max / level if level > TINY else 0.0
            return (north * share, east * share, down_rate)
        axis = self._axes[2]
        down_max = min(axis.velocity_max, stopping_speed(abs(down), jerk=jerk, acceleration=axis.acceleration_max))
        distance = math.hypot(level, down)
        if distance < TINY:
            return (0.0, 0.0, 0.0)
        speed = math.hypot(level_max, down_max) / distance
        return _clamped((north * speed, east * speed, down * speed), level_max, down_max)

    def _limit(self, wanted_down: float) -> None:
        parameters, (north, east, down) = self._parameters, self._axes
        for axis in self._axes:
            axis.jerk_max = parameters["MPC_JERK_AUTO"]
        for axis in (north, east):
            axis.acceleration_max, axis.velocity_max = parameters["MPC_ACC_HOR"], parameters["MPC_XY_VEL_MAX"]
        if wanted_down < 0.0:
            down.acceleration_max, down.velocity_max = parameters["MPC_ACC_UP_MAX"], parameters["MPC_Z_V_AUTO_UP"]
        else:
            down.acceleration_max, down.velocity_max = parameters["MPC_ACC_DOWN_MAX"], parameters["MPC_Z_V_AUTO_DN"]

    def _time_share(self, estimate: Estimate) -> float:
        """Slow the trajectory down while the vehicle is behind it (MPC_XY_ERR_MAX)."""
        place, speed = self.position, self.velocity
        north, east = place[0] - estimate.north, place[1] - estimate.east
        allowed = self._parameters["MPC_XY_ERR_MAX"]
        if allowed < TINY or north * speed[0] + east * speed[1] < 0.0:
            return 1.0
        return 1.0 - min(math.hypot(north, east) / allowed, 1.0)


def stopping_speed(distance: float, *, jerk: float, acceleration: float) -> float:
    """Speed [m/s] from which a stop within `distance` [m] is possible (computeMaxSpeedFromDistance)."""
    b = 4.0 * acceleration * acceleration / jerk
    return max(0.0, 0.5 * (-b + math.sqrt(b * b + 8.0 * acceleration * distance)))


def stopping_point(estimate: Estimate, *, acceleration: float) -> tuple[float, float]:
    """Where a vehicle that now brakes will stand [m], north and east (preproject_stop_point)."""
    speed = math.hypot(estimate.v_north, estimate.v_east)
    # PX4 reckons with 0.6 s until it decelerates, whatever MPC_JERK_AUTO is
    time = speed / (2.0 * acceleration) + 0.6
    return (estimate.north + estimate.v_north * time, estimate.east + estimate.v_east * time)


def _clamped(vector: Vector, level_max: float, down_max: float, accuracy: float = 0.5) -> Vector:
    """Shorten a velocity to both limits in its direction; small ones axis by axis (clampToXYNorm, clampToZNorm)."""
    north, east, down = vector
    level = math.hypot(north, east)
    if level > TINY and level_max < level:
        share = level_max / level
        north, east = north * share, east * share
        down *= 1.0 if level_max < accuracy and level < accuracy else share
    if abs(down) > TINY and down_max < abs(down):
        share = down_max / abs(down)
        small = down_max < accuracy and abs(down) < accuracy
        down *= share
        north, east = (north, east) if small else (north * share, east * share)
    return (north, east, down)


def _after(state: Vector, jerk: float, t: float) -> Vector:
    """Position, velocity and acceleration after `t` [s] of constant jerk."""
    x, v, a = state
    return (x + t * (v + t * (0.5 * a + t * jerk / 6.0)), v + t * (a + 0.5 * jerk * t), a + jerk * t)


def _sign(value: float) -> float:
    return float((value > 0.0) - (value < 0.0))


def _three(values: Sequence[float]) -> Vector:
    return (values[0], values[1], values[2])
