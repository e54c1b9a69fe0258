"""The search pattern: an Archimedean spiral flown at constant speed around a centre that may drift."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array

RAMP_S = 3.0  # [s] in which the speed is taken up


def spiral_offset(*, elapsed: float, speed: float, pitch: float, radius: float) -> tuple[Array, Array]:
    """Give the horizontal offset from the centre and its rate, at a time since the search began.

    Along r = b theta the arc length is about b theta^2 / 2, so theta = sqrt(2 v t / b). Outside `radius` the spiral
    is flown on as a circle.

    Args:
        elapsed: time since the start [s].
        speed: along the path [m/s].
        pitch: distance between turns [m].
        radius: largest distance from the centre [m].

    Returns:
        offset (2,) [m] north, east and its rate (2,) [m/s].
    """
    elapsed = max(elapsed, 0.0)
    share = min(1.0, elapsed / RAMP_S)  # of the speed: it grows evenly at first
    length = speed * (0.5 * elapsed * share if share < 1.0 else elapsed - 0.5 * RAMP_S)
    speed *= share
    b = pitch / (2.0 * math.pi)
    theta_edge = radius / b
    length_edge = 0.5 * b * theta_edge * theta_edge
    if length < length_edge:
        theta = math.sqrt(2.0 * length / b)
        r = b * theta
        # ds/dt = speed along b sqrt(1 + theta^2): near the centre the approximation would overstate the rate
        theta_rate = speed / (b * math.sqrt(1.0 + theta * theta))
        r_rate = b * theta_rate
    else:
        r = radius
        theta = theta_edge + (length - length_edge) / radius
        theta_rate = speed / radius
        r_rate = 0.0
    c, s = math.cos(theta), math.sin(theta)
    offset = np.array([r * c, r * s])
    rate = np.array([r_rate * c - r * theta_rate * s, r_rate * s + r * theta_rate * c])
    return offset, rate
