"""Whether the autopilot knows how far below it the ground is (`dist_bottom_valid`).

Follows EKF2 of PX4 v1.17: terrain_control.cpp, range_height_control.cpp. A range finder that gives no sound reading
leaves the terrain estimate to itself: its variance grows by EKF2_TERR_NOISE^2 x 10 ms a second = 0.25 m^2/s, and at
0.25 m^2 it is not trusted. That does not happen while the range is the height reference (conditional range aid).
"""

from sitl_stub.vehicle.estimator import Estimate

SHORTEST, LONGEST = 0.0, 10.0
"""Sound readings [m]."""
SMALLEST_COSINE = 0.7071
"""Of the angle between the range finder and the vertical."""
TRUSTED_FOR = 1.0
"""So long [s] the terrain estimate is trusted without a reading."""
AID_HEIGHT, AID_SPEED = 5.0, 1.0
"""Height [m] and speed [m/s] up to which the range is the height reference (EKF2_RNG_A_HMAX, EKF2_RNG_A_VMAX)."""
AID_START = 0.7
"""Share of both up to which that begins."""


class RangeTrust:
    """Judges one reading after the other."""

    __slots__ = ("_aids_height", "_without", "trusted")

    def __init__(self) -> None:
        self.trusted = True
        """Whether the distance to the ground is known."""
        self._aids_height = True
        self._without = 0.0

    def update(self, estimate: Estimate, *, landed: bool, dt: float) -> bool:
        """Take the present reading; landed and at rest, PX4 makes one up where there is none."""
        distance = estimate.range_down
        cosine = 1.0 - 2.0 * (estimate.qx * estimate.qx + estimate.qy * estimate.qy)
        sound = landed or (distance >= SHORTEST and cosine >= SMALLEST_COSINE)
        speed_squared = estimate.v_north * estimate.v_north + estimate.v_east * estimate.v_east
        share = 1.0 if self._aids_height else AID_START
        suits = distance < share * AID_HEIGHT and speed_squared < (share * AID_SPEED) ** 2
        self._aids_height = suits and (self._aids_height or sound)
        self._without = 0.0 if sound else self._without + dt
        if sound:
            self.trusted = True
        elif self._without > TRUSTED_FOR and not self._aids_height:
            self.trusted = False
        return self.trusted and distance < LONGEST
