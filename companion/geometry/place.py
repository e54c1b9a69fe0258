"""The place that a vehicle on the ground keeps: behind a target, at its heading."""

from __future__ import annotations

import numpy as np

from companion.geometry.arrays import Array


def distance_to_place(offset_ned: Array, target_yaw: Array, standoff: float) -> Array:
    """Give the horizontal distances to the place straight behind a target.

    Args:
        offset_ned: (n, 3) [m] from the target to the vehicle.
        target_yaw: (n,) [rad].
        standoff: how far [m] behind the target the place is; 0: the target itself.

    Returns:
        (n,) [m].
    """
    north = offset_ned[:, 0] + standoff * np.cos(target_yaw)
    east = offset_ned[:, 1] + standoff * np.sin(target_yaw)
    distance: Array = np.hypot(north, east)
    return distance
