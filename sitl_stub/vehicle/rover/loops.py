"""Building blocks of PX4's controllers: slew rate, PID, and the shaping of sticks (lib/slew_rate, lib/pid, mathlib)."""

import math

EPSILON = 1.1920929e-07
"""Below this PX4 takes a number for zero (FLT_EPSILON)."""


def clamp(value: float, low: float, high: float) -> float:
    """`value`, not below `low` and not above `high`."""
    return max(low, min(high, value))


def wrap(angle: float) -> float:
    """Angle [rad] between -pi and pi."""
    return math.remainder(angle, math.tau)


def sign(value: float) -> float:
    """-1, 0 or 1."""
    return float((value > 0.0) - (value < 0.0))


def dead_zone(stick: float, width: float) -> float:
    """Stick from -1 to 1 that counts only beyond `width`, and from there on evenly up to 1 (math::deadzone)."""
    stick, width = clamp(stick, -1.0, 1.0), clamp(width, 0.0, 0.99)
    return (stick - sign(stick) * width) / (1.0 - width) if abs(stick) > width else 0.0


def super_exponential(stick: float, cubic: float, steep: float) -> float:
    """Stick from -1 to 1 with a cubic share, steeper towards its ends (math::superexpo)."""
    stick, steep = clamp(stick, -1.0, 1.0), clamp(steep, 0.0, 0.99)
    curved = (1.0 - cubic) * stick + cubic * stick**3
    return curved * (1.0 - steep) / (1.0 - abs(stick) * steep)


class SlewRate:
    """A value that moves towards a goal no faster than a limit."""

    __slots__ = ("value",)

    def __init__(self) -> None:
        self.value = 0.0

    def update(self, goal: float, rate: float, dt: float) -> float:
        """Move by at most `rate` times `dt` [s]."""
        self.value += clamp(goal - self.value, -rate * dt, rate * dt)
        return self.value

    def approach(self, goal: float, measured: float, rate: float, dt: float) -> float:
        """Move towards `goal`, but never farther from `measured` than the goal is; without a `rate` jump there."""
        if rate <= EPSILON:
            self.value = goal
        else:
            self.update(goal, rate, dt)
            if abs(self.value - measured) > abs(goal - measured):
                self.value = goal
        return self.value


class ProportionalIntegral:
    """P and I; the integral counts from the next step on, as in PX4's PID."""

    __slots__ = ("integral", "integral_gain", "limit", "proportional_gain")

    def __init__(self) -> None:
        self.integral = 0.0
        self.proportional_gain = self.integral_gain = 0.0
        self.limit = 1.0
        """Greatest output."""

    def update(self, error: float, dt: float) -> float:
        """One step of `dt` [s]."""
        output = self.proportional_gain * error + self.integral
        self.integral = clamp(self.integral + self.integral_gain * error * dt, -1.0, 1.0)
        return clamp(output, -self.limit, self.limit)
