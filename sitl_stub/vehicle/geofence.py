"""PX4's cylinder around home: GF_MAX_HOR_DIST and GF_MAX_VER_DIST [m], zero: no limit (navigator/geofence.cpp)."""

import math
from collections.abc import Mapping

from sitl_stub.truth import Vector

INTERVAL = 0.2
"""How often the navigator looks [s]."""


def breach(parameters: Mapping[str, float], position: Vector, home: Vector) -> str:
    """Which limit `position` breaks: "distance", "altitude", or "" (positions in the local frame [m], ned)."""
    farthest, highest = parameters["GF_MAX_HOR_DIST"], parameters["GF_MAX_VER_DIST"]
    if farthest > 0.0 and math.hypot(position[0] - home[0], position[1] - home[1]) >= farthest:
        return "distance"
    if highest > 0.0 and home[2] - position[2] >= highest:
        return "altitude"
    return ""
