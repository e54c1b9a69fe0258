"""Control allocation of a quadrotor X: torques and thrust to four rotors, as PX4 v1.17 does with MC_AIRMODE 0.

Source: lib/control_allocation/control_allocation/ControlAllocationSequentialDesaturation.cpp (mixAirmodeDisabled) and
the normalised mix of ControlAllocationPseudoInverse.cpp. Thrust gives way to roll and pitch, yaw to both; thrust is
only ever reduced.
"""

import math

Rotors = tuple[float, float, float, float]

SHARE = math.sqrt(0.5)
"""Each rotor's share of a unit roll or pitch torque in PX4's normalised mix."""
THRUST: Rotors = (-1.0, -1.0, -1.0, -1.0)
"""Thrust along down: more of it is less lift."""
ROLL: Rotors = (-SHARE, SHARE, SHARE, -SHARE)
PITCH: Rotors = (SHARE, -SHARE, SHARE, -SHARE)
YAW: Rotors = (1.0, 1.0, -1.0, -1.0)
YAW_MARGIN = 0.15
"""MINIMUM_YAW_MARGIN: by so much may yaw go beyond full throttle before it is cut; thrust gives way afterwards."""
ACHIEVED = 1e-6
"""Square of the torque that may be missing while the setpoint still counts as reached."""


class Mixer:
    """Mixes, and remembers which axes did not get what they asked for."""

    __slots__ = ("saturated",)

    def __init__(self) -> None:
        self.saturated = [0, 0, 0]
        """Roll, pitch, yaw: 1 when more was asked for than was given, -1 when less, else 0."""

    def mix(self, roll: float, pitch: float, yaw: float, thrust: float) -> list[float]:
        """Rotor commands 0 to 1 (front right, rear left, front left, rear right) for torques and thrust 0 to 1."""
        a, b = SHARE * roll, SHARE * pitch
        rotors = [thrust - a + b, thrust + a - b, thrust + a + b, thrust - a - b]
        with_yaw = [rotors[0] + yaw, rotors[1] + yaw, rotors[2] - yaw, rotors[3] - yaw]
        if min(*with_yaw, *rotors) >= 0.0 and max(*with_yaw, *rotors) <= 1.0:
            self.saturated = [0, 0, 0]
            return with_yaw
        reduce_thrust(rotors)
        desaturate(rotors, ROLL)
        desaturate(rotors, PITCH)
        for i in range(4):
            rotors[i] += YAW[i] * yaw
        desaturate(rotors, YAW, high=1.0 + YAW_MARGIN)
        reduce_thrust(rotors)
        commands = [max(0.0, min(1.0, rotor)) for rotor in rotors]
        self._judge((roll, pitch, yaw), commands)
        return commands

    def _judge(self, wanted: tuple[float, float, float], commands: list[float]) -> None:
        u0, u1, u2, u3 = commands
        missing = (
            wanted[0] - 0.5 * SHARE * (-u0 + u1 + u2 - u3),
            wanted[1] - 0.5 * SHARE * (u0 - u1 + u2 - u3),
            wanted[2] - 0.25 * (u0 + u1 - u2 - u3),
        )
        achieved = sum(part * part for part in missing) < ACHIEVED
        self.saturated = [0 if achieved else (part > 1e-7) - (part < -1e-7) for part in missing]


def reduce_thrust(rotors: list[float]) -> None:
    """Take away thrust where that helps; never add any. Changes `rotors`."""
    if desaturation_gain(rotors, THRUST, 1.0) >= 0.0:
        desaturate(rotors, THRUST)


def desaturate(rotors: list[float], along: Rotors, high: float = 1.0) -> None:
    """Move commands along one axis towards 0 to `high`: all that helps, then half of what is left over."""
    for factor in (1.0, 0.5):
        gain = factor * desaturation_gain(rotors, along, high)
        if gain:
            for i in range(4):
                rotors[i] += gain * along[i]


def desaturation_gain(rotors: list[float], along: Rotors, high: float) -> float:
    """How far to go along an axis: the largest step needed down plus the largest needed up."""
    low_gain = high_gain = 0.0
    for rotor, part in zip(rotors, along, strict=True):
        if rotor < 0.0:
            gain = -rotor / part
        elif rotor > high:
            gain = (high - rotor) / part
        else:
            continue
        low_gain = min(low_gain, gain)
        high_gain = max(high_gain, gain)
    return low_gain + high_gain
