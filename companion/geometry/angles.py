"""Angles in radians."""

from __future__ import annotations

import math


def wrap_angle(angle: float) -> float:
    """Bring an angle [rad] into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def angle_difference(a: float, b: float) -> float:
    """Give the shortest turn [rad] from `b` to `a`, in [-pi, pi)."""
    return wrap_angle(a - b)


def unwrap_near(angle: float, reference: float) -> float:
    """Give the angle [rad] equal to `angle` modulo a full turn that lies nearest to `reference`."""
    return reference + wrap_angle(angle - reference)
